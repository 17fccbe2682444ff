# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The PLC between a master and the drives: in virtual time, and in a thread on a TCP port."""

import contextlib
import struct
import time

from pymodbus.client import ModbusTcpClient
import pytest

from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.plc import Plc, PlcSetting
from nfo_sinus_driver.simulator.simulator import Simulator
from nfo_sinus_driver.simulator.timing import Timing

TIMEOUT = 10.0
#: For what comes by the clock of the PLC, s.
PATIENCE = 60.0
#: What starts each drive, word after word, its set-point for 20 Hz, and what its ZSW1 says then.
STARTS = {
    'sinus_optimal': ((0x0400, 0x0408, 0x0409), 3277),
    'sinus_g2': ((0x0476, 0x0477, 0x047F), 200),
    'sinus_h': ((0x0476, 0x0477, 0x047F), 2000),
}


class Bench:
    """A PLC with drives, asked by PDUs; time passes by command."""

    def __init__(self, *models, settings=None, drive_settings=None):
        self.drives = {
            address: simulated_drive(model, address, settings=drive_settings, boot_time=0.0)
            for address, model in enumerate(models, 1)
        }
        self.plc = Plc(self.drives, settings or PlcSetting())
        self.units = {unit.address: unit for unit in self.plc.units}
        self.now = 100.0
        self.life = 0
        self.plc.advance_to(self.now)

    def ask(self, pdu, unit=1):
        station = self.units[unit]
        station.advance_to(self.now)
        return server(station).answer(pdu)

    def read(self, register=0, count=5, unit=1):
        answer = self.ask(struct.pack('>BHH', 3, register, count), unit)
        assert answer[0] == 3, answer.hex()
        return struct.unpack(f'>{count}H', answer[2:])

    def write(self, register, *words, unit=1):
        data = struct.pack(f'>BHHB{len(words)}H', 16, register, len(words), 2 * len(words), *words)
        return self.ask(data, unit)

    def ros(self, stw1, setpoint):
        """Write and read as the driver does, by function 23."""
        self.life = (self.life + 1) & 0xFFFF
        pdu = struct.pack('>BHHHHBHhH', 23, 0, 5, 8, 3, 6, stw1, setpoint, self.life)
        answer = self.ask(pdu)
        assert answer[0] == 23, answer.hex()
        return struct.unpack('>HhHHH', answer[2:])

    def wait(self, seconds):
        self.now += seconds
        self.plc.advance_to(self.now)

    def live(self, seconds, *words):
        """Let a driver live, which writes every 50 ms."""
        for _ in range(round(seconds / 0.05)):
            self.wait(0.05)
            found = self.ros(*words)
        return found

    def start(self, model):
        words, setpoint = STARTS[model]
        for word in words:
            self.live(0.2, word, setpoint)
        found = self.live(6.0, words[-1], setpoint)
        assert found[1] == pytest.approx(setpoint, abs=2)
        return words[-1], setpoint

    @property
    def motor(self):
        return self.drives[1].motor


# --- the mailbox of layout 2 ---

LAYOUT_2 = PlcSetting(layout=2)


def asked(bench, number, command, pnu, sub_index=0, value=0, wait=0.5):
    """Ask as the driver does; return +24 to +27 after a while."""
    bench.write(17, command, pnu, sub_index, value >> 16, value & 0xFFFF)
    bench.write(16, number)
    bench.wait(wait)
    return bench.read(24, 4)


def test_parameters_of_a_g2_are_read_and_written_by_pnu():
    bench = Bench('sinus_g2', settings=LAYOUT_2)
    drive = bench.drives[1]
    assert bench.read()[4] == 2
    accel = round(1000 * drive.peek('control.accel'))
    assert asked(bench, 1, 1, 1028, 1) == (1, 0, accel >> 16, accel & 0xFFFF)
    assert asked(bench, 2, 2, 1028, 1, 100_000)[:2] == (2, 0)
    assert drive.peek('control.accel') == 100.0
    assert asked(bench, 3, 1, 922) == (3, 0, 0, 1)
    assert asked(bench, 4, 1, 2000)[:2] == (4, 2)
    assert asked(bench, 5, 2, 1007, 0, 0xFFFF) == (5, 1, 0, 2), 'f-Nom: out of its range'
    assert asked(bench, 6, 2, 944, 0, 1) == (6, 1, 0, 1), 'only to be read'
    assert asked(bench, 7, 1, 1028, 9) == (7, 2, 0, 3), 'it has no such sub-index'


def test_pnus_of_faults_have_the_active_ones_and_the_last_and_acknowledge_nothing():
    for model, fault, past in (('sinus_g2', 3, 1), ('sinus_h', 11, 8)):
        bench = Bench(model, settings=LAYOUT_2)
        drive = bench.drives[1]
        before = asked(bench, 1, 1, 944)[3]
        drive.trip(fault)
        assert asked(bench, 2, 1, 947, 0)[1:] == (0, 0, fault)
        assert asked(bench, 3, 1, 944)[3] == before + 1
        assert asked(bench, 4, 1, 947, past)[1:] == (0, 0, 0)
        assert drive.faults
        drive.faults.acknowledge()
        assert asked(bench, 5, 1, 947, 0)[1:] == (0, 0, 0)
        assert asked(bench, 6, 1, 947, past)[1:] == (0, 0, fault)


def test_an_access_takes_its_time_and_is_busy_meanwhile():
    bench = Bench('sinus_g2', settings=PlcSetting(layout=2, access_time=0.2))
    assert asked(bench, 1, 1, 922, wait=0.3)[:2] == (0, 3)
    bench.wait(0.2)
    assert bench.read(24, 4) == (1, 0, 0, 1)


def test_without_the_fieldbus_and_of_a_drive_without_pnus_there_is_no_access():
    bench = Bench('sinus_g2', 'sinus_optimal', settings=LAYOUT_2)
    bench.plc.channels[1].cut_until = bench.now + 1.0
    assert asked(bench, 1, 1, 922)[:2] == (1, 4)
    bench.wait(2.0)
    bench.write(16, 2)
    bench.wait(0.01)
    bench.plc.channels[1].cut_until = bench.now + 1.0
    bench.wait(0.5)
    assert bench.read(24, 2) == (2, 4)
    bench.write(17, 1, 922, 0, 0, 0, unit=2)
    bench.write(16, 1, unit=2)
    bench.wait(0.5)
    assert bench.read(24, 2, unit=2) == (1, 4)


def test_registers_of_the_plc_are_not_the_drivers_in_either_layout():
    bench = Bench('sinus_g2', settings=LAYOUT_2)
    for register, count in ((0, 1), (7, 2), (10, 2), (11, 1), (15, 2), (21, 2), (24, 1), (27, 1)):
        assert bench.write(register, *[1] * count)[0] == 0x90, register
    assert bench.ask(struct.pack('>BHH', 3, 0, 29))[0] == 0x83
    bench = Bench('sinus_g2')
    assert bench.write(16, 1)[0] == 0x90
    assert bench.ask(struct.pack('>BHH', 3, 0, 12))[0] == 0x83


# --- who watches whom ---


def test_drive_runs_by_the_words_in_its_block_and_stops_by_the_ramp_without_a_driver():
    for model in STARTS:
        bench = Bench(model, settings=PlcSetting(ros_time=1.5))
        word, setpoint = bench.start(model)
        assert bench.motor.frequency == pytest.approx(20.0, abs=0.05)
        assert bench.read()[3:] == (3, 1)
        bench.wait(1.4)
        assert bench.motor.frequency == pytest.approx(20.0, abs=0.05)
        bench.wait(0.3)
        assert bench.motor.driven and bench.motor.trend < 0, model
        if model == 'sinus_h':
            assert bench.drives[1].control_unit.report()['state'] == 'S1'
        bench.wait(4.0)
        assert not bench.motor.driven and not bench.motor.turning, model
        # what the driver has to hold: after such a gap it begins with the run bits clear [C108];
        # those whose Enable stood start at once, the Sinus H fell back to S1
        bench.live(2.0, word, setpoint)
        assert bench.motor.driven == (model != 'sinus_h')


def test_drive_without_power_or_with_another_telegram_is_not_valid():
    bench = Bench('sinus_h')
    word, setpoint = bench.start('sinus_h')
    bench.drives[1].power_cycle(2.0)
    assert not bench.live(1.0, word, setpoint)[3] & 1
    found = bench.live(2.0, word, setpoint)
    assert found[3] & 1
    assert found[:2] == (0x270, 0), 'it comes back at standstill'
    bench = Bench('sinus_h', drive_settings={'com.opt_para_13': 'Vendor Specific Telegram'})
    assert bench.live(1.0, 0x0476, 0) == (0, 0, 0, 2, 1)


def test_what_is_refused_and_writes_nothing():
    bench = Bench('sinus_optimal')
    for register, count in ((0, 12), (5, 7), (11, 1), (100, 1), (0xFFFF, 1), (15, 2)):
        assert bench.ask(struct.pack('>BHH', 3, register, count)) == b'\x83\x02', register
    for register in range(8):
        assert bench.write(register, 1) == b'\x90\x02', 'what the PLC writes'
    assert bench.write(7, 1, 2) == b'\x90\x02'
    for function in (1, 2, 4, 5, 6, 15, 17, 22, 43):
        assert bench.ask(struct.pack('>BHH', function, 8, 1)) == bytes((function | 0x80, 1))
    pdu = struct.pack('>BHHHHBHHH', 23, 0, 12, 8, 3, 6, 0x0400, 5, 7)
    assert bench.ask(pdu) == b'\x97\x02'
    assert bench.read(8, 3)[1:] == (0, 0)
    bench = Bench('sinus_optimal', settings=PlcSetting(write_and_read=False))
    assert bench.ask(pdu) == b'\x97\x01'


def test_what_no_plc_can_be():
    for wrong in (
        {'cycle': 0.0},
        {'exchange': -1.0},
        {'ros_time': 0.0},
        {'answer_time': (0.4, 0.05)},
        {'blocks': ((1, 0), (1, 10))},
        {'blocks': ((0, 0),)},
        {'blocks': ((1, 65530),)},
        {'blocks': ((1, -1),)},
    ):
        with pytest.raises(ValueError, match=r'possible|over another|first|no block'):
            PlcSetting(**wrong)
    with pytest.raises(ValueError, match='1 blocks for 2 drives'):
        Bench('sinus_h', 'sinus_h', settings=PlcSetting(blocks=((1, 0),)))
    with pytest.raises(ValueError, match='movitrac31 does not speak telegram1'):
        Bench('movitrac31')
    for options, reason in (
        ({'protocol': 'telegram1', 'also': ['modbus_tcp:0']}, 'no other line'),
        ({'protocol': 'modbus_tcp', 'also': ['telegram1:0']}, 'no PLC'),
        ({'protocol': 'modbus_rtu', 'plc': PlcSetting()}, 'no PLC'),
        ({'protocol': 'telegram1', 'link': '/tmp/nowhere'}, 'needs a TCP port'),
        ({'protocol': 'modbus_rtu', 'model': 'sinus_h'}, 'does not speak modbus_rtu'),
        ({'protocol': 'telegram1', 'model': 'movitrac31'}, 'does not speak telegram1'),
    ):
        with pytest.raises(ValueError, match=reason):
            Simulator(**options)


def test_a_unit_hears_everything_and_answers_within_its_time():
    bench = Bench('sinus_optimal', settings=PlcSetting(answer_time=(0.05, 0.4)))
    unit = bench.units[1]
    times = [unit.response_time for _ in range(200)]
    assert 0.05 <= min(times) < 0.1
    assert 0.35 < max(times) <= 0.4
    unit.note_frame()
    assert unit.hears('modbus_rtu', Timing())
    assert unit.listening


# --- as a thread, to a foreign master ---


class Master:
    """pymodbus's client."""

    def __init__(self, port):
        host, _, number = port.rpartition(':')
        self.client = ModbusTcpClient(host, port=int(number), timeout=TIMEOUT)
        assert self.client.connect()
        self.life = 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.client.close()

    @property
    def unit(self):
        # its name changed with pymodbus 3.10, and stands in no signature of some
        names = ModbusTcpClient.read_holding_registers.__kwdefaults__ or {}
        return {'device_id': 1} if 'device_id' in names else {'slave': 1}

    def exchange(self, stw1, setpoint):
        self.life += 1
        answer = self.client.readwrite_registers(
            read_address=0,
            read_count=5,
            write_address=8,
            values=[stw1, setpoint & 0xFFFF, self.life],
            **self.unit,
        )
        assert not answer.isError(), answer
        return answer.registers

    def until(self, condition, word, setpoint):
        deadline = time.monotonic() + PATIENCE
        while not condition(registers := self.exchange(word, setpoint)):
            assert time.monotonic() < deadline, registers
        return registers


@contextlib.contextmanager
def serving(model):
    with (
        Simulator(model=model, protocol='telegram1', boot_time=0.0) as simulator,
        Master(simulator.port) as master,
    ):
        yield simulator, master


def test_served_to_a_foreign_master():
    with serving('sinus_h') as (simulator, master):
        master.until(lambda found: found[0] & 0x47 == 0x01, 0x0476, 0)
        master.until(lambda found: found[0] & 0x47 == 0x03, 0x0477, 0)
        master.until(lambda found: found[1] > 10, 0x047F, 500)
        client, unit = master.client, master.unit
        assert not client.read_holding_registers(0, count=5, **unit).isError()
        assert client.read_holding_registers(0, count=12, **unit).isError()
        assert not client.write_registers(8, [0x0477, 0, 77], **unit).isError()
        state = simulator.state()
        assert state['plc']['block'][8:] == [0x0477, 0, 77]
        assert state['plc']['ros_alive'] is True
        # some versions of its client leave the socket without blocking
        client.socket.settimeout(TIMEOUT)
        client.socket.sendall(bytes.fromhex('000100000006090300000005'))
        assert client.socket.recv(64)[7:] == b'\x83\x0a', 'no such unit'


def test_injections_of_the_plc():
    with serving('sinus_optimal') as (simulator, master):
        master.until(lambda found: found[3] == 3, 0, 0)
        simulator.inject('release', 'off')
        master.until(lambda found: found[3] == 1, 0, 0)
        simulator.inject('fieldbus-cut', 60.0)
        master.until(lambda found: found[3] == 0, 0, 0)
        simulator.inject('fieldbus-cut', 0.0)
        master.until(lambda found: found[3] == 1, 0, 0)
        simulator.inject('plc-stop', 60.0)
        before = master.exchange(0, 0)
        assert all(master.exchange(0, 0)[2] == before[2] for _ in range(20))


def test_no_plc_no_injection():
    simulator = Simulator(protocol='modbus_tcp')
    for verb in (('release', 'off'), ('fieldbus-cut', 1.0), ('plc-stop', 1.0)):
        with pytest.raises(ValueError, match=r'no PLC.*--protocol telegram1'):
            simulator.inject(*verb)
    simulator.stop()
