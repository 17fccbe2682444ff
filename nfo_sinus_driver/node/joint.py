# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The output shaft of one drive, in rad and rad/s [REP-103]."""

from __future__ import annotations

from collections.abc import Callable
import math

from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import Snapshot

_RPM = 2 * math.pi / 60
#: A pause between two polls that is longer says nothing about where the shaft went meanwhile, s.
_LONGEST_STEP = 1.0


class Joint:
    """
    The joint that a motor turns.

    :param name: its name.
    :param ratio: motor turns per turn of the output shaft; negative inverts the direction.
    """

    def __init__(self, name: Callable[[], str], ratio: Callable[[], float]) -> None:
        self._name = name
        self._ratio = ratio
        self._position = 0.0
        self._at = -math.inf

    @property
    def name(self) -> str:
        """Its name in messages."""
        return self._name()

    def state(self, snapshot: Snapshot, stamp: Time, frame_id: str) -> JointState:
        """
        Return the joint's state of a poll.

        Nobody measures the position: it is what the measured speed comes to since the node began.
        """
        velocity = snapshot.speed * _RPM / self._ratio()
        step = snapshot.at - self._at
        if 0 < step < _LONGEST_STEP and not math.isnan(velocity):
            self._position += velocity * step
        self._at = snapshot.at
        return JointState(
            header=Header(stamp=stamp, frame_id=frame_id),
            name=[self.name],
            position=[self._position],
            velocity=[velocity],
        )

    def setpoint(self, velocity: float, drive: Drive) -> float:
        """
        Return the set-point in the unit of the control mode for a velocity of the shaft, rad/s.

        :raises ValueError: the drive controls something else, or its motor is not known.
        """
        rpm = velocity * self._ratio() / _RPM
        mode = drive.snapshot.control_mode
        if mode == 'Speed':
            return rpm
        if mode != 'Freque':
            raise ValueError(f'the control mode is {mode or "not known"}, not Speed or Freque')
        nominal, key = drive.parameters.values, drive.model.key
        frequency = nominal.get(key(Role.NOMINAL_FREQUENCY), 0)
        speed = nominal.get(key(Role.NOMINAL_SPEED), 0)
        if not frequency or not speed:
            raise ValueError('f-Nom and N-nom of the motor are not known, so Hz are no speed')
        # slip is left out: how much there is depends on the load
        pole_pairs = max(1, round(60 * float(frequency) / float(speed)))
        return rpm * pole_pairs / 60
