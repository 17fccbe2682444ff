# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A stand-in for ros2_control with joint_state_topic_hardware_interface, on a robot's own URDF."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
import threading
import time
from xml.etree import ElementTree

from bench import Client
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState


@dataclass
class Component:
    """One ``ros2_control`` tag: its commands, and what it does in a cycle."""

    name: str
    plugin: str
    parameters: dict[str, str]
    #: The interfaces of each joint.
    commands: dict[str, list[str]]
    states: dict[str, list[str]]
    command: dict[str, float] = field(default_factory=dict)
    position: dict[str, float] = field(default_factory=dict)
    velocity: dict[str, float] = field(default_factory=dict)
    #: How many commands it has sent.
    sent: int = 0

    @property
    def threshold(self) -> float:
        """How far command and state must be apart, all joints together, that it sends."""
        return float(self.parameters.get('trigger_joint_command_threshold', '1e-5'))

    def read(self, newest: JointState | None) -> None:
        """Take the newest message, of whichever of its joints it tells; it knows no other."""
        for index, joint in enumerate([] if newest is None else newest.name):
            if joint in self.states:
                self.position[joint] = newest.position[index]
                self.velocity[joint] = newest.velocity[index]

    def write(self) -> JointState | None:
        """Return the command to send, if there is one to send."""
        apart = sum(abs(self.velocity[joint] - self.command[joint]) for joint in self.commands)
        if apart <= self.threshold:
            return None
        joints = list(self.commands)
        return JointState(name=joints, velocity=[self.command[joint] for joint in joints])


def components(urdf: Path) -> list[Component]:
    """Return the components of a robot."""
    return [_component(tag) for tag in ElementTree.parse(urdf).getroot().iter('ros2_control')]


def _component(tag: ElementTree.Element) -> Component:
    hardware = tag.find('hardware')
    assert hardware is not None
    joints = {joint.attrib['name']: joint for joint in tag.findall('joint')}
    still = dict.fromkeys(joints, 0.0)
    return Component(
        tag.attrib['name'],
        hardware.findtext('plugin', ''),
        {parameter.attrib['name']: parameter.text or '' for parameter in hardware.findall('param')},
        {name: _interfaces(joint, 'command') for name, joint in joints.items()},
        {name: _interfaces(joint, 'state') for name, joint in joints.items()},
        dict(still),
        dict(still),
        dict(still),
    )


def _interfaces(joint: ElementTree.Element, kind: str) -> list[str]:
    return [interface.attrib['name'] for interface in joint.findall(f'{kind}_interface')]


class Hardware:
    """
    Some components at work at a rate (Hz), while it is open.

    Between two cycles each keeps the newest message alone, as the real one does.

    :ivar longest_gap: between two cycles, s: on a busy machine they do not come at their rate.
    """

    def __init__(self, client: Client, parts: list[Component], rate: float) -> None:
        self._period = 1 / rate
        self.longest_gap = 0.0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._newest: dict[str, JointState] = {}
        self._parts = []
        for part in parts:
            publisher = client.node.create_publisher(
                JointState, part.parameters['joint_commands_topic'], 1
            )
            client.node.create_subscription(
                JointState,
                part.parameters['joint_states_topic'],
                lambda message, name=part.name: self._newest.update({name: message}),
                qos_profile_sensor_data,
            )
            self._parts.append((part, publisher))

    def __enter__(self) -> Hardware:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _work(self) -> None:
        due = last = time.monotonic()
        while not self._ended.wait(max(0.0, due - time.monotonic())):
            due += self._period
            self.longest_gap = max(self.longest_gap, time.monotonic() - last)
            last = time.monotonic()
            for part, publisher in self._parts:
                part.read(self._newest.get(part.name))
                message = part.write()
                if message is not None:
                    publisher.publish(message)
                    part.sent += 1
