# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the status of a drive means that a file describes: by the conditions of the file."""

from __future__ import annotations

from dataclasses import dataclass
import functools

from nfo_sinus_driver.catalog.declared import Code, Condition, Description
from nfo_sinus_driver.catalog.status import Fact, Kind, Role, State, StatusWord

#: What each condition of the file reports.
_FACTS = {
    'ready': Fact.READY,
    'running': Fact.OPERATION_ENABLED,
    'fault': Fact.FAULT,
    'alarm': Fact.ALARM,
    'reverse': Fact.REVERSE,
    'at_setpoint': Fact.SETPOINT_REACHED,
    'remote': Fact.NETWORK_CONTROL,
    'inhibited': Fact.SWITCH_ON_DISABLED,
    'enable_missing': Fact.RUN_INPUT_MISSING,
    'stopping': Fact.STOPPING,
    'quick_stop': Fact.QUICK_STOP_ACTIVE,
    'sleeping': Fact.SLEEPING,
}


#: Those that say what the drive does.
_STATES = ('fault', 'quick_stop', 'stopping', 'running', 'sleeping', 'inhibited', 'ready')
#: Those of a motor that stands.
_STANDS = ('inhibited', 'ready')


@dataclass(frozen=True)
class Words(StatusWord):
    """What the status of one drive means; ``facts_of`` has a condition for each fact."""

    facts_of: tuple[tuple[Condition, Fact], ...] = ()
    unless: Condition | None = None

    @functools.cached_property
    def valid(self) -> Fact:
        """The facts that the file has a condition for."""
        valid = Fact.NETWORK_CONTROL if self.unless else Fact(0)
        for _, fact in self.facts_of:
            valid |= fact
        return valid

    @property
    def tells_alarms(self) -> bool:
        """It has a condition for alarms."""
        return Fact.ALARM in self.valid

    def kind(self, word: int, listed: Kind) -> Kind:
        """Return how grave the status is: the conditions alone tell."""
        facts = self._bits(word)
        if Fact.FAULT in facts:
            return Kind.FAULT
        return Kind.ALARM if Fact.ALARM in facts else Kind.STATUS

    def _bits(self, word: int) -> Fact:
        found = 0
        for condition, fact in self.facts_of:
            if condition.holds(word):
                found |= fact
        if self.unless is not None and not self.unless.holds(word):
            found |= Fact.NETWORK_CONTROL
        return Fact(found)


def words_of(drive: Description) -> Words:
    """Return what the status of a drive means."""
    facts = tuple((drive.facts[name], fact) for name, fact in _FACTS.items() if name in drive.facts)
    return Words(
        state=functools.partial(_state, drive),
        by_bit={},
        by_state={},
        code=functools.partial(_code, drive),
        by_frequency=Role.ACTUAL_FREQUENCY in drive.roles and 'stopping' not in drive.facts,
        runs_by_turning=drive.run_by == 'setpoint' or _runs_by_turning(drive),
        sizes=_sizes(drive),
        facts_of=facts,
        unless=drive.facts.get('local'),
    )


def _runs_by_turning(drive: Description) -> bool:
    """Return whether the motor runs by the register of its frequency or speed."""
    status, bits = drive.status, drive.facts['running'].mask
    for role in (Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED):
        measured = drive.parameters.get(drive.roles.get(role, ''))
        place = measured.at('modbus') if measured is not None else None
        if place is not None and status.holds(place) and bits >> status.shift(place.index) & 0xFFFF:
            return True
    return False


def _sizes(drive: Description) -> frozenset[Role]:
    """Return which of frequency and speed have no sign; the speed may follow from the other."""
    found: set[Role] = set()
    if not ('reverse' in drive.facts or drive.setpoint.reverses):
        return frozenset()
    for role in (Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED):
        measured = drive.parameters.get(drive.roles.get(role, ''))
        if found if measured is None else not measured.at('modbus').number.signed:
            found.add(role)
    return frozenset(found)


def _state(drive: Description, word: int) -> State:
    def says(name: str) -> bool:
        return name in drive.facts and drive.facts[name].holds(word)

    if says('fault'):
        return State.FAULT_REACTION_ACTIVE if says('running') else State.FAULTED
    if says('quick_stop'):
        return State.QUICK_STOP
    if says('stopping'):
        return State.STOPPING
    if says('running') or says('sleeping'):
        # what sleeps keeps the run command and starts again by itself
        return State.OPERATION_ENABLED
    if says('inhibited'):
        return State.SWITCH_ON_DISABLED
    return State.READY_TO_SWITCH_ON if says('ready') or _is_known(drive, word) else State.UNKNOWN


def _is_known(drive: Description, word: int) -> bool:
    """
    Return whether a status of which no condition says what the drive does is that of one at rest.

    Bits that are clear say that it does nothing. A number that no condition names says nothing; 0
    is the exception where no number is named for a motor that stands.
    """
    numbers = {
        name: drive.facts[name]
        for name in _STATES
        if name in drive.facts and drive.facts[name].names_numbers
    }
    standing = [numbers[name] for name in _STANDS if name in numbers]
    return not any(
        word & condition.mask or any(condition.mask & other.mask for other in standing)
        for condition in numbers.values()
    )


def _code(drive: Description, word: int) -> int:
    """Return the status code that a status reports: the fault's own number, or what it does."""
    state = _state(drive, word)
    if state in (State.FAULTED, State.FAULT_REACTION_ACTIVE):
        return _fault(drive, word)
    if state is State.UNKNOWN:
        return Code.UNKNOWN
    driven = state not in (State.READY_TO_SWITCH_ON, State.SWITCH_ON_DISABLED)
    if drive.tells_control and not is_remote(drive, word):
        return Code.LOCAL_RUNNING if driven else Code.LOCAL
    if 'alarm' in drive.facts and drive.facts['alarm'].holds(word):
        return Code.ALARM_RUNNING if driven else Code.ALARM
    if driven:
        return Code.RUNNING if state is State.OPERATION_ENABLED else Code.STOPPING
    return Code.INHIBITED if state is State.SWITCH_ON_DISABLED else Code.READY


def _fault(drive: Description, word: int) -> int:
    for condition, fault in drive.flags:
        if condition.holds(word):
            return fault.code
    codes = drive.codes
    return (codes.code(word) if codes is not None and codes.in_status else 0) or Code.FAULT


def is_remote(drive: Description, word: int) -> bool:
    """Return whether the line has control, as far as the status reports."""
    remote, local = drive.facts.get('remote'), drive.facts.get('local')
    return (remote is None or remote.holds(word)) and (local is None or not local.holds(word))
