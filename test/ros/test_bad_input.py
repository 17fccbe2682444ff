# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Wrong input of every kind: one clear message that names the remedy, and nothing moves."""

from __future__ import annotations

from collections.abc import Iterator
import math
import os
from pathlib import Path
import shutil
import stat
import subprocess
import sys
import time

from bench import A_WHILE, EXECUTED, PATIENCE, Bench, Client, Process, holds_for, wait_until
from connections import SILENCE, Connection, needs
from parameter_bench import refused, set_one
import pytest

from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.simulator.control import Client as Simulated

_CANNOT_START = 2


def _says(driver: Process, *parts: str) -> None:
    """Wait until the driver has said all parts in one line, and see that it says it once."""
    wait_until(
        lambda: any(all(part in line for part in parts) for line in driver.text.splitlines()),
        f'{parts} in the log',
    )
    lines = [line for line in driver.text.splitlines() if all(part in line for part in parts)]
    assert len(lines) == 1, lines


def _untouched(drive: Simulated) -> None:
    state = drive.state()
    assert not state['turning']
    assert not state['writes']
    assert not state['command_writes']


# --- the port -----------------------------------------------------------------------------------


def test_an_absent_port_is_waited_for(bench: Bench) -> None:
    driver = bench.driver()
    _says(driver, bench.port, *bench.connection.absent, 'retrying')
    bench.simulator()
    bench.client().connected()


@needs('serial')
def test_a_busy_port_is_waited_for_and_its_holder_is_named(bench: Bench) -> None:
    drive = bench.simulator()
    holder = subprocess.Popen(
        [
            sys.executable,
            '-c',
            'import fcntl, sys\n'
            'port = open(sys.argv[1], "rb+", buffering=0)\n'
            'fcntl.flock(port, fcntl.LOCK_EX)\n'
            'print("held", flush=True)\n'
            'sys.stdin.read()\n',
            bench.port,
        ],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    with holder:
        assert holder.stdout is not None
        assert holder.stdin is not None
        assert holder.stdout.readline() == b'held\n'
        driver = bench.driver()
        _says(driver, bench.port, 'in use by', f'(pid {holder.pid})', 'end that first')
        _untouched(drive)
        holder.stdin.close()
    bench.client().connected()


@needs('serial')
def test_a_second_driver_on_the_port_reports_what_has_it(bench: Bench) -> None:
    bench.simulator()
    first = bench.driver(through=EXECUTED)
    bench.client().connected()
    second = bench.driver('-r', '__ns:=/second')
    _says(second, 'in use by driver (pid ')
    assert first.running


@needs('serial')
def test_what_is_no_serial_port_is_named_so(bench: Bench) -> None:
    Path(bench.port).write_text('no port')
    _says(bench.driver(), bench.port, 'is not a serial port')


def _without_privileges() -> tuple[str, ...]:
    """Return what a command is run through so that not even root may open everything."""
    if os.geteuid():
        return ()
    through = ('setpriv', '--bounding-set=-dac_override,-dac_read_search')
    if not shutil.which('setpriv') or subprocess.run((*through, 'true'), check=False).returncode:
        pytest.skip('root, and not allowed to give up the right to open everything')
    return through


@needs('serial')
def test_a_port_without_permission_names_the_remedy(bench: Bench) -> None:
    drive = bench.simulator()
    device = os.path.realpath(bench.port)
    os.chmod(device, 0)
    driver = bench.driver(through=_without_privileges())
    _says(driver, 'no permission', 'dialout')
    _untouched(drive)
    os.chmod(device, stat.S_IRUSR | stat.S_IWUSR)
    bench.client().connected()


# --- the line -----------------------------------------------------------------------------------


def _checks_in_order(driver: Process, *words: str) -> None:
    line = next(line for line in driver.text.splitlines() if words[0] in line)
    places = [line.index(word) for word in words]
    assert places == sorted(places)


def test_no_drive_at_the_address_names_what_to_check_in_order(bench: Bench) -> None:
    drive = bench.simulator('--address', '3')
    driver = bench.driver('-p', 'address:=4')
    _says(driver, bench.connection.no_answer[0], '4', 'retrying')
    _checks_in_order(driver, *bench.connection.no_answer)
    client = bench.client()
    assert 'has not answered yet' in client.enable().message
    _untouched(drive)
    assert client.set_parameters(address=3).successful
    client.connected()


@needs('format')
def test_wrong_parity_is_silence_and_named_among_the_things_to_check(bench: Bench) -> None:
    # the simulated drive hears nothing of a line whose format is not its own
    drive = bench.simulator('--set', 'serial.si_prot=8b Op 1s', '--boot-time', '0.1')
    drive.inject('power-cycle')
    drive.wait_for(lambda state: not state['silent'], timeout=PATIENCE)
    driver = bench.driver()
    _says(driver, 'no response from address 1')
    _checks_in_order(driver, *SILENCE)
    _untouched(drive)


@needs('characters')
def test_garbage_is_distinguished_from_silence(bench: Bench) -> None:
    drive = bench.simulator()
    drive.inject('damage', 1000000)
    driver = bench.driver()
    _says(driver, *bench.connection.noise)
    _checks_in_order(driver, *bench.connection.noise)
    _untouched(drive)
    drive.inject('heal')
    bench.client().connected()


# --- set-points and commands --------------------------------------------------------------------


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_a_setpoint_that_is_no_number_is_ignored_with_one_warning(
    bench: Bench, value: float
) -> None:
    drive = bench.simulator(*bench.drives.ramps(1))
    driver = bench.driver()
    client = bench.client().connected()
    assert client.enable().success
    with client.setpoints(value):
        _says(driver, 'set-point', 'not a finite number')
        holds_for(A_WHILE, lambda: not drive.state()['turning'], 'standstill')
    assert driver.text.count('not a finite number') == 1


@needs('own')
def test_an_enable_is_advised_once_it_can_be_done(bench: Bench) -> None:
    simulated = bench.simulator()
    driver = bench.driver('-p', 'lost_after:=0.5')
    client = bench.client().connected()
    assert client.enable().success
    advice = 'set-points arrive, but the drive is not enabled: call /nfo_sinus/enable'
    with client.setpoints(5.0):
        simulated.inject('silence', 3.0)
        _says(driver, 'lost: ')
        holds_for(A_WHILE, lambda: advice not in driver.text, 'no advice that is refused')
        _says(driver, advice)
    assert driver.text.rindex('connected: ') < driver.text.index(advice)


@needs('direct', 'reverse')
def test_a_setpoint_beyond_the_limit_is_clamped_with_one_warning(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1))
    driver = bench.driver('-p', 'setpoint_max:=12.0')
    client = bench.client().connected()
    assert client.enable().success
    with client.setpoints(-4000.0):
        status = client.wait_for('status', lambda status: status.setpoint_clamped, 'clamped')
        assert status.setpoint == -12.0
        client.wait_for('status', lambda status: abs(status.actual + 12) < 0.3, '-12 Hz')
        _says(driver, 'set-point -4000 is limited to -12')
        # as far as the drive goes, where a setting says that the motor may
        assert client.set_parameters(setpoint_max=1000.0).successful
        most = bench.drives.most
        client.wait_for('status', lambda status: status.setpoint == -most, "the drive's limit")
    assert abs(drive.state()['setpoint']) == most


@needs('direct')
def test_a_setpoint_in_the_wrong_unit_does_not_race_the_motor(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1))
    driver = bench.driver()
    client = bench.client().connected()
    nominal = bench.drives.nominal
    for _ in range(2):
        assert client.enable().success
        # meant as rpm
        with client.setpoints(500.0):
            status = client.wait_for('status', lambda status: status.setpoint_clamped, 'clamped')
            assert status.setpoint == nominal
            client.wait_for('status', lambda status: abs(status.actual - nominal) < 0.3, 'nominal')
            drive.wait_for(lambda state: abs(state['setpoint']) == nominal, timeout=PATIENCE)
        assert client.enable(False).success
        # what is shown is of the next run then, and not of this one
        client.wait_for('status', lambda status: abs(status.actual) < 0.1, 'standstill')
    if nominal < bench.drives.most:
        said = f'set-point 500 is limited to {nominal:g} Hz, which is nominal for this motor'
        wait_until(lambda: driver.text.count(said) == 2, 'said once for each run')
        assert 'set setpoint_max of /nfo_sinus' in driver.text
    # more, where a setting says so
    assert client.set_parameters(setpoint_max=nominal - 10.0).successful
    assert client.enable().success
    with client.setpoints(500.0):
        client.wait_for('status', lambda status: status.setpoint == nominal - 10.0, 'as said')


def test_enable_with_a_standing_fault_says_which_and_what_to_do(bench: Bench) -> None:
    drive = bench.simulator()
    hot = bench.drives.hot_motor
    drive.inject('fault', hot.code, standing=True)
    bench.driver()
    client = bench.client().connected()
    refused = client.enable()
    assert not refused.success
    for part in (str(hot), *hot.explained, '/nfo_sinus/fault_ack'):
        assert part in refused.message
    assert not bench.drives.commanded(drive.state())
    assert not drive.state()['turning']


def test_what_to_call_is_named_in_full_wherever_it_is(bench: Bench) -> None:
    bench.simulator().inject('fault', bench.drives.hot_motor.code, standing=True)
    bench.driver('-r', '__ns:=/line1', '-r', '~/fault_ack:=reset')
    refused = bench.client('/line1/nfo_sinus').connected().enable()
    assert refused.message.endswith('then call /line1/reset')


@needs('local', 'parameters')
def test_enable_in_another_control_mode_than_expected_is_refused(bench: Bench) -> None:
    drive = bench.simulator('--set', 'control.mode=Speed')
    bench.driver('-p', 'expected_control_mode:=Freque')
    client = bench.client().connected()
    why = 'control mode Speed, expected is Freque'
    # on a busy machine an answer of the simulated drive may be late
    wait_until(lambda: why in client.enable().message, 'it is refused, and why')
    _untouched(drive)


# --- settings -----------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def untouched(
    tmp_path_factory: pytest.TempPathFactory, connection: Connection
) -> Iterator[tuple[Bench, Simulated]]:
    """One drive for all drivers that do not start."""
    with own_domain() as domain, Bench(domain, tmp_path_factory.mktemp('rig'), connection) as bench:
        yield bench, bench.simulator()


@pytest.mark.parametrize(
    ('arguments', 'parts'),
    [
        pytest.param(
            ['-p', 'address:=0'], ['nfo_sinus: address 0', '1 to 247'], marks=needs('modbus')
        ),
        pytest.param(
            ['-p', 'address:=95'], ['nfo_sinus: address 95', '0 to 94'], marks=needs('classic')
        ),
        (['-p', 'address:=256'], ['nfo_sinus: address 256', '0 to 255']),
        (['-p', 'address:=one'], ["address is 'one' (a string)", 'write a whole number']),
        (['-p', 'address:="1"'], ["address is '1' (a string)", 'write 1 without quotes']),
        # texts although the operator wrote no quotes: 2e0 by launch, 1_0 by ROS
        (['-p', 'lost_after:="2e0"'], ["lost_after is '2e0' (a string): write 2.0\n"]),
        (['-p', 'address:=1_0'], ["address is '1_0' (a string): write 10\n"]),
        (['-p', 'lost_after:="2.0"'], ["lost_after is '2.0' (a string): write 2.0 without quotes"]),
        (['-p', 'address:=2.5'], ['address is 2.5 (a double): write a whole number']),
        (['-p', 'frame_id:=7'], ["frame_id is 7 (an integer): write '7' with quotes"]),
        (['-p', 'rs485:="true"'], ["rs485 is 'true' (a string)", 'true without quotes']),
        (['-p', 'autostart:=1'], ['autostart is 1 (an integer): write true or false']),
        (['-p', 'setpoint_timeout:=-1'], ['setpoint_timeout -1', '0 to 3600 s']),
        (['-p', 'poll_rate:=.nan'], ['poll_rate nan', '0 to 1000 Hz']),
        (['-p', 'response_timeout:=11.0'], ['response_timeout 11', '0.01 to 10 s']),
        (['-p', 'retries:=11'], ['retries 11', '0 to 10']),
        (['-p', 'trace:=/nowhere/line'], ['trace /nowhere/line: No such file', 'name a file in']),
        pytest.param(
            ['-p', 'port:=foo://x'],
            ['port', 'there is no foo://', 'socket://host:port', 'rfc2217'],
            marks=needs('serial'),
        ),
        pytest.param(
            ['-p', 'port:=10.0.0.1:502'],
            ['port', 'no device', 'write socket://10.0.0.1:502'],
            marks=needs('serial'),
        ),
        pytest.param(['-p', 'port:=""'], ['port is empty'], marks=needs('serial')),
        pytest.param(
            ['-p', 'port:=/dev/ttyUSB0'], ['no gateway', 'host:port'], marks=needs('gateway')
        ),
        pytest.param(['-p', 'port:=""'], ['no gateway', 'host:port'], marks=needs('gateway')),
        pytest.param(
            ['-p', 'char_format:=7E1'], ['char_format', '8 data bits', '8E1'], marks=needs('eight')
        ),
        pytest.param(
            ['-p', 'char_format:=8E1'], ['char_format', '7 data bits', '7E1'], marks=needs('seven')
        ),
        (['-p', 'drive_timeout:=0.3'], ['drive_timeout', 'at least 1.5 s']),
        (['-p', 'control_method:=magic'], ['control_method', 'monitor']),
        (['-p', 'model:=sinus_g3'], ['model', 'sinus_g2']),
        (['-p', 'protocol:=profibus'], ['protocol', 'modbus_rtu']),
        (['-p', 'baud_rate:=12345'], ['baud_rate 12345', ' has ']),
        (['-p', 'char_format:=9X1'], ['char_format', '8E1']),
        (['-p', 'drives:=[one, one]'], ['one', 'its own name']),
        (['-p', 'drives:=[nfo_sinus_bus]'], ['nfo_sinus_bus']),
        (['-p', 'drives:=["1st"]'], ["'1st' (in drives", 'letters, digits and underscores']),
        (['-p', 'drives:=[]'], ['drives is empty', '[left, right]']),
        (['-p', 'drives:=left'], ["drives is 'left' (a string): write [left]"]),
        (['-p', 'drives:=[1, 2]'], ['drives is [1, 2]', 'a list of names']),
        (['-r', '__node:=1st'], ["'1st' (in drives, or as __node)", 'begins with no digit']),
        (['-p', 'drives:=[one, two]'], ['address 1', 'belongs to one', 'address of its own']),
        (['-p', 'drives:=[one, two]', '-r', '__node:=x'], ['x', '2 drives', 'drives']),
        (['-p', 'stop_with:=[other]'], ["no drive 'other' on this line: choose of nfo_sinus"]),
    ],
    ids=lambda value: ' '.join(value[1::2]) if value[0] in ('-p', '-r') else '',
)
def test_a_wrong_setting_at_the_start_ends_it_with_one_line(
    untouched: tuple[Bench, Simulated], arguments: list[str], parts: list[str]
) -> None:
    bench, drive = untouched
    driver = bench.driver(*arguments)
    assert driver.wait() == _CANNOT_START
    lines = [line for line in driver.text.splitlines() if 'cannot start' in line]
    assert len(lines) == 1, driver.text
    for part in parts:
        assert part in f'{lines[0]}\n'
    assert 'Traceback' not in driver.text
    _untouched(drive)


def test_a_character_format_needs_no_quotes(bench: Bench) -> None:
    formats = {'modbus_ascii': '7E1', 'classic': '7E1', 'movitrac': '8N1'}
    text = formats.get(bench.connection.protocol, '8E1')
    bench.simulator()
    bench.driver('-p', f'char_format:={text}')
    assert bench.client('/nfo_sinus_bus').parameter('char_format') == text


def test_unknown_names_in_a_parameter_file_are_warned_about(bench: Bench) -> None:
    parameters = bench.folder / 'misspelt.yaml'
    parameters.write_text(
        'nfo_sinus_bus: {ros__parameters: {respons_timeout: 0.3}}\n'
        # a text to ROS, and to others a date that there is not
        'nfo_sinus: {ros__parameters: {setpoint_timout: 1.0, retries: 3, frame_id: 2000-13-45}}\n'
        'nfo_sinsu: {ros__parameters: {address: 2}}\n'
    )
    bench.simulator()
    driver = bench.driver('--params-file', str(parameters))
    client = bench.client().connected()
    _says(driver, 'setpoint_timout', 'did you mean', 'setpoint_timeout')
    _says(driver, 'respons_timeout', 'did you mean', 'response_timeout')
    _says(driver, 'retries was given to nfo_sinus, but there is none', 'nfo_sinus_bus has it')
    _says(driver, 'nfo_sinsu', 'did you mean', 'nfo_sinus')
    assert 'port was given' not in driver.text, 'what the command line gives to all is no mistake'
    assert client.parameter('setpoint_timeout') == 2.5
    assert client.parameter('frame_id') == '2000-13-45'


@needs('own')
def test_a_parameter_file_in_any_encoding_that_ros_reads_is_taken(bench: Bench) -> None:
    parameters = bench.folder / 'wide.yaml'
    parameters.write_text('nfo_sinus: {ros__parameters: {setpoint_timeout: 1.25}}', 'utf-16')
    bench.simulator()
    bench.driver('--params-file', str(parameters))
    assert bench.client().connected().parameter('setpoint_timeout') == 1.25


@needs('own')
def test_what_is_no_parameter_file_is_named(bench: Bench) -> None:
    for path, why in ((bench.folder, 'it is a folder'), (bench.folder / 'none', 'is no such file')):
        driver = bench.driver('--params-file', str(path))
        assert driver.wait() == _CANNOT_START
        assert f'cannot start: --params-file {path}: ' in driver.text and why in driver.text


def test_a_name_for_the_whole_process_becomes_the_name_of_the_single_drive(bench: Bench) -> None:
    bench.simulator()
    bench.driver('-r', '__node:=belt')
    client: Client = bench.client('/belt').connected()
    nodes = wait_until(
        lambda: len(client.node.get_node_names()) > 2 and client.node.get_node_names(), 'nodes'
    )
    assert 'belt' in nodes
    assert 'nfo_sinus_bus' in nodes
    assert nodes.count('belt') == 1


@needs('own')
def test_a_name_that_is_none_is_answered_with_the_one_most_like_it(bench: Bench) -> None:
    bench.simulator()
    bench.driver()
    drive, bus = bench.client().connected(), bench.client('/nfo_sinus_bus')
    for client, name, near in (
        (drive, 'setpoint_timout', 'setpoint_timeout'),
        (drive, 'control.acel', 'control.accel'),
        (bus, 'respons_timeout', 'response_timeout'),
    ):
        # by the service that ros2 param set calls, and by the other one
        for answer in (set_one(client, name, 1.0), client.set_parameters(**{name: 1.0})):
            refused(answer, f'{name}: there is no such parameter', f'did you mean {near}')


@pytest.mark.parametrize(
    ('section', 'renames', 'namespace'),
    [
        ('belt', ['-r', '__node:=belt'], ''),
        # what launch makes of name= and namespace=
        ('/line1/belt', ['-r', '__node:=belt', '-r', '__ns:=/line1'], '/line1'),
        ('/**/belt', ['-r', '__node:=belt', '-r', '__ns:=/line1'], '/line1'),
    ],
)
@needs('direct')
def test_parameters_under_the_name_of_the_whole_process_reach_the_bus_node_too(
    bench: Bench, section: str, renames: list[str], namespace: str
) -> None:
    drive = bench.simulator('--address', '3')
    baud_rate, protocol = bench.connection.baud_rate, bench.connection.protocol
    parameters = bench.folder / 'named.yaml'
    parameters.write_text(
        '/**: {ros__parameters: {port: /dev/of_all, retries: 1}}\n'
        '/**/nfo_sinus_bus: {ros__parameters: {retries: 4, response_timeout: 0.3}}\n'
        f'{section}: {{ros__parameters: {{port: "{bench.port}", baud_rate: {baud_rate}, '
        f'protocol: {protocol}, model: {bench.connection.model}, address: 3, '
        'response_timeout: 0.5}}\n'
    )
    driver = bench.bare_driver(*renames, '--params-file', str(parameters))
    client = bench.client(f'{namespace}/belt').connected()
    assert client.parameter('address') == 3
    bus_node = bench.client(f'{namespace}/nfo_sinus_bus')
    wanted = {'port': bench.port, 'baud_rate': baud_rate, 'response_timeout': 0.5, 'retries': 4}
    assert {name: bus_node.parameter(name) for name in wanted} == wanted
    assert 'was given to' not in driver.text, 'nothing was given in vain'
    assert client.enable().success
    assert bench.drives.commanded(drive.state())
    assert not any('_nobody' in name for name in client.node.get_node_names())


# --- the tests themselves -----------------------------------------------------------------------


def test_a_driver_that_ends_by_itself_fails_a_test_at_once_with_what_it_said(bench: Bench) -> None:
    drive = bench.simulator()
    bench.driver('-p', 'address:=248')
    client = bench.client()
    begun = time.monotonic()
    with pytest.raises(AssertionError, match=r'ended by itself .2.*is connected[^$]*247'):
        client.connected()
    with pytest.raises(AssertionError, match=r'ended by itself .2.*no use waiting'):
        client.call('stop')
    assert time.monotonic() - begun < PATIENCE / 2
    _untouched(drive)
