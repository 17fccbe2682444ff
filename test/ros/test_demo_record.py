# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What ``make demo`` leaves behind: a bag that other programs open, and a picture of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import itertools
import math
from pathlib import Path
import statistics
import struct
import subprocess
import sys
import time
from typing import Any

from bench import Bench
from connections import needs
import pytest
import yaml

# who reads the bag, besides the driver's own; they come with `make setup`
matplotlib = pytest.importorskip('matplotlib.image', reason='matplotlib is not installed')
make_reader = pytest.importorskip('mcap.reader', reason='mcap is not installed').make_reader
AnyReader = pytest.importorskip('rosbags.highlevel', reason='rosbags is not installed').AnyReader

_DEMO = (sys.executable, '-m', 'nfo_sinus_driver.demo')
_DEMO_TIME = 300.0
#: A busy machine may leave out every other message of what comes at a steady rate.
_SHARE = 0.5
#: What the ramps (10 Hz/s) and the pauses of the run add up to at the least, s.
_LEAST_LENGTH = 20.0
_SETPOINT_RATE = 10.0
#: How late a message may be in the middle, and at the worst, s; the status of a poll is stamped
#: when it arrives, and published at the end of the poll.
_LAG = 0.2
#: How many statuses come between two polls in it at most: enable, set-points, fault, stops.
_CHANGES = 40
_WORST_LAG = 10.0

_EVENT = 'std_srvs/srv/{}_Event'
_TYPES = {
    '/nfo_sinus/setpoint': 'std_msgs/msg/Float32',
    '/nfo_sinus/status': 'nfo_sinus_msgs/msg/DriveStatus',
    '/nfo_sinus/inv_st': 'nfo_sinus_msgs/msg/InvSt',
    '/nfo_sinus/actual_speed': 'std_msgs/msg/Float32',
    '/nfo_sinus/actual_frequency': 'std_msgs/msg/Float32',
    '/nfo_sinus/telemetry': 'nfo_sinus_msgs/msg/Telemetry',
    '/nfo_sinus/enable/_service_event': _EVENT.format('SetBool'),
    '/nfo_sinus/stop/_service_event': _EVENT.format('Trigger'),
    '/nfo_sinus/fault_ack/_service_event': _EVENT.format('Trigger'),
    '/nfo_sinus/quick_stop/_service_event': _EVENT.format('Trigger'),
    '/nfo_sinus/rapid_stop/_service_event': _EVENT.format('Trigger'),
    '/nfo_sinus_bus/stop_all/_service_event': _EVENT.format('Trigger'),
    '/nfo_sinus_bus/disable_all/_service_event': _EVENT.format('Trigger'),
    '/nfo_sinus_bus/enable_all/_service_event': _EVENT.format('Trigger'),
    '/nfo_sinus_bus/statistics': 'nfo_sinus_msgs/msg/BusStatistics',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    '/rosout': 'rcl_interfaces/msg/Log',
}


@dataclass
class Bag:
    """What a bag holds: for each topic the times of receipt, s, and the messages."""

    times: dict[str, list[float]]
    messages: dict[str, list[Any]]

    def drive(self, topic: str) -> list[Any]:
        return self.messages[f'/nfo_sinus/{topic}']


@pytest.mark.timeout(3 * _DEMO_TIME)
def test_the_demo_is_recorded_and_drawn(tmp_path: Path) -> None:
    began = time.time()
    # a folder that is not there yet, for the demo makes it
    done = _demo('--output', str(tmp_path / 'a' / 'b'))
    ended = time.time()
    assert done.returncode == 0, done.stdout + done.stderr
    folder = tmp_path / 'a' / 'b' / 'ride'
    picture = tmp_path / 'a' / 'b' / 'ride.png'
    assert str(folder) in done.stdout, 'it says where the bag is'
    assert str(picture) in done.stdout, 'it says where the picture is'

    bag = _read(folder)
    _check_counts(bag)
    _check_times(bag, began, ended)
    _check_values(bag)
    _check_calls(bag)
    _check_metadata(folder, bag)
    _check_file(folder, bag)
    _check_picture(picture)

    again = _demo('--output', str(tmp_path / 'a' / 'b'))
    assert again.returncode == 2
    assert 'is there already' in again.stderr, 'nothing is written over'


def test_the_demo_fails_if_it_cannot_record() -> None:
    done = _demo('--output', '/proc/demo')
    assert done.returncode == 1
    assert 'FAILED: no bag can be written to /proc/demo/ride' in done.stderr


@pytest.mark.slow
@needs('own')
@pytest.mark.parametrize('always', [False, True])
def test_the_demo_leaves_the_drive_of_another_driver_alone(
    bench: Bench, tmp_path: Path, always: bool
) -> None:
    bench.simulator()
    bench.driver()
    client = bench.client().connected()
    # its first domain is taken; the second one is, too, or is not
    program = f"""
import contextlib, sys
from nfo_sinus_driver.demo import __main__ as demo
free = iter([] if {always} else [demo.own_domain])
tried = []
def own_domain():
    tried.append(1)
    return contextlib.nullcontext({bench.domain}) if len(tried) == 1 or {always} else next(free)()
demo.own_domain = own_domain
sys.exit(demo.main())
"""
    done = subprocess.run(
        [sys.executable, '-c', program, '--output', str(tmp_path / 'out')],
        capture_output=True, text=True, timeout=_DEMO_TIME, check=False,
    )
    found = f'there is another driver in ROS domain {bench.domain}, and it may have a real motor'
    assert f'{found}: the demo begins again in another domain' in done.stdout, done.stderr
    assert done.returncode == int(always), done.stderr
    assert (f'FAILED: {found}' in done.stderr) is always
    # the bag of the domain that was taken is not that of the run
    assert (tmp_path / 'out' / 'ride' / 'metadata.yaml').exists() is not always
    # statuses of both drives have come in here
    assert not any(message.enabled for message in client.messages['status'])


# --- the bag ----------------------------------------------------------------------------------


def _read(folder: Path) -> Bag:
    bag = Bag({}, {})
    # the definitions in the bag are all it has, and it compares them with the types' hashes
    with AnyReader([folder]) as reader:
        assert {connection.topic: connection.msgtype for connection in reader.connections} == _TYPES
        for connection, stamp, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            bag.times.setdefault(connection.topic, []).append(stamp / 1e9)
            bag.messages.setdefault(connection.topic, []).append(message)
    return bag


def _check_counts(bag: Bag) -> None:
    connected = [message for message in bag.drive('status') if message.connected]
    length = _seconds(connected[-1].header.stamp) - _seconds(connected[0].header.stamp)
    assert length > _LEAST_LENGTH
    counts = {topic: len(messages) for topic, messages in bag.messages.items()}
    cycles = [statistics.cycle_time for statistics in bag.messages['/nfo_sinus_bus/statistics']]
    cycle = statistics.median(time for time in cycles if not math.isnan(time))
    asked = bag.times['/nfo_sinus/setpoint']
    least = {
        '/nfo_sinus/status': length / cycle,
        '/nfo_sinus/actual_speed': length / cycle,
        '/nfo_sinus/actual_frequency': length / cycle,
        '/nfo_sinus/setpoint': (asked[-1] - asked[0]) * _SETPOINT_RATE,
        # a full bus leaves a sixth of its time to it, however slow the machine
        '/nfo_sinus/telemetry': counts['/nfo_sinus/status'] / 20,
        '/nfo_sinus_bus/statistics': length,
        # of drive and line at once
        '/diagnostics': length,
    }
    for topic, count in least.items():
        assert counts[topic] > _SHARE * count, topic
    for topic in ('actual_speed', 'actual_frequency'):
        # beside each poll a status is published where something changes
        assert -5 < len(connected) - counts[f'/nfo_sinus/{topic}'] < _CHANGES, topic


def _check_times(bag: Bag, began: float, ended: float) -> None:
    for topic, times in bag.times.items():
        assert began < times[0] and times[-1] < ended, topic
        assert all(a <= b for a, b in itertools.pairwise(times)), topic
    for topic, stamp in _stamped(bag).items():
        stamps = [stamp(message) for message in bag.messages[topic]]
        assert all(a <= b for a, b in itertools.pairwise(stamps)), topic
        lags = [a - b for a, b in zip(bag.times[topic], stamps, strict=True)]
        assert min(lags) > -0.001, f'{topic} was received before it was sent'
        assert statistics.median(lags) < _LAG, topic
        assert max(lags) < _WORST_LAG, topic


def _stamped(bag: Bag) -> dict[str, Callable[[Any], float]]:
    """The topics whose messages tell when, and how to read it."""
    found: dict[str, Callable[[Any], float]] = {}
    for topic in bag.messages:
        if topic.endswith('/_service_event'):
            found[topic] = lambda message: _seconds(message.info.stamp)
        # /diagnostics has two publishers, in whose order nothing lies
        elif hasattr(bag.messages[topic][0], 'header') and topic != '/diagnostics':
            found[topic] = lambda message: _seconds(message.header.stamp)
    assert len(found) == 7
    return found


def _check_values(bag: Bag) -> None:
    statuses = [message for message in bag.drive('status') if message.connected]
    assert {message.unit for message in statuses} == {'Hz'}
    for values in (
        [message.actual for message in statuses],
        [message.data for message in bag.drive('actual_frequency')],
    ):
        assert 29.5 < max(values) < 31
        assert -21 < min(values) < -19.5
        assert abs(values[-1]) < 0.1, 'it ends in standstill'
    assert not statuses[-1].enabled
    states = [state for state, _ in itertools.groupby(message.state for message in statuses)]
    faulted = states.index(statuses[0].FAULTED)
    assert statuses[0].OPERATION_ENABLED in states[:faulted]
    assert statuses[0].OPERATION_ENABLED in states[faulted:], 'it ran again'

    setpoints = (message.data for message in bag.drive('setpoint'))
    wanted = [value for value, _ in itertools.groupby(setpoints)]
    assert wanted == [30.0, -20.0, 0.0, 15.0]
    # 1480 rpm at 50 Hz
    speeds = [message.data for message in bag.drive('actual_speed')]
    assert 850 < max(speeds) < 920
    assert -620 < min(speeds) < -560
    currents = [message.output_current for message in bag.drive('telemetry')]
    assert all(0 <= current < 5 for current in currents)
    assert max(currents) > 1
    # the last one may be from before the standstill: it is measured five times a second at most
    assert 0 in currents

    faults = [message for message in bag.drive('inv_st') if message.kind == message.FAULT]
    told = {(fault.code, fault.text, fault.requires_ack) for fault in faults}
    assert told == {(5, 'Overload', True)}
    assert bag.drive('inv_st')[-1].text == 'Bus Stby'
    assert any('fault 5 Overload' in message.msg for message in bag.messages['/rosout'])


def _check_calls(bag: Bag) -> None:
    answers = {
        'enable': ['enabled', 'enabled'], 'fault_ack': ['acknowledged 5'], 'stop': ['stopping']
    }
    for service, beginnings in answers.items():
        events = bag.drive(f'{service}/_service_event')
        asked = [event.request[0] for event in events if event.request]
        answered = [event.response[0] for event in events if event.response]
        assert len(asked) == len(answered) == len(beginnings), service
        for response, beginning in zip(answered, beginnings, strict=True):
            assert response.success
            assert response.message.startswith(beginning)


def _check_metadata(folder: Path, bag: Bag) -> None:
    text = (folder / 'metadata.yaml').read_text()
    information = yaml.safe_load(text)['rosbag2_bagfile_information']
    # what Jazzy's rosbag2 writes
    assert information['version'] == 9
    assert information['storage_identifier'] == 'mcap'
    assert [(folder / name).is_file() for name in information['relative_file_paths']] == [True]
    assert 'simulated' in information['custom_data']['drive']
    offered = {}
    for topic in information['topics_with_message_count']:
        metadata = topic['topic_metadata']
        assert metadata['type_description_hash'].startswith('RIHS01_')
        assert topic['message_count'] == len(bag.messages.get(metadata['name'], ()))
        offered[metadata['name']] = [
            (qos['reliability'], qos['durability']) for qos in metadata['offered_qos_profiles']
        ]
    assert offered['/nfo_sinus/status'] == [('reliable', 'volatile')]
    assert offered['/nfo_sinus/inv_st'] == [('reliable', 'transient_local')]
    assert offered['/nfo_sinus/setpoint'] == [('best_effort', 'volatile')]


def _check_file(folder: Path, bag: Bag) -> None:
    """Have the file read by the library of those who define the format."""
    [path] = folder.glob('*.mcap')
    with path.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        seen = list(reader.iter_messages())
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == len(seen)
    assert len(seen) == sum(map(len, bag.messages.values()))
    schemas = {schema.name: schema for schema, _, _ in seen if schema is not None}
    assert schemas.keys() == set(_TYPES.values())
    for name, schema in schemas.items():
        assert schema.encoding == ('ros2idl' if '/srv/' in name else 'ros2msg')
    # as it was written, with what a person said of it, and with all it is made of
    definition = schemas['nfo_sinus_msgs/msg/InvSt'].data.decode()
    assert 'string remedy       # what to do about it' in definition
    assert 'MSG: std_msgs/msg/Header' in definition
    assert 'MSG: builtin_interfaces/msg/Time' in definition


# --- the picture ------------------------------------------------------------------------------


def _check_picture(path: Path) -> None:
    assert struct.unpack('>II', path.read_bytes()[16:24]) == (1600, 1000)
    pixels = matplotlib.imread(path)[..., :3]
    # a line through the picture is some thousand pixels
    for what, colour in (
        ('the paper', (255, 255, 255)),
        ('running', (0, 158, 115)),
        ('the fault', (213, 94, 0)),
        ('the set-point', (230, 159, 0)),
        ('the frequency', (0, 114, 178)),
        ('the current', (170, 68, 153)),
    ):
        close = abs(pixels * 255 - colour).max(axis=-1) < 3
        assert close.sum() > 1000, what


def _demo(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*_DEMO, *arguments], capture_output=True, text=True, timeout=_DEMO_TIME, check=False
    )


def _seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec * 1e-9)
