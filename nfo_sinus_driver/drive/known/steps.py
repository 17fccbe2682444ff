# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Carries out the sequences of a family's profile on the bus.

A control method says what to write; :mod:`..motion.controller` decides when.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
import math
from typing import Any, TypeVar

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import (
    Access,
    InverterStatus,
    NotPossible,
    NotTried,
    Refusal,
    profile,
)
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Severity
from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, Refused

_T = TypeVar('_T')

_Condition = Callable[[InverterStatus], bool]
#: Waits until the drive's status fulfils a condition; raises DriveError if it does not.
Reached = Callable[[_Condition], Awaitable[None]]


class NotRead(DamagedAnswer):
    """A stop cannot be written without what was not read this time: the next try has to."""


async def run_steps(
    state: DriveState,
    steps: profile.Steps[_T],
    priority: Priority,
    reached: Reached | None = None,
    *,
    onward: bool = False,
    permit: Callable[[], None] | None = None,
    is_blind: bool = False,
    reads: bool = True,
) -> _T:
    """
    Carry out a sequence of a profile on the bus.

    :param reached: how it waits for the drive's status between two steps; by default for
        :data:`~.drive_state.TIMEOUT`.
    :param onward: go on after a step without an answer, as if it had been refused, unless it is
        a write that reading shows to have been carried out.
    :param permit: as for :meth:`ParameterAccess.write`.
    :param is_blind: nothing answers, but the drive may hear. A read is tried once, and where it has
        no answer the sequence goes on as if it had been refused.
    :param reads: false: it is not even tried (:class:`NotRead`).
    :raises DriveError: it cannot be carried out.
    :raises LinkError: the drive does not answer, so that the outcome is unknown; or it refuses,
        and the sequence ends by that.
    """
    params = state.params
    reached = reached or state.wait_until
    brought: Any = None
    refusal: Refusal | None = None
    written_at = -math.inf

    def after_write(condition: _Condition) -> _Condition:
        # behind a PLC a status from before is shown for a while [C117]
        return lambda status: status.at > written_at and condition(status)

    while True:
        try:
            step = steps.send(brought) if refusal is None else steps.throw(refusal)
        except StopIteration as end:
            result: _T = end.value
            return result
        except Refusal as refused:
            assert isinstance(refused.__cause__, LinkError)
            raise refused.__cause__ from None
        except NotPossible as error:
            raise DriveError(Cause.NOT_POSSIBLE, why=str(error)) from error
        brought = refusal = None
        try:
            match step:
                case profile.Read(key, retry):
                    params.require_fitted(key)
                    if not reads:
                        raise NotRead(key)
                    # what is read behind a stop keeps back no stop of another drive
                    behind = priority is Priority.STOP and written_at > -math.inf
                    urgency = Priority.LOOK if behind else priority
                    brought = await params.read(key, urgency, retry=retry and not is_blind)
                case profile.Write(stored=True):
                    await _store(state, step, priority)
                case profile.Write():
                    await params.write(step, priority, permit=permit)
                case profile.Acknowledge(key):
                    brought = await params.acknowledge(key, priority)
                case profile.AcknowledgeThenWrite(key, write):
                    await params.acknowledge_and_write(key, write)
                case profile.Wait(seconds):
                    await params.sleep(seconds)
                case profile.Hold(condition, seconds):
                    brought = await _holds(state, after_write(condition), priority, seconds)
                case profile.Until(condition):
                    await reached(after_write(condition))
        except (Refused, NoAnswer, DamagedAnswer) as error:
            goes_on = onward or (is_blind and isinstance(step, profile.Read))
            if not (goes_on or isinstance(error, Refused)):
                raise
            if not await _was_written(step, state, priority, error):
                named = error.naming() if isinstance(error, Refused) else error
                kind = NotTried if isinstance(error, NotRead) else Refusal
                refusal = kind(str(named))
                refusal.__cause__ = named
        if isinstance(step, profile.Write):
            written_at = params.now()


async def _was_written(
    step: profile.Step, state: DriveState, priority: Priority, error: LinkError
) -> bool:
    """Return whether the drive has taken a write that it did not answer, where that can be read."""
    if isinstance(error, Refused) or not isinstance(step, profile.Write):
        return False
    if state.model[step.key].access is not Access.READ_WRITE:
        return False
    address, data = state.params.target(step)
    try:
        return await state.params.read_from(address, priority, retry=False) == data
    except LinkError:
        return False


async def _store(state: DriveState, step: profile.Write, priority: Priority) -> None:
    """Write to a memory that wears out, only what differs, and report it."""
    params = state.params
    address, data = params.target(step)
    before = await params.read_from(address, priority)
    if before == data:
        return
    await params.write(step, priority)
    old, new = params.value(step.key, before), params.value(step.key, data)
    name = params.model[step.key].name
    state.notify(Severity.INFO, Cause.STORED, key=step.key, name=name, old=old, new=new)


async def _holds(
    state: DriveState, condition: _Condition, priority: Priority, seconds: float
) -> bool:
    try:
        await state.wait_until(condition, priority, seconds)
    except DriveError:
        return False
    return True
