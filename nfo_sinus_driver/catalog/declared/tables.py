# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The status codes of a described drive: its faults by their own numbers, and what it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import enum

from nfo_sinus_driver.catalog.declared.description import STATES, Description, Fault
from nfo_sinus_driver.catalog.status import Kind, Meaning, StatusCode


class Code(enum.IntEnum):
    """The status codes of a drive without a fault."""

    READY = STATES.start
    RUNNING = enum.auto()
    STOPPING = enum.auto()
    INHIBITED = enum.auto()
    LOCAL = enum.auto()
    LOCAL_RUNNING = enum.auto()
    ALARM = enum.auto()
    ALARM_RUNNING = enum.auto()
    #: A fault whose number the file does not have.
    FAULT = enum.auto()
    #: A status that the file does not have.
    UNKNOWN = enum.auto()


_STANDS, _RUNS = frozenset({Meaning.BUS_STANDBY}), frozenset({Meaning.BUS_RUNNING})
#: The text of each, what it means, and what that is to the driver; an alarm has those of the file.
_TEXTS: Mapping[Code, tuple[str, str, frozenset[Meaning]]] = {
    Code.READY: ('Ready', 'The motor stands and can be started', _STANDS),
    Code.RUNNING: ('Running', 'The motor is driven', _RUNS),
    Code.STOPPING: ('Stopping', 'The motor is on its way to a stop', _RUNS | {Meaning.SLOWING}),
    Code.INHIBITED: ('Not ready', 'The motor stands and cannot be started', _STANDS),
    Code.LOCAL: ('Local', 'Keypad or terminals have control', frozenset({Meaning.KEYPAD})),
    Code.LOCAL_RUNNING: (
        'Local, running', 'Keypad or terminals run the motor',
        frozenset({Meaning.KEYPAD, Meaning.LOCAL_RUNNING}),
    ),
    Code.ALARM: ('', '', _STANDS),
    Code.ALARM_RUNNING: ('', '', _RUNS),
    Code.UNKNOWN: ('Unknown', 'A status that the file of the drive does not list', frozenset()),
}
_DRIVEN = (Code.RUNNING, Code.STOPPING, Code.LOCAL_RUNNING, Code.ALARM_RUNNING)


def status_codes(drive: Description) -> Mapping[int, StatusCode]:
    """Return the status codes of a drive, by number."""
    unlisted = Fault(
        int(Code.FAULT), 'Fault', 'A fault that the file of the drive does not list',
        'Look at its keypad which one it is, and remove its cause',
    )
    named = drive.codes is not None and not drive.codes.in_status
    faults = [*drive.faults.values(), *(fault for _, fault in drive.flags), unlisted]
    codes = [_of_state(drive, code) for code in _TEXTS]
    codes += [_of_fault(drive, fault) for fault in faults]
    if named:
        # its number stands elsewhere
        codes[-1] = replace(codes[-1], meanings=codes[-1].meanings | {Meaning.UNNAMED})
    return {code.code: code for code in codes}


def _of_state(drive: Description, code: Code) -> StatusCode:
    text, description, meanings = _TEXTS[code]
    if drive.holder is not None:
        meanings = frozenset({Meaning.ANONYMOUS, *({Meaning.RUNNING} if code in _DRIVEN else ())})
    if text:
        return StatusCode(int(code), text, meanings=meanings, description=description)
    alarm = drive.alarm
    return StatusCode(
        int(code), alarm.text, kind=Kind.ALARM, meanings=meanings,
        description=alarm.description, remedy=alarm.remedy,
    )


def _of_fault(drive: Description, fault: Fault) -> StatusCode:
    meanings = {Meaning.ANONYMOUS} if drive.holder is not None else set()
    if not (drive.tells_control or meanings):
        meanings.add(Meaning.BUS_STANDBY)
    if fault.line:
        meanings.add(Meaning.SERIAL_FAILURE)
    return StatusCode(
        fault.code, fault.text, kind=Kind.FAULT, requires_ack=True, meanings=frozenset(meanings),
        description=fault.description or fault.text, remedy=fault.remedy,
    )
