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

"""
A drive that tells, with the answer to a set-point, what may have to stop the motor is looked at
beside a poll that waits for its turn.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import itertools
from pathlib import Path
import time

from drive_rig import PATIENCE
from neighbour import neighbour
import pytest
from support.addresses import Words
from support.wire import understand
from telegram_rig import TelegramRig
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.bus import Transfer
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.link import Interrupted
from nfo_sinus_driver.simulator.sinus.control_unit import NOTHING

SETPOINT, INV_ST, SCMD = 0x3FC, 0x2A5, 0x298
OVERLOAD, EARTH_FAULT = 5, 1
NEIGHBOURS = 15


def waits_for(rig: VirtualRig | TelegramRig, key: str) -> bool:
    """The poll waits for its turn to read this."""
    task = rig.drive._watch._task
    assert task is not None
    awaited = task.awaited
    return isinstance(awaited, Transfer) and awaited.reads(1, rig.drive.registers.address(key))


def full_line(make_virtual: MakeVirtual) -> VirtualRig:
    """A motor that turns on a line that is full, polled as fast as it allows."""
    rig = make_virtual(
        variant={'refuses_in_fault': NOTHING}, poll_rate=0.0, telemetry_rate=0.0
    )
    rig.ride(20.0)
    rig.send(None)
    for _ in range(NEIGHBOURS):
        rig.bus.run(neighbour(rig.bus, rig.drive.registers.address('status.u_rms')))
    for _ in range(100):
        rig.bus.step()
    return rig


def poll_waits(make_virtual: MakeVirtual) -> VirtualRig:
    """The same, while the poll waits to read the frequency."""
    rig = full_line(make_virtual)
    while not waits_for(rig, 'status.frq_act'):
        rig.bus.step()
    return rig


def trip(rig: VirtualRig) -> None:
    """Let the drive have a fault."""
    rig.far.trip(OVERLOAD)


def lose_run_input(rig: VirtualRig) -> None:
    """Take the RUN input away."""
    rig.far.control_unit.run_input = False


def press_stop(rig: VirtualRig) -> None:
    """Stop it at the keypad."""
    rig.far.control_unit.press('stop')


@pytest.mark.parametrize('event', [trip, lose_run_input, press_stop])
@pytest.mark.parametrize('turns', range(0, 40, 7))
def test_a_stop_comes_whatever_the_poll_waits_for(
    make_virtual: MakeVirtual, event: Callable[[VirtualRig], None], turns: int
) -> None:
    rig = full_line(make_virtual)
    for _ in range(turns):
        rig.bus.step()
    assert rig.drive.armed
    event(rig)
    rig.far.advance(0.01)
    begun = len(rig.link.frames)
    rig.drive.set_setpoint(30.0)
    for _ in range(10):
        rig.bus.step()
    sent = [understand(bytes.fromhex(one['hex']), 'modbus_rtu') for one in rig.link.frames[begun:]]
    asked = [(one.place, one.words) for one in sent if one is not None]
    told = asked.index((SETPOINT, (300,)))
    assert asked[told + 1 : told + 3] == [(INV_ST, None), (SCMD, (0,))]
    assert not rig.drive.armed


def test_an_interruption_that_it_meets_is_the_loss_of_the_drive(make_virtual: MakeVirtual) -> None:
    rig = poll_waits(make_virtual)
    met: list[int] = []

    def interrupt(register: int, words: Words | None) -> None:
        if register == rig.register('fieldbus.inv_st') and not met:
            met.append(register)
            raise Interrupted('the PLC was not reached for 1 s')

    rig.far.trip(OVERLOAD)
    rig.far.advance(0.01)
    rig.drive.set_setpoint(30.0)
    rig.before = interrupt
    # told once only, and to whoever asks first
    while not met:
        rig.bus.step()
    assert not rig.drive.armed
    rig.pass_time(0.5)
    assert rig.said(Cause.LOST_IN_USE)
    rig.pass_time(5.0)
    assert rig.drive.snapshot.connected


def test_a_poll_that_pauses_because_the_drive_was_busy_is_not_waited_for(
    make_virtual: MakeVirtual,
) -> None:
    rig = poll_waits(make_virtual)
    rig.be_busy(rig.register('status.frq_act'))
    task = rig.drive._watch._task
    assert task is not None
    while not task.asleep:
        rig.bus.step()
    rig.far.trip(OVERLOAD)
    rig.far.advance(0.01)
    begun = len(rig.link.frames)
    rig.drive.set_setpoint(30.0)
    while rig.drive.armed:
        rig.bus.step()
    assert len(rig.link.frames) - begun <= 4


class Stepped(TelegramRig):
    """One whose bus has no thread: a test steps it."""

    def start(self) -> None:
        self._plc_time.start()
        self.simulator.start()

    def until(self, condition: Callable[[], bool]) -> None:
        """Step until it is so."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline
            self.bus.step()


@pytest.fixture
def behind_a_plc(tmp_path: Path) -> Iterator[Stepped]:
    rig = Stepped(tmp_path / 'trace', 'sinus_h', poll_rate=0.0, telemetry_rate=0.0)
    rig.start()
    try:
        yield rig
    finally:
        rig.stop()


def test_a_poll_that_it_has_overtaken_says_nothing_about_an_older_status(
    behind_a_plc: Stepped,
) -> None:
    rig = behind_a_plc
    rig.until(rig.drive.connect().done)
    rig.drive.activate()
    rig.until(lambda: not rig.drive.stop_unconfirmed)
    rig.until(rig.drive.enable().done)
    rig.drive.set_setpoint(20.0)
    rig.until(lambda: abs(rig.far.motor.frequency - 20.0) < 0.5)
    for _ in range(4 * NEIGHBOURS):
        rig.bus.run(neighbour(rig.bus, rig.drive.registers.address('telegram.actual')))
    rig.until(lambda: waits_for(rig, 'telegram.actual'))
    rig.notes.events.clear()
    rig.far.trip(EARTH_FAULT)
    for setpoint in itertools.cycle((25.0, 26.0)):
        # the PLC takes its time to show the fault, and the neighbours' turns are not to be used up
        time.sleep(0.02)
        rig.drive.set_setpoint(setpoint)
        rig.bus.step()
        if not rig.drive.armed:
            break
    assert waits_for(rig, 'telegram.actual'), 'an older status is on its way: so this is a test'
    for _ in range(4):
        before = rig.drive.snapshot
        rig.until(lambda before=before: rig.drive.snapshot is not before)
    assert len(rig.notes.events) == 1, rig.notes.events
