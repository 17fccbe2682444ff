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


"""What a drive does on an SCMD while its motor stands: tune, erase, reset [M0 table 18]."""

from __future__ import annotations

from collections.abc import AsyncIterator
from collections.abc import Iterator
import contextlib
import time

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Holder
from nfo_sinus_driver.catalog import Procedure
from nfo_sinus_driver.drive import withdrawal
from nfo_sinus_driver.drive.advice import require_no_fault
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.inverter import Inverter
from nfo_sinus_driver.drive.loan import Loan
from nfo_sinus_driver.drive.motion import Motion
from nfo_sinus_driver.drive.settings import MONITOR_REFUSAL
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import Refused

#: How often a busy drive is told again, and for how long, s.
_BUSY_PERIOD = 0.05
_LONGEST_BUSY = 0.5


def require_known(procedure: Procedure, model: Family) -> None:
    """
    See to it that a model has a procedure.

    :raises DriveError: it has no command for it.
    """
    if not model.profile.methods_with(procedure):
        raise DriveError(
            f'{procedure.value} is not known of this model ({model.name}): its manual lists no '
            'command for it; do it at the keypad'
        )


class Errands:
    """
    Sends one drive on errands; used on the bus alone.

    :param motion: who commands the drive else; ``None`` if this driver only reads.
    """

    def __init__(self, bus: Bus, inverter: Inverter, motion: Motion | None) -> None:
        self._bus = bus
        self._inverter = inverter
        self._motion = motion

    def require(self, procedure: Procedure) -> Motion:
        """
        Return who lends the drive for an errand.

        :raises DriveError: the drive has no such errand, or its control method is another.
        """
        if self._motion is None:
            raise DriveError(MONITOR_REFUSAL)
        inverter = self._inverter
        if not inverter.connected:
            raise DriveError(f'the drive at address {inverter.settings.address} is not connected')
        require_known(procedure, inverter.model)
        profile, what = inverter.model.profile, procedure.value
        have = profile.methods_with(procedure)
        if inverter.settings.control_method not in have:
            raise DriveError(
                f'{what} needs {profile.methods[have[0]].means}, and one session does not mix '
                f'control methods: clean up, set control_method to {have[0]} and configure again'
            )
        self._require_idle(what, self._motion)
        return self._motion

    @contextlib.contextmanager
    def lent(self, procedure: Procedure) -> Iterator[Loan]:
        """
        Have the drive for an errand, from its first preparations on: whoever stops it ends both.

        :raises DriveError: it cannot be had, and why.
        """
        self.require(procedure)
        with self.had(procedure.value) as loan:
            yield loan

    @contextlib.contextmanager
    def had(self, what: str) -> Iterator[Loan]:
        """
        Do as :meth:`lent` for what every control method may do, also while connecting.

        :raises DriveError: somebody has the drive.
        """
        motion = self._motion
        if motion is None:
            raise DriveError(MONITOR_REFUSAL)
        self._require_idle(what, motion)
        motion.loan = loan = Loan(what)
        try:
            yield loan
        finally:
            motion.loan = None

    async def in_control(self, priority: Priority) -> bool:
        """
        Tell whether the bus has control of the drive.

        :raises DriveError: this driver only reads.
        """
        if self._motion is None:
            raise DriveError(MONITOR_REFUSAL)
        return await self._motion.method.in_control(priority)

    @contextlib.asynccontextmanager
    async def sent(self, loan: Loan) -> AsyncIterator[None]:
        """
        Take control of a drive whose motor stands, and give it back as it was found.

        A drive that its keypad or terminals control is not taken: giving it back to them could
        start the motor [C43].

        :raises DriveError: it cannot be had, and why.
        """
        motion = self._motion
        assert motion is not None and motion.loan is loan
        found = await self._take(loan, motion)
        try:
            yield
        except Exception:
            # who asked is told what went wrong first; what comes of it is logged
            with contextlib.suppress(DriveError, LinkError):
                await self._give_back(motion, found)
            raise
        await self._give_back(motion, found)

    async def recall(self) -> str:
        """
        End what the drive does on an errand; anything else goes on.

        :raises DriveError: the drive does not confirm it; it is tried on and on.
        """
        if self._motion is None or self._motion.loan is None:
            return ''
        return await self._motion.stop()

    async def tell(self, loan: Loan, procedure: Procedure) -> None:
        """
        Have the drive begin; once, for nobody knows what has happened before a second time.

        It waits for its turn with the stops, so that one which comes later does not overtake it,
        and keeps it off the line if it was asked for before its turn. Only a drive that is busy is
        told again for a while, for it has done nothing.

        :raises DriveError: it was stopped meanwhile.
        """
        motion = self._motion
        assert motion is not None
        deadline = time.monotonic() + _LONGEST_BUSY
        while True:
            try:
                await motion.method.begin(procedure, loan.require_wanted)
                return
            except Refused as error:
                if error.code != Refused.BUSY or time.monotonic() >= deadline:
                    raise
            await self._bus.sleep(_BUSY_PERIOD)

    @staticmethod
    def _require_idle(what: str, motion: Motion) -> None:
        if motion.loan is not None:
            raise DriveError(f'{what}: {motion.loan.what} is going on already')
        if motion.ours:
            raise DriveError(f'{what}: the motor is enabled: stop it first')
        # a fault that holds the stop is told of later, with what to do
        if motion.stopping and not motion.taking_back.held_by_fault:
            raise DriveError(f'{what}: a stop is not confirmed yet')

    async def _take(self, loan: Loan, motion: Motion) -> Holder:
        inverter, what = self._inverter, loan.what
        seen = await inverter.look(Priority.SERVICE)
        require_no_fault(inverter, seen)
        found = await motion.method.holder(Priority.SERVICE)
        if found is Holder.INHIBITED:
            raise DriveError(
                f'{what}: the drive lets nobody take control now ({inverter.describe()}; MODE is '
                'Inhibit)'
            )
        if seen.driven:
            raise DriveError(f'{what}: the motor runs ({inverter.describe()}): stop it first')
        if found not in (Holder.NOBODY, Holder.BUS):
            raise DriveError(
                f'{what}: keypad or terminals have control ({inverter.describe()}), and giving it '
                'back to them could start the motor: press STOP at the drive first'
            )
        loan.require_wanted()
        control_mode = inverter.control_mode or await inverter.read_control_mode()
        await motion.take_control(control_mode)
        deadline = time.monotonic() + withdrawal.PATIENCE
        while not (await inverter.look(Priority.SERVICE)).standby:
            if time.monotonic() > deadline:
                with contextlib.suppress(DriveError, LinkError):
                    await self._give_back(motion, found)
                raise DriveError(f'{what}: the drive does not stand by: {inverter.describe()}')
            # no manual says that a drive has forgotten what it was told before
            await motion.method.stop(control_mode)
            await self._bus.sleep(withdrawal.LOOK_PERIOD)
        return found

    async def _give_back(self, motion: Motion, found: Holder) -> None:
        """Take the command back, and control too where nobody had it; not while a fault stands."""
        await motion.take_back()
        if found is Holder.NOBODY and not motion.taking_back.held_by_fault:
            await motion.method.release()
