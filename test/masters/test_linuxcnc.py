# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
LinuxCNC's masters run the simulated drives of the shipped files as they run the real ones.

They have driven those for years, and know nothing of this project.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from pathlib import Path
import time
import uuid

from hal import Component, component, require, wait_until, write_ini
import pytest
from support.described import SHIPPED

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog.declared import read
from nfo_sinus_driver.simulator.simulator import Simulator

#: What its motor is made for.
_RPM_OF_HZ = 1410 / 50
#: Of its field, for masters that compare the speed with the set-point.
_RPM_OF_FIELD = 30
_PARITY = {'E': 'even', 'N': 'none'}
#: By then a master that writes cyclically has written several times, s.
_CYCLES = 0.3


class Drive:
    """The simulated drive of a shipped file, whose line has control."""

    def __init__(self, simulator: Simulator, name: str) -> None:
        self.file = read(SHIPPED[name])
        self.port = str(simulator.port)
        self._simulator = simulator

    @property
    def frequency(self) -> float:
        return float(self._simulator.state()['frequency'])

    @property
    def has_fault(self) -> bool:
        return bool(self._simulator.state()['faults'])

    def parameter(self, key: str) -> object:
        """Return what a parameter has."""
        simulated = next(iter(self._simulator.drives.values()))
        return simulated.peek(key)

    def give_setpoint(self, hertz: float) -> None:
        """Write the set-point to its register, in 0.01 % of the greatest frequency."""
        simulated = next(iter(self._simulator.drives.values()))
        with self._simulator.lock:
            greatest = float(simulated.peek('frequency.maximum'))
            simulated.write_raw(self.file.setpoint.key, round(10000 * hertz / greatest))

    def trip(self) -> int:
        """Let the first fault happen that it has; return its number."""
        simulated = next(iter(self._simulator.drives.values()))
        codes = simulated.model.status_codes.items()
        code = next(code for code, status in codes if status.kind is Kind.FAULT)
        self._simulator.inject('fault', code)
        return code

    def near(self, hertz: float) -> bool:
        return abs(self.frequency - hertz) < 0.3


@contextlib.contextmanager
def drive_of(name: str) -> Iterator[Drive]:
    file = read(SHIPPED[name])
    quick = dict.fromkeys((file.simulated.accel, file.simulated.decel), 0.5)
    required = {required.key: required.value for required in file.requires}
    line = file.line
    with Simulator(
        (line.address or 1,), model=str(SHIPPED[name]), baud=line.baud_rate,
        char_format=line.char_format, settings={**quick, **required},
    ) as simulator:
        yield Drive(simulator, name)


@contextlib.contextmanager
def spindle(
    program: str, drive: Drive, folder: Path
) -> Iterator[Component]:
    """Run a master that knows one make of drives."""
    require(program)
    line = drive.file.line
    bits, parity, stop_bits = line.char_format
    ini = write_ini(folder / 'master.ini', {'LINE': {
        'TYPE': 'rtu', 'DEVICE': drive.port, 'BAUD': line.baud_rate, 'BITS': bits,
        'PARITY': _PARITY[parity], 'STOPBITS': stop_bits, 'TARGET': line.address or 1,
    }})
    own = f'spindle-{uuid.uuid4().hex[:8]}'
    arguments = ['-n', own, '--ini', str(ini), '--section', 'LINE']
    with component(program, arguments, own, 'modbus-ok', folder / 'log') as master:
        wait_until(lambda: master.get('modbus-ok') == 1, 'it reads all that it wants')
        yield master


def test_vfs11_vfd(tmp_path: Path) -> None:
    with drive_of('toshiba_vf_s11') as drive, spindle('vfs11_vfd', drive, tmp_path) as master:
        master.set(enable=1, spindle_fwd=1, spindle_on=1, speed_command=20 * _RPM_OF_HZ)
        wait_until(lambda: drive.near(20), 'it runs forward')
        wait_until(lambda: abs(master.get('frequency-out') - 20) < 0.3, 'it shows the frequency')
        wait_until(lambda: master.get('at-speed') == 1, 'it is at its speed')
        master.set(speed_command=30 * _RPM_OF_HZ)
        wait_until(lambda: drive.near(30), 'it follows')
        master.set(spindle_on=0)
        wait_until(lambda: drive.frequency == 0, 'it stops')
        wait_until(lambda: master.get('is-stopped') == 1, 'it shows that it stands')
        master.set(spindle_fwd=0, spindle_rev=1, spindle_on=1)
        wait_until(lambda: drive.near(-30), 'it runs in reverse')
        number = drive.trip()
        wait_until(lambda: master.get('trip-code') == number, 'it shows the fault')
        wait_until(lambda: drive.frequency == 0, 'it stands in a fault')
        master.set(spindle_on=0)
        master.set(err_reset=1)
        wait_until(lambda: not drive.has_fault, 'the fault is reset')
        wait_until(lambda: master.get('trip-code') == 0, 'it shows none')
        assert drive.frequency == 0
        assert master.get('error-count') == 0, (tmp_path / 'log').read_text()


def test_vfdb_vfd(tmp_path: Path) -> None:
    """It resets no fault; its sign is the direction."""
    with drive_of('delta_ms300') as drive, spindle('vfdb_vfd', drive, tmp_path) as master:
        master.set(enable=1, spindle_on=1, speed_command=20 * _RPM_OF_HZ)
        wait_until(lambda: drive.near(20), 'it runs forward')
        wait_until(lambda: abs(master.get('frequency-out') - 20) < 0.3, 'it shows the frequency')
        wait_until(lambda: abs(master.get('motor-RPM') - 590) < 20, 'it shows the speed')
        master.set(speed_command=30 * _RPM_OF_HZ)
        wait_until(lambda: drive.near(30), 'it follows')
        master.set(spindle_on=0)
        wait_until(lambda: drive.frequency == 0, 'it stops')
        wait_until(lambda: master.get('is-stopped') == 1, 'it shows that it stands')
        master.set(spindle_on=1, speed_command=-20 * _RPM_OF_HZ)
        wait_until(lambda: drive.near(-20), 'it runs in reverse')
        number = drive.trip()
        wait_until(lambda: master.get('error-code') == number, 'it shows the fault')
        wait_until(lambda: drive.frequency == 0, 'it stands in a fault')
        assert master.get('error-count') == 0, (tmp_path / 'log').read_text()


def test_gs2_vfd(tmp_path: Path) -> None:
    """Its ramps and how it stops are written before the first run."""
    require('gs2_vfd')
    with drive_of('automationdirect_gs2') as drive:
        line = drive.file.line
        bits, parity, stop_bits = line.char_format
        own = f'gs2-{uuid.uuid4().hex[:8]}'
        arguments = [
            '-n', own, '-d', drive.port, '-r', str(line.baud_rate), '-b', bits,
            '-p', _PARITY[parity], '-s', stop_bits, '-t', str(line.address),
            '-A', '0.7', '-D', '0.6', '-X',
        ]  # fmt: skip
        with component('gs2_vfd', arguments, own, 'initialized', tmp_path / 'log') as master:
            assert master.get('initialized') == 0
            # it takes motors of 600 rpm and more, and 10 Hz and more
            master.set(**{'nameplate-HZ': 50, 'nameplate-RPM': 1410})
            master.set(enable=1)
            wait_until(lambda: master.get('initialized') == 1, 'it has written the ramps')
            assert drive.parameter('ramp.accel') == 0.7
            assert drive.parameter('ramp.decel') == 0.6
            assert drive.parameter('stop.method') == 'Ramp'
            wait_until(lambda: master.get('is-stopped') == 1, 'it shows that it stands')
            master.set(spindle_on=1, speed_command=20 * _RPM_OF_HZ)
            wait_until(lambda: drive.near(20), 'it runs forward')
            wait_until(lambda: abs(master.get('frequency-out') - 20) < 0.3, 'it shows how fast')
            wait_until(lambda: master.get('at-speed') == 1, 'it is at its speed')
            wait_until(lambda: abs(master.get('motor-RPM') - 590) < 20, 'it shows the speed')
            # it runs, by the line
            assert int(master.get('status-2')) & 0x82 == 0x82
            master.set(speed_command=30 * _RPM_OF_HZ)
            wait_until(lambda: drive.near(30), 'it follows')
            master.set(spindle_on=0)
            wait_until(lambda: drive.frequency == 0, 'it stops')
            wait_until(lambda: master.get('is-stopped') == 1, 'it shows that it stands')
            master.set(spindle_fwd=0, spindle_on=1)
            wait_until(lambda: drive.near(-30), 'it runs in reverse')
            assert int(master.get('status-2')) & 0x18 == 0x18
            number = drive.trip()
            wait_until(lambda: master.get('status-1') == number, 'it shows the fault')
            wait_until(lambda: drive.frequency == 0, 'it stands in a fault')
            master.set(spindle_on=0)
            time.sleep(_CYCLES)
            master.set(err_reset=1)
            wait_until(lambda: not drive.has_fault, 'the fault is reset')
            wait_until(lambda: master.get('status-1') == 0, 'it shows none')
            assert drive.frequency == 0
            master.set(err_reset=0, spindle_fwd=1, spindle_on=1)
            wait_until(lambda: drive.near(30), 'it runs again')
            master.set(enable=0)
            wait_until(lambda: drive.frequency == 0, 'it stops when it is disabled')
            assert master.get('error-count') == 0, (tmp_path / 'log').read_text()


def test_wj200_vfd(tmp_path: Path) -> None:
    """
    It resets each fault while it is enabled; not enabled it trips the drive, which is refused.

    That of LinuxCNC 2.10 reads the coil of 0 Hz, too, which no file can say for other masters.
    """
    require('wj200_vfd')
    with drive_of('hitachi_wj200') as drive:
        line = drive.file.line
        bits, parity, stop_bits = line.char_format
        arguments = [
            f'--baud={line.baud_rate}', f'--parity={parity}', f'--databits={bits}',
            f'--stopbits={stop_bits}', f'--device={drive.port}',
        ]
        log = tmp_path / 'log'
        with component('wj200_vfd', arguments, 'wj200-vfd.0', 'is-ready', log) as master:
            master.set(enable=1, commanded_frequency=20)
            # it begins when it has the address
            master.set(mbslaveaddr=line.address or 1)
            wait_until(lambda: master.get('is-ready') == 1, 'it is ready')
            assert master.get('is-running') == 0 and master.get('heatsink-temp') == 35
            master.set(run=1)
            wait_until(lambda: drive.near(20), 'it runs forward')
            wait_until(lambda: master.get('is-running') == 1, 'it shows that it runs')
            wait_until(lambda: master.get('is-at-speed') == 1, 'it is at its speed')
            assert master.get('motor-current') > 0
            master.set(commanded_frequency=30)
            wait_until(lambda: drive.near(30), 'it follows')
            master.set(run=0)
            wait_until(lambda: drive.frequency == 0, 'it stops')
            wait_until(lambda: master.get('is-running') == 0, 'it shows that it stands')
            master.set(reverse=1, run=1)
            wait_until(lambda: drive.near(-30), 'it runs in reverse')
            said = log.read_text()
            assert 'Modbus error' not in said, said
            # it resets no fault until it is enabled again
            master.set(enable=0)
            drive.trip()
            wait_until(lambda: master.get('is-alarm') == 1, 'it shows the fault')
            wait_until(lambda: drive.frequency == 0, 'it stands in a fault')
            master.set(run=0)
            time.sleep(_CYCLES)
            master.set(enable=1)
            wait_until(lambda: not drive.has_fault, 'the fault is reset')
            wait_until(lambda: master.get('is-alarm') == 0, 'it shows none')
            # it wrote no stop in the fault: what the drive then does is stopped now
            wait_until(lambda: drive.frequency == 0, 'it stops')
            wait_until(lambda: master.get('is-running') == 0, 'it shows that it stands')
            master.set(reverse=0, run=1)
            wait_until(lambda: drive.near(30), 'it runs again')


@contextlib.contextmanager
def percent_spindle(program: str, drive: Drive, folder: Path) -> Iterator[Component]:
    """
    Run a master whose set-points are parts of the greatest frequency.

    It waits only 16 or 30 ms for an answer, and tries again: it counts errors on a slow machine.
    It knows neither reverse nor a reset, and has one name.
    """
    require(program)
    line = drive.file.line
    bits, parity, stop_bits = line.char_format
    arguments = [
        '-d', drive.port, '-r', str(line.baud_rate), '-b', bits, '-p', _PARITY[parity],
        '-s', stop_bits, '-t', str(line.address or 1), '-S', str(50 * _RPM_OF_FIELD),
        '-F', '50', '-f', '1',
    ]
    # the pin that is made last
    ready = {'hy_gt_vfd': 'fault-info', 'svd-ps_vfd': 'AI2'}[program]
    with component(program, arguments, program, ready, folder / 'log') as master:
        wait_until(lambda: master.get('dc-bus-voltage') > 0, 'it reads')
        yield master


def run_in_percent(program: str, name: str, folder: Path) -> None:
    with drive_of(name) as drive, percent_spindle(program, drive, folder) as master:
        master.set(speed_cmd=20 * _RPM_OF_FIELD, spindle_on=1)
        wait_until(lambda: drive.near(20), 'it runs forward')
        wait_until(lambda: abs(master.get('freq-fb') - 20) < 0.3, 'it shows the frequency')
        assert master.get('freq-cmd') == pytest.approx(20)
        master.set(speed_cmd=30 * _RPM_OF_FIELD)
        wait_until(lambda: drive.near(30), 'it follows')
        wait_until(lambda: master.get('at-speed') == 1, 'it is at its speed')
        master.set(spindle_on=0)
        wait_until(lambda: drive.frequency == 0, 'it stops')
        wait_until(lambda: master.get('freq-fb') == 0, 'it shows that it stands')
        master.set(spindle_on=1)
        wait_until(lambda: drive.near(30), 'it runs again')
        number = drive.trip()
        wait_until(lambda: drive.frequency == 0, 'it stands in a fault')
        if program == 'hy_gt_vfd':
            wait_until(lambda: master.get('fault-info') == number, 'it shows the fault')
        master.set(spindle_on=0)
        time.sleep(5 * _CYCLES)
        assert drive.has_fault, 'its stop is no reset'


def test_hy_gt_vfd(tmp_path: Path) -> None:
    run_in_percent('hy_gt_vfd', 'huanyang_gt', tmp_path)


def test_svd_ps_vfd(tmp_path: Path) -> None:
    """It shows no fault."""
    run_in_percent('svd-ps_vfd', 'soyan_svd_ps', tmp_path)


def test_pi500_vfd(tmp_path: Path) -> None:
    """Its set-point is F0.01, which this simulated drive keeps, and does not follow."""
    require('pi500_vfd')
    own = f'pi500-{uuid.uuid4().hex[:8]}'
    with drive_of('powtran_pi500') as drive:
        line = drive.file.line
        bits, parity, stop_bits = line.char_format
        arguments = [
            '--device', drive.port, '--baud', str(line.baud_rate), '--parity', parity,
            '--databits', bits, '--stopbits', stop_bits, f'names={own}',
        ]
        with component('pi500_vfd', arguments, own, 'watchdog-out', tmp_path / 'log') as master:
            master.set(mbslaveaddr=line.address or 1, enable=1)
            wait_until(lambda: master.get('is-ready') == 1, 'it is ready')
            master.set(commanded_frequency=20, run=1)
            wait_until(lambda: drive.parameter('frequency.keypad') == 20, 'it has the set-point')
            wait_until(lambda: master.get('is-running') == 1, 'it runs')
            drive.give_setpoint(20)
            wait_until(lambda: drive.near(20), 'it runs forward')
            wait_until(lambda: master.get('is-at-speed') == 1, 'it is at its speed')
            assert master.get('motor-current') > 0
            master.set(run=0)
            wait_until(lambda: drive.frequency == 0, 'it stops')
            wait_until(lambda: master.get('is-ready') == 1, 'it shows that it stands')
            master.set(run=1)
            wait_until(lambda: drive.near(20), 'it runs again')
            # without enable it resets no fault
            master.set(enable=0)
            drive.trip()
            wait_until(lambda: master.get('is-alarm') == 1, 'it shows the fault')
            wait_until(lambda: drive.frequency == 0, 'it stands in a fault')
            master.set(run=0)
            assert drive.has_fault
            master.set(enable=1)
            wait_until(lambda: not drive.has_fault, 'the fault is reset')
            wait_until(lambda: master.get('is-alarm') == 0, 'it shows none')
            assert drive.frequency == 0


#: Of drives with a state machine: where commands and set-points go, what leads to a run, forward
#: and in reverse, what stops, resets, and leads to a run again; what 1 Hz is.
WORDS = {
    'abb_acs355': ((0, 1), (0x0476, 0x0477, 0x047F), 0x047E, 0x04F6, 400),
    'schneider_atv12': ((8501, 8502), (0x0006, 0x0007, 0x000F), 0x0007, 0x0080, 10),
}


@contextlib.contextmanager
def mb2hal(drive: Drive, command: int, setpoint: int, folder: Path) -> Iterator[Component]:
    """Run the master that writes all it has, cyclically."""
    require('mb2hal')
    line = drive.file.line
    bits, parity, stop_bits = line.char_format
    own = f'mb2hal-{uuid.uuid4().hex[:8]}'
    common = {
        'LINK_TYPE': 'serial', 'SERIAL_PORT': drive.port, 'SERIAL_BAUD': line.baud_rate,
        'SERIAL_BITS': bits, 'SERIAL_PARITY': _PARITY[parity], 'SERIAL_STOP': stop_bits,
        'SERIAL_DELAY_MS': 2, 'MB_SLAVE_ID': line.address or 1, 'PIN_NAMES': 'value',
        'MB_RESPONSE_TIMEOUT_MS': 500, 'MB_BYTE_TIMEOUT_MS': 500, 'MAX_UPDATE_RATE': 50, 'DEBUG': 1,
    }
    status = drive.file.status.registers[0]
    transactions = [
        ('command', 'fnct_06_write_single_register', command),
        ('setpoint', 'fnct_06_write_single_register', setpoint),
        ('status', 'fnct_03_read_holding_registers', status),
    ]
    ini = write_ini(folder / 'master.ini', {
        'MB2HAL_INIT': {
            'INIT_DEBUG': 1, 'HAL_MODULE_NAME': own, 'VERSION': '1.1', 'SLOWDOWN': 0.0,
            'TOTAL_TRANSACTIONS': len(transactions),
        },
        **{
            f'TRANSACTION_{number:02}': {
                **common, 'HAL_TX_NAME': name, 'MB_TX_CODE': code, 'FIRST_ELEMENT': register
            }
            for number, (name, code, register) in enumerate(transactions)
        },
    })
    log = folder / 'log'
    with component('mb2hal', [f'config={ini}'], own, 'status.value.int', log) as master:
        yield master


@pytest.mark.parametrize('name', WORDS)
def test_mb2hal(name: str, tmp_path: Path) -> None:
    (command, setpoint), to_run, stop, reset, hertz = WORDS[name]
    with drive_of(name) as drive, mb2hal(drive, command, setpoint, tmp_path) as master:

        def give(word: int) -> None:
            master.set(**{'command.value.int': word})
            time.sleep(_CYCLES)

        def run(speed: float) -> None:
            master.set(**{'setpoint.value.int': round(speed * hertz) & 0xFFFF})
            for word in to_run:
                give(word)
            wait_until(lambda: drive.near(speed), f'it runs at {speed} Hz')

        run(20.0)
        master.set(**{'setpoint.value.int': 30 * hertz})
        wait_until(lambda: drive.near(30), 'it follows')
        give(stop)
        wait_until(lambda: drive.frequency == 0, 'it stops')
        run(-20.0)
        drive.trip()
        wait_until(lambda: drive.frequency == 0, 'it stands in a fault')
        give(stop)
        give(reset)
        wait_until(lambda: not drive.has_fault, 'the fault is reset')
        run(10.0)
        for transaction in ('command', 'setpoint', 'status'):
            assert master.get(f'{transaction}.num_errors') == 0, (tmp_path / 'log').read_text()
