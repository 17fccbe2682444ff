# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Two wheels by ros2_control: the files that are there for it, and two simulated drives."""

from __future__ import annotations

from collections.abc import Callable
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from bench import A_WHILE, Bench, Client, holds_for, wait_until
from connections import needs
from nfo_sinus_msgs.msg import DriveStatus
import pytest
from topic_hardware import Component, Hardware, components
import yaml

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.node.messages.messages import Joint
from nfo_sinus_driver.node.parameters.settings import BUS_SETTINGS, DRIVE_SETTINGS
from nfo_sinus_driver.simulator.control import Client as Simulated

_CONFIG = Path(__file__).parents[2] / 'config'
_FOLDER = _CONFIG / 'diff_drive'
_WHEELS = ('left_wheel', 'right_wheel')
#: Hz, rad/s; what controllers.yaml has, and a speed that is a whole number of rpm of the motor.
_RATE = 50.0
_SPEED = 600 * 2 * math.pi / 60 / 20
#: Of the drives in place of their 1.5 s, s: a slow machine trips none of them.
_DRIVE_TIMEOUT = 16.0
#: Of the set-points, s.
_TIMEOUT = 0.5
_RUNS_DRY = f'no set-point for {_TIMEOUT:g} s: the motor ramps to a stop'


def sections(path: Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of a file by node."""
    nodes = yaml.safe_load(path.read_text())
    return {name.removeprefix('/**/'): node['ros__parameters'] for name, node in nodes.items()}


def names(parameters: dict[str, Any], prefix: str = '') -> set[str]:
    """Return the names of parameters, those in groups with dots."""
    found: set[str] = set()
    for key, value in parameters.items():
        name = f'{prefix}{key}'
        found |= names(value, f'{name}.') if isinstance(value, dict) else {name}
    return found


# --- the files --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    'name', ['single.yaml', 'conveyor.yaml', 'conveyor_32.yaml', 'diff_drive/drives.yaml']
)
def test_every_parameter_of_a_file_is_one_of_ours(name: str) -> None:
    nodes = sections(_CONFIG / name)
    bus = {*BUS_SETTINGS}
    drive = {*DRIVE_SETTINGS} | {parameter.key for parameter in load_family('sinus_g2').settings}
    drives = nodes['nfo_sinus_bus'].get('drives', ['nfo_sinus'])
    assert nodes.keys() - {'/**', 'nfo_sinus_bus'} <= set(drives)
    for node, parameters in nodes.items():
        known = {'/**': bus | drive, 'nfo_sinus_bus': bus}.get(node, drive)
        assert names(parameters) <= known, node


@pytest.mark.parametrize('name', ['conveyor.yaml', 'conveyor_32.yaml', 'diff_drive/drives.yaml'])
def test_all_drives_of_one_machine_stop_with_each_of_them(name: str) -> None:
    nodes = sections(_CONFIG / name)
    drives = {
        drive: {**nodes['/**'], **nodes[drive]} for drive in nodes['nfo_sinus_bus']['drives']
    }
    # one that is only monitored neither stops nor is stopped
    commanded = {name for name, given in drives.items() if given.get('control_method') != 'monitor'}
    for drive in commanded:
        assert {drive, *drives[drive].get('stop_with', ())} == commanded, drive


def test_nodes_joints_and_topics_agree_everywhere() -> None:
    drives = sections(_FOLDER / 'drives.yaml')
    assert drives['nfo_sinus_bus']['drives'] == list(_WHEELS)
    assert sections(_CONFIG / 'nav2' / 'lifecycle_manager.yaml')['lifecycle_manager_drives'] == {
        'node_names': list(_WHEELS), 'autostart': False, 'bond_timeout': 0.0,
        'service_timeout': 60.0,
    }
    parts = components(_FOLDER / 'robot.urdf')
    assert len(parts) == len(_WHEELS)
    for wheel, part in zip(_WHEELS, parts, strict=True):
        assert part.plugin == 'joint_state_topic_hardware_interface/JointStateTopicSystem'
        assert part.parameters == {
            'joint_commands_topic': f'/{wheel}/joint_command',
            'joint_states_topic': f'/{wheel}/joint_states',
            # sends every cycle
            'trigger_joint_command_threshold': '-1',
        }
        joint = drives[wheel]['joint_name']
        assert part.commands == {joint: ['velocity']}
        # its threshold asks for the state of whatever it commands
        assert part.states == {joint: ['position', 'velocity']}
        # a component is a node of its name
        assert part.name.lower() not in (*_WHEELS, 'nfo_sinus_bus')
    controller = yaml.safe_load((_FOLDER / 'controllers.yaml').read_text())
    wheels = controller['diff_drive_controller']['ros__parameters']
    assert wheels['left_wheel_names'] == [drives['left_wheel']['joint_name']]
    assert wheels['right_wheel_names'] == [drives['right_wheel']['joint_name']]
    assert drives['left_wheel']['gear_ratio'] == -drives['right_wheel']['gear_ratio']


def test_motors_can_do_what_the_controller_may_ask_for() -> None:
    drives = sections(_FOLDER / 'drives.yaml')
    every, gear = drives['/**'], drives['left_wheel']['gear_ratio']
    controller = yaml.safe_load((_FOLDER / 'controllers.yaml').read_text())
    wheels = controller['diff_drive_controller']['ros__parameters']
    assert controller['controller_manager']['ros__parameters']['update_rate'] == _RATE

    def rpm(what: str) -> float:
        turning = wheels[f'angular.z.max_{what}'] * wheels['wheel_separation'] / 2
        rim = wheels[f'linear.x.max_{what}'] + turning
        return float(rim / wheels['wheel_radius'] * gear * 60 / (2 * math.pi))

    assert rpm('velocity') <= every['setpoint_max']
    # a motor of two pole pairs makes 1500 rpm at its f-Nom of 50 Hz
    assert rpm('acceleration') <= 1500 / every['control']['accel']
    # many cycles, so that one that is late stops no drive; and the controller stops before
    assert every['setpoint_timeout'] >= 10 / _RATE
    assert wheels['cmd_vel_timeout'] <= every['setpoint_timeout'] < every['drive_timeout']


def test_worked_numbers_of_the_belt() -> None:
    # docs/control.md
    drum, gear, belt = 0.2, 20.0, 0.5
    joint = Joint(lambda: 'drum', lambda: gear)
    nominal = {'motor.f_nom': 50.0, 'motor.n_nom': 1440.0}
    parameters = SimpleNamespace(values=nominal)
    for mode, value in (('Speed', 955), ('Freque', 31.8)):
        drive = SimpleNamespace(
            snapshot=SimpleNamespace(control_mode=mode),
            parameters=parameters,
            model=load_family('sinus_g2'),
        )
        assert joint.setpoint(2 * belt / drum, drive) == pytest.approx(value, rel=0.002)


# --- two simulated drives ---------------------------------------------------------------------


def start(bench: Bench, *arguments: str) -> tuple:
    """Start two drives by the files, and enable them; return simulator, client and components."""
    addresses = ('--address', '1', '--address', '2')
    # both have the ramps of drives.yaml before, so that there is nothing to write to them
    simulator = bench.simulator(*addresses, '--set', 'control.mode=Speed', '--set',
                                'control.accel=1', '--set', 'control.retard=1')
    patient = [
        argument for wheel in _WHEELS
        for argument in ('-p', f'{wheel}:drive_timeout:={_DRIVE_TIMEOUT}')
    ]
    bench.driver(
        '--params-file', str(_FOLDER / 'drives.yaml'), *_line(bench), *patient, *arguments
    )
    for wheel in _WHEELS:
        bench.client(f'/{wheel}').connected()
    every_drive = bench.client('/nfo_sinus_bus')
    answer = every_drive.call('enable_all')
    assert answer.success, answer.message
    return simulator, every_drive, components(_FOLDER / 'robot.urdf')


def _line(bench: Bench) -> tuple[str, ...]:
    """Return what the file says of the line otherwise, which the bus node gets by its name."""
    return '-p', f'nfo_sinus_bus:port:={bench.port}'


def turns(simulator: Any, address: int) -> float:
    """Return how fast the motor of a drive turns, rpm."""
    return float(simulator.state(address)['speed'])


def command(parts: list[Component], speed: float) -> None:
    """Have all wheels turn at a speed, rad/s."""
    for part in parts:
        part.command.update(dict.fromkeys(part.commands, speed))


def reached(parts: list[Component], speed: float) -> bool:
    """Return whether the states of all wheels say a speed, rad/s, but for the last digit."""
    velocities = [velocity for part in parts for velocity in part.velocity.values()]
    return all(abs(velocity - speed) < 0.01 for velocity in velocities)


@needs('parameters', 'fast')
def test_wheels_follow_the_controller_and_stop_when_it_is_gone(bench: Bench) -> None:
    simulator, _, parts = start(bench)
    client = bench.client('/left_wheel')
    with Hardware(client, parts, _RATE) as hardware:
        command(parts, _SPEED)
        wait_until(lambda: reached(parts, _SPEED), 'the states of both wheels say so')
        assert turns(simulator, 1) == pytest.approx(600, abs=2)
        assert turns(simulator, 2) == pytest.approx(-600, abs=2)
        before = [dict(part.position) for part in parts]
        holds_for(A_WHILE, lambda: reached(parts, _SPEED), 'a steady state starves no motor')
        wait_until(
            lambda: all(
                part.position[joint] - position > _SPEED
                for part, was in zip(parts, before, strict=True)
                for joint, position in was.items()
            ),
            'both get on',
        )
    # the controller is gone
    for address in (1, 2):
        wait_until(lambda a=address: abs(turns(simulator, a)) < 1, 'it ramps to a stop')
    wait_until(
        lambda: all(f'{wheel}]: {_RUNS_DRY}' in bench.log for wheel in _WHEELS),
        'the log says so of each',
    )
    # and of nothing before, but where the machine stood still
    assert bench.log.count(_RUNS_DRY) == 2 or hardware.longest_gap > _TIMEOUT / 2
    assert client.newest('status').enabled
    # it is back
    parts = components(_FOLDER / 'robot.urdf')
    with Hardware(client, parts, _RATE):
        command(parts, -_SPEED)
        wait_until(lambda: reached(parts, -_SPEED), 'both go on, and backwards')


def _faults(simulator: Simulated, _: Client) -> None:
    simulator.inject('fault', 5, address=1)


def _is_lost(simulator: Simulated, _: Client) -> None:
    simulator.inject('silence', 3600.0, address=1)


def _is_stopped(_: Simulated, left: Client) -> None:
    assert left.call('stop').success


@needs('parameters', 'fast')
@pytest.mark.parametrize('happens', [_faults, _is_lost, _is_stopped])
def test_a_wheel_that_stops_stops_the_other_whatever_the_controller_sends(
    bench: Bench, happens: Callable[[Simulated, Client], None]
) -> None:
    simulator, every_drive, parts = start(bench)
    left, right = bench.client('/left_wheel'), bench.client('/right_wheel')

    def turning() -> bool:
        return any(simulator.state(unit)['turning'] for unit in (1, 2))

    with Hardware(left, parts, _RATE):
        command(parts, _SPEED)
        wait_until(lambda: reached(parts, _SPEED), 'both wheels turn')
        happens(simulator, left)
        right.wait_for(
            'status',
            lambda status: status.stop_reason == DriveStatus.REASON_STOP_WITH and not status.enabled
            and status.stop_text.startswith('it stops with /left_wheel: '),
            'the other one stops with it',
        )
        # it is back, or was never gone
        simulator.inject('silence', 0.0, address=1)
        wait_until(lambda: not turning(), 'both stand')
        left.connected()
        assert left.call('fault_ack').success or happens is not _faults
        holds_for(A_WHILE, lambda: not turning(), 'no command moves either')
    # what was sent before the enable starts nothing, and the enable alone neither
    wait_until(lambda: every_drive.call('enable_all').success, 'both can be enabled')
    holds_for(A_WHILE, lambda: not turning(), 'no set-point is fresh')
    parts = components(_FOLDER / 'robot.urdf')
    with Hardware(left, parts, _RATE):
        command(parts, _SPEED)
        wait_until(lambda: reached(parts, _SPEED), 'a fresh one moves both')


@needs('parameters', 'fast')
def test_silence_while_state_equals_command_starves_a_motor_that_runs(bench: Bench) -> None:
    _, _, parts = start(bench)
    for part in parts:
        # as it is where no setting says otherwise
        del part.parameters['trigger_joint_command_threshold']
    with Hardware(bench.client('/left_wheel'), parts, _RATE):
        # standing: nothing is sent, nothing is missed
        holds_for(A_WHILE, lambda: not any(part.sent for part in parts), 'state equals command')
        assert _RUNS_DRY not in bench.log
        # turning: the state gets to be the command, and the time-out takes it for silence
        command(parts, _SPEED)
        wait_until(lambda: _RUNS_DRY in bench.log, 'a motor is starved although nothing is wrong')
        # then state and command differ again
        wait_until(lambda: 'set-points arrive again' in bench.log, 'and turns again')


@needs('parameters', 'fast')
def test_each_drive_takes_its_own_joint_from_one_topic_for_both(bench: Bench) -> None:
    remapped = ('-r', '~/joint_command:=/wheels/joint_command')
    simulator, _, parts = start(bench, *remapped)
    left, right = parts
    both = Component(
        'wheels', left.plugin,
        {**left.parameters, 'joint_commands_topic': '/wheels/joint_command'},
        left.commands | right.commands, left.states | right.states,
        left.command | right.command, left.position | right.position,
        left.velocity | right.velocity,
    )
    both.command.update(left_wheel_joint=_SPEED, right_wheel_joint=_SPEED / 2)
    with Hardware(bench.client('/left_wheel'), [both], _RATE):
        wait_until(lambda: abs(turns(simulator, 1) - 600) < 2, 'the left one turns')
        wait_until(lambda: abs(turns(simulator, 2) + 300) < 2, 'the right one turns')
