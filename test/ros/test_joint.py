# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The output shaft as a joint, and set-points that say their unit and their time."""

from __future__ import annotations

import itertools
import math
import re
import threading
from types import SimpleNamespace
from typing import Any

from bench import A_WHILE, Bench, Client, holds_for, wait_until
from builtin_interfaces.msg import Time
from connections import needs
from nfo_sinus_msgs.msg import Setpoint
import pytest
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32

from nfo_sinus_driver.drive import Snapshot
from nfo_sinus_driver.drive.known.identity import Identity
from nfo_sinus_driver.node.messages.messages import Joint, require_whole
from nfo_sinus_driver.simulator.control import Client as Simulated

_RADIANS = 2 * math.pi
#: The simulated motor has two pole pairs: 20 Hz are 10 turns a second without slip.
_TURNS = 10.0


class Publisher:
    """Publishes one message again and again, while it is open."""

    def __init__(self, client: Client, topic: str, message: object) -> None:
        self._publisher = client.node.create_publisher(type(message), topic, 1)
        self._message = message
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)

    def __enter__(self) -> Publisher:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _work(self) -> None:
        while not self._ended.wait(0.05):
            self._publisher.publish(self._message)


def start(bench: Bench, *arguments: str, mode: str = 'Freque') -> tuple:
    options = bench.drives.ramps(0.5)
    if mode != 'Freque':
        options = (*options, '--set', f'control.mode={mode}')
    simulator = bench.simulator(*options)
    bench.driver('-p', f'expected_control_mode:={mode}', *arguments)
    client = bench.client().connected()
    client.listen('joint_states', JointState, '/nfo_sinus/joint_states', 10)
    return simulator, client


@needs('nominal')
@pytest.mark.parametrize('ratio', [1.0, -5.0])
def test_joint_command_turns_the_shaft_and_its_state_says_so(bench: Bench, ratio: float) -> None:
    # where the motor's poles are not known, Hz are no speed
    mode = 'Freque' if bench.connection.tells else 'Speed'
    simulator, client = start(
        bench, '-p', f'gear_ratio:={ratio}', '-p', 'joint_name:=belt', mode=mode
    )
    velocity = _RADIANS * _TURNS / ratio
    other = JointState(name=['other', 'belt'], velocity=[99.0, velocity])
    assert client.enable().success
    with Publisher(client, '/nfo_sinus/joint_command', other):
        wait_until(lambda: abs(simulator.state()['frequency'] - 20.0) < 1.0, 'it turns at 20 Hz')
        # the slip of the motor is a few percent
        state = client.wait_for(
            'joint_states',
            lambda message: message.velocity[0] == pytest.approx(velocity, rel=0.1),
            'the shaft turns as commanded',
        )
        assert list(state.name) == ['belt']
        before = client.newest('joint_states').position[0]
        way = math.copysign(1.0, velocity)
        wait_until(
            lambda: way * (client.newest('joint_states').position[0] - before) > 1.0,
            'the shaft gets on',
        )


@pytest.mark.parametrize('period', [0.02, 1.5, 4.0])
def test_position_is_the_integral_of_the_speed_while_connected(period: float) -> None:
    joint = Joint(lambda: 'belt', lambda: 2.0)
    clock = itertools.count(1)

    def polled(*speeds: float, connected: bool = True) -> float:
        for rpm in speeds:
            joint.move(Snapshot(next(clock) * period, connected, False, '', speed=rpm))
        return float(joint.state(Time(), '').position[0] / _RADIANS)

    # as where nothing was measured yet
    assert polled(math.nan, 0.0) == 0
    # from 0 to 240 rpm and back: half of that on the way
    assert polled(240.0, 240.0, 0.0) == pytest.approx(240 / 60 / 2 * 2 * period)
    before = polled(-240.0, -240.0)
    # while it is not connected it may have turned, or not
    assert polled(-240.0, connected=False) == before
    assert polled(-240.0) == before
    assert polled(-240.0) == pytest.approx(before - 240 / 60 / 2 * period)


@pytest.mark.parametrize('speeds', [
    (60.0, 60.0, 60.0, 60.0), (60.0, math.nan, 60.0, 60.0), (60.0, math.nan, math.nan, 60.0)
])
def test_a_speed_that_was_not_measured_costs_no_way(speeds: tuple[float, ...]) -> None:
    joint = Joint(lambda: 'belt', lambda: 1.0)
    for at, rpm in enumerate(speeds, start=1):
        joint.move(Snapshot(at, True, False, '', speed=rpm))
        state = joint.state(Time(), '')
        assert state.velocity[0] == pytest.approx(rpm / 60 * _RADIANS, nan_ok=True)
    assert state.position[0] == pytest.approx(3 * _RADIANS)


def test_after_a_long_pause_the_position_is_where_it_was() -> None:
    joint = Joint(lambda: 'belt', lambda: 1.0)
    for at in (1.0, 2.0, 62.0):
        joint.move(Snapshot(at, True, False, '', speed=60.0))
    assert joint.state(Time(), '').position[0] == pytest.approx(_RADIANS)


def test_a_joint_command_without_our_joint_is_reported_once(bench: Bench) -> None:
    simulator, client = start(bench)
    assert client.enable().success
    other = JointState(name=['left', 'right'], velocity=[9.0, 9.0])
    with Publisher(client, '/nfo_sinus/joint_command', other):
        said = '/nfo_sinus/joint_command has no joint nfo_sinus, only left, right'
        wait_until(lambda: said in bench.log, 'it says so')
        before = len(client.messages['status'])
        wait_until(lambda: len(client.messages['status']) > before + 20, 'more commands')
    assert bench.log.count(said) == 1
    assert not simulator.state()['frequency']


def test_a_command_that_is_ignored_while_the_drive_is_lost_says_so(bench: Bench) -> None:
    simulator, client = start(bench)
    simulator.inject('silence', 3600.0)
    client.wait_for('status', lambda status: not status.connected, 'it is lost')
    command = JointState(name=['nfo_sinus'], velocity=[9.0])
    with Publisher(client, '/nfo_sinus/joint_command', command):
        wait_until(lambda: 'joint command ignored: the drive is lost' in bench.log, 'it says so')
    setpoint = Setpoint(value=9.0, unit=Setpoint.HZ)
    with Publisher(client, '/nfo_sinus/setpoint_stamped', setpoint):
        wait_until(lambda: 'set-point ignored: the drive is lost' in bench.log, 'it says so')


def test_a_command_before_the_drive_was_read_says_so() -> None:
    drive = SimpleNamespace(
        snapshot=SimpleNamespace(control_mode=''),
        state=SimpleNamespace(contact=SimpleNamespace(connected=True)),
    )
    for identity in (None, Identity()):
        drive.identity = identity
        with pytest.raises(ValueError, match='the drive has not been read yet'):
            Joint(lambda: 'belt', lambda: 1.0).setpoint(1.0, drive)


def test_a_joint_command_of_arrays_that_do_not_match_moves_nothing(bench: Bench) -> None:
    simulator, client = start(bench, '-p', 'joint_name:=belt')
    assert client.enable().success
    speed = _RADIANS * _TURNS
    for message, said in (
        (
            JointState(name=['other', 'belt', 'third'], velocity=[speed, speed]),
            'joint command ignored: 3 names, but 2 values of velocity',
        ),
        (
            JointState(name=['belt', 'belt'], velocity=[speed, 0.0]),
            'joint command ignored: it names belt twice',
        ),
    ):
        with Publisher(client, '/nfo_sinus/joint_command', message):
            wait_until(lambda said=said: said in bench.log or turns(simulator), 'it says so')
            holds_for(A_WHILE, lambda: not turns(simulator), said)
        assert bench.log.count(said) == 1
    # what a joint has not got is an array without values
    right = JointState(name=['other', 'belt'], velocity=[99.0, speed])
    with Publisher(client, '/nfo_sinus/joint_command', right):
        wait_until(lambda: turns(simulator), 'one that is whole is followed')


def turns(simulator: Simulated) -> bool:
    return bool(simulator.state()['turning'])


@pytest.mark.parametrize(
    ('message', 'why'),
    [
        (
            JointState(name=['a', 'b', 'c'], velocity=[1.0, 2.0]),
            '3 names, but 2 values of velocity',
        ),
        (JointState(name=['a'], velocity=[1.0, 2.0]), '1 names, but 2 values of velocity'),
        (JointState(velocity=[1.0]), '0 names, but 1 values of velocity'),
        (
            JointState(name=['a', 'b'], velocity=[1.0, 2.0], position=[0.0]),
            '2 names, but 1 values of position',
        ),
        (
            JointState(name=['a'], velocity=[1.0], effort=[0.0, 0.0, 0.0]),
            '1 names, but 3 values of effort',
        ),
        # of its joint or of another one: whatever reads it, reads it alike
        (JointState(name=['a', 'b', 'a'], velocity=[1.0, 2.0, 3.0]), 'it names a twice'),
        (JointState(name=['a', 'a', 'a'], velocity=[1.0, 2.0, 3.0]), 'it names a twice'),
    ],
)
def test_what_no_joint_state_may_be(message: JointState, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        require_whole(message)


def test_what_a_joint_state_may_be() -> None:
    for message in (
        JointState(),
        JointState(name=['a', 'b']),
        JointState(name=['a', 'b'], velocity=[1.0, 2.0]),
        JointState(name=['a'], position=[0.0], velocity=[1.0], effort=[math.nan]),
    ):
        require_whole(message)


@needs('reverse')
def test_set_point_with_a_unit_and_a_time(bench: Bench) -> None:
    simulator, client = start(bench)
    assert client.enable().success
    topic = '/nfo_sinus/setpoint_stamped'
    with Publisher(client, topic, Setpoint(value=600.0, unit=Setpoint.RPM)):
        wait_until(lambda: 'set-point in rpm ignored' in bench.log, 'it says so')
    old = Setpoint(value=15.0, unit=Setpoint.HZ)
    old.header.stamp.sec = 1
    with Publisher(client, topic, old):
        wait_until(lambda: 'it was made' in bench.log, 'it says so')
    assert not simulator.state()['frequency']
    with Publisher(client, topic, Setpoint(value=15.0, unit=Setpoint.HZ)):
        wait_until(lambda: abs(simulator.state()['frequency'] - 15.0) < 0.1, 'it turns at 15 Hz')
    now = client.node.get_clock().now().to_msg()
    fresh = Setpoint(value=-12.0, unit=Setpoint.HZ)
    fresh.header.stamp = now
    with Publisher(client, topic, fresh):
        wait_until(lambda: simulator.state()['frequency'] < -1.0, 'it turns the other way')


#: What a stamp cannot be, and yet is, s and ns: before the epoch, and as late as its type goes.
_IMPOSSIBLE = ((-1, 0), (-(2**31), 2**32 - 1), (2**31 - 1, 2**32 - 1))
_HOUR, _DAY = 3600.0, 86400.0
_AHEAD = 's ahead of the clock of this node'


def stamped(client: Client, message: Any, ahead: float) -> Any:
    """Give a message the stamp of a moment that is to come, s."""
    stamp = client.node.get_clock().now() + Duration(seconds=ahead)
    message.header.stamp = stamp.to_msg()
    return message


def test_a_set_point_of_a_clock_that_is_ahead_is_ignored_and_that_is_reported_once(
    bench: Bench,
) -> None:
    simulator, client = start(bench)
    assert client.enable().success

    def message(ahead: float) -> Any:
        return stamped(client, Setpoint(value=15.0, unit=Setpoint.HZ), ahead)

    path = '/nfo_sinus/setpoint_stamped'
    for ahead in (_HOUR, _DAY):
        with Publisher(client, path, message(ahead)):
            wait_until(lambda: _AHEAD in bench.log or turns(simulator), 'it says so')
            holds_for(A_WHILE, lambda: not turns(simulator), 'it is not followed')
        assert bench.log.count(_AHEAD) == 1
    assert re.search(r'its stamp is 3[56]\d\d\.\d s ahead .* chrony.* use_sim_time', bench.log)
    # one that was late does not count either
    with Publisher(client, path, message(-_HOUR)):
        wait_until(lambda: 'it was made 360' in bench.log or turns(simulator), 'it says so')
    assert not turns(simulator)
    # a little is no reason: no two clocks are the same
    with Publisher(client, path, message(1.0)):
        wait_until(lambda: turns(simulator), 'it is followed')
    client.wait_for('status', lambda status: not status.setpoint, 'no set-point arrives')
    wait_until(lambda: not turns(simulator), 'it stands')
    with Publisher(client, path, message(_HOUR)):
        wait_until(lambda: bench.log.count(_AHEAD) == 2, 'it was right, and is wrong again')
    assert not turns(simulator)


def test_a_stamp_that_cannot_be_is_no_error_of_the_driver(bench: Bench) -> None:
    simulator, client = start(bench)
    assert client.enable().success
    for seconds, nanoseconds in _IMPOSSIBLE:
        message = Setpoint(value=15.0, unit=Setpoint.HZ)
        message.header.stamp.sec = seconds
        message.header.stamp.nanosec = nanoseconds
        with Publisher(client, '/nfo_sinus/setpoint_stamped', message):
            holds_for(1.0, lambda: not turns(simulator), 'it is not followed')
    assert 'set-point ignored: it was made' in bench.log
    # that there is no traceback, each test sees at its end
    fine = stamped(client, Setpoint(value=15.0, unit=Setpoint.HZ), 0.0)
    with Publisher(client, '/nfo_sinus/setpoint_stamped', fine):
        wait_until(lambda: turns(simulator), 'the next one counts')


@needs('parameters')
def test_newest_valid_set_point_counts_whichever_topic_it_came_from(bench: Bench) -> None:
    simulator, client = start(bench, '-p', 'setpoint_timeout:=0.0', '-p', 'joint_name:=belt')
    assert client.enable().success
    stamped = '/nfo_sinus/setpoint_stamped'
    belt = JointState(name=['belt'], velocity=[_RADIANS * _TURNS])
    for topic, message, frequency in (
        ('/nfo_sinus/setpoint', Float32(data=10.0), 10.0),
        (stamped, Setpoint(value=15.0, unit=Setpoint.HZ), 15.0),
        ('/nfo_sinus/joint_command', belt, 20.0),
        ('/nfo_sinus/setpoint', Float32(data=-5.0), -5.0),
    ):
        with Publisher(client, topic, message):
            wait_until(
                lambda wanted=frequency: abs(simulator.state()['frequency'] - wanted) < 0.1,
                f'{topic} is followed',
            )
    # one that is not valid is no newer than any other
    for topic, message, reason in (
        (stamped, Setpoint(value=40.0, unit=Setpoint.PERCENT_TORQUE), 'torque ignored'),
        ('/nfo_sinus/setpoint', Float32(data=math.nan), 'not a finite number'),
        ('/nfo_sinus/joint_command', JointState(name=['belt']), 'it has no velocity'),
    ):
        with Publisher(client, topic, message):
            wait_until(lambda said=reason: said in bench.log, 'it is reported')
    assert abs(simulator.state()['frequency'] + 5.0) < 0.1


def test_factors_that_make_no_speed_are_refused(bench: Bench) -> None:
    _, client = start(bench)
    for name in ('gear_ratio', 'scale'):
        for factor in (0.0, math.nan, math.inf, -math.inf, 1e308, 1e-308):
            result = client.set_parameters(**{name: factor})
            assert not result.successful
            assert name in result.reason and 'never 0' in result.reason
