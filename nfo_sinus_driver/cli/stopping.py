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

"""Stop a motor, see that it is confirmed, and give control back once it stands."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import math
import time

from nfo_sinus_driver.cli.control_session import ControlSession
from nfo_sinus_driver.cli.wording import say
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import Report

#: How long an answer of the drive layer may take, s; it gives up earlier by itself.
_LONGEST_ANSWER = 10.0
#: How long a stop that is not confirmed is tried on, s.
_LAST_TRIES = 10.0
#: The same as the parameter ``shutdown_timeout`` of the driver has, s.
SHUTDOWN_TIMEOUT = 4.0
_LOOK_PERIOD = 0.05
#: How long a poll may take, s.
_LONGEST_POLL = 2.0

#: How control was released.
RELEASED = (Cause.CONTROL_RELEASED, Cause.CONTROL_KEPT)

_EMERGENCY = 'use the RUN input or the emergency stop if the motor turns'


class Stopping:
    """
    Stops one motor, whatever signals come.

    :param show: called again and again meanwhile.
    """

    def __init__(self, control: ControlSession, drive: Drive, show: Callable[[], object]) -> None:
        self._session = control
        self._drive = drive
        self._show = show
        #: What the drive answered, or what became of its stop.
        self.answer: Report | None = None

    def stop(self, *, quick: bool = False) -> bool:
        """Stop it; true when the drive has confirmed it. It says loudly when it has not."""
        show, drive = self._session.screen.say, self._drive
        try:
            self.answer = self._finish(drive.quick_stop() if quick else drive.stop())
        except DriveError as error:
            self.answer = error.report
            show(f'{say(error)}: {_EMERGENCY}')
            return self.confirmed_late()
        return True

    def give_back(self, patience: float = math.inf) -> bool:
        """
        Wait until the motor stands, and give control back; false when that failed.

        :param patience: how long it may take, s; a signal ends the wait too.
        """
        begun = time.monotonic()
        while self._may_turn(begun) and time.monotonic() < begun + patience:
            self._show()
            if self._session.signal(_LOOK_PERIOD):
                break
        try:
            # what is still on its ramp has had its time
            patience = 0.0 if self._may_turn(begun) else 1.0
            released = self._finish(self._drive.disconnect(patience))
        except DriveError as error:
            self._session.screen.say(f'control was not released: {say(error)}')
            return False
        if released.cause in (*RELEASED, Cause.LEFT_TO_RAMP):
            self.answer = released
        return True

    def _may_turn(self, since: float) -> bool:
        """Tell whether the drive drives the motor, for all that is known since then."""
        seen = self._drive.snapshot
        if seen.at < since:
            # no poll yet; if none comes, there is nothing to wait for
            return time.monotonic() < since + _LONGEST_POLL
        return seen.status is not None and seen.status.driven

    def confirmed_late(self) -> bool:
        """Let a stop be tried on for a while; true when the drive has confirmed it."""
        show, drive = self._session.screen.say, self._drive
        deadline = time.monotonic() + _LAST_TRIES
        while drive.stop_unconfirmed and time.monotonic() < deadline:
            self._show()
            if self._session.signal(_LOOK_PERIOD):
                break
        if drive.stop_unconfirmed:
            show(
                'ending WITHOUT a confirmed stop, the motor may still run: use the RUN input or '
                'the emergency stop; nfo-sinus stop tries again'
            )
            return False
        seen = drive.snapshot
        status = f'{seen.status.code} {seen.text}' if seen.status is not None else ''
        self.answer = Report(Cause.STOP_CONFIRMED_LATE, status=status)
        show(say(self.answer))
        return True

    def _finish(self, future: Future[Report]) -> Report:
        return self._session.finish(future, _LONGEST_ANSWER, self._show)
