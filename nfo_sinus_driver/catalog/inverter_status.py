# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the status word and the inverter status of a drive say at one moment."""

from __future__ import annotations

from dataclasses import dataclass, replace
import functools
import math

from nfo_sinus_driver.catalog.family import Family
from nfo_sinus_driver.catalog.status import Fact, Kind, Meaning, State, StatusCode

#: By so much a frequency has to fall, Hz: a motor that keeps its speed shows no more.
WOBBLE = 0.1
#: A frequency that was seen to fall, and has not risen since, counts as falling so long, s: the
#: slowest ramp, of 2000 s, falls by so much in 4 s.
FALLS_WITHIN = 5.0
#: Of what has not happened: when it began, and when it was over.
NEVER = (-math.inf, -math.inf)
#: Stands for an inverter status that has not been read; no drive has it.
NO_CODE = -1

#: States in which the output stage drives the motor [M0 table 16].
_DRIVEN = frozenset(
    (State.OPERATION_ENABLED, State.STOPPING, State.QUICK_STOP, State.FAULT_REACTION_ACTIVE)
)
#: What a drive is in when its ramp to a stop is over.
_AFTER_RAMP = frozenset((State.READY_TO_SWITCH_ON, State.SWITCHED_ON))


@dataclass(frozen=True)
class InverterStatus:
    """
    What the drive's status word and its inverter status say at one moment.

    :ivar at: when the answer arrived, s of ``time.monotonic``; that of the word, if there is one.
    :ivar word: the status word; ``None`` if the drive has none [C21].
    :ivar code: the inverter status code, read without acknowledging.
    :ivar code_at: when that arrived, likewise.
    :ivar model: whose words these are.
    :ivar by_mode: where neither word nor code says who controls: the control source, such as MODE,
        says that the bus does.
    :ivar by_mode_at: when it said so, likewise.
    :ivar frequency: Hz, where it is read with the status word; NaN elsewhere, and where the drive
        refuses to report it.
    :ivar crest: from which size of it on it may be falling, and when that was last seen.
    :ivar fell: when the last fall by more than a wobble began, and when it was seen; minus infinity
        if there was none, or if it has risen since.
    """

    at: float
    word: int | None
    code: int
    model: Family
    by_mode: bool = False
    by_mode_at: float = -math.inf
    code_at: float = -math.inf
    frequency: float = math.nan
    crest: tuple[float, float] = NEVER
    fell: tuple[float, float] = NEVER

    def with_frequency(self, frequency: float, before: InverterStatus | None) -> InverterStatus:
        """Return the same with the frequency read with it, after the status before."""
        size = abs(frequency)
        crest, fell = (before.crest, before.fell) if before is not None else (NEVER, NEVER)
        if not size <= crest[0]:
            crest, fell = (size, self.at), NEVER
        elif size == crest[0]:
            crest = size, self.at
        elif size < crest[0] - WOBBLE:
            crest, fell = (size, self.at), (crest[1], self.at)
        return replace(self, frequency=frequency, crest=crest, fell=fell)

    def tells_otherwise(self, other: InverterStatus) -> bool:
        """Return whether another one says something else of the drive than this."""
        mine = self.word, self.code, self.by_mode, self.facts
        return mine != (other.word, other.code, other.by_mode, other.facts)

    @functools.cached_property
    def listed(self) -> StatusCode:
        """What the model's table says of the code."""
        return self.model.status_code(self.code)

    def means(self, *meanings: Meaning) -> bool:
        """Return whether the code means one of these."""
        return not self.listed.meanings.isdisjoint(meanings)

    @property
    def shown_word(self) -> int:
        """What is published of the status word; 0 if the drive has none."""
        return (self.word or 0) & self.model.profile.status_word.shown

    @functools.cached_property
    def facts(self) -> Fact:
        """What the drive reports of itself; only those in :attr:`valid` count."""
        if self.word is not None:
            facts = self.model.profile.status_word.facts(self.word, self.listed.kind)
            return facts | Fact.REVERSE if self._has_sign and self.frequency < 0 else facts
        facts = Fact.OPERATION_ENABLED if self._driven_by_code else Fact(0)
        if self._from_bus_by_code:
            facts |= Fact.NETWORK_CONTROL
        if self.kind is Kind.ALARM:
            facts |= Fact.ALARM
        return facts | Fact.FAULT if self.kind is Kind.FAULT else facts

    @property
    def valid(self) -> Fact:
        """What the drive can say of itself at all."""
        if self.word is not None:
            valid = self.model.profile.status_word.valid
            return valid | Fact.REVERSE if self._has_sign else valid
        # the code of a fault, or of a tuning, stands in for the one that shows who has control
        hidden = self.kind is Kind.FAULT or self.means(Meaning.TUNING, Meaning.TUNED)
        control = Fact(0) if hidden else Fact.NETWORK_CONTROL
        return control | Fact.OPERATION_ENABLED | Fact.FAULT | Fact.ALARM

    @property
    def _has_sign(self) -> bool:
        """The sign of the frequency reports the direction, and no bit of the word does."""
        word = self.model.profile.status_word
        signed = not math.isnan(self.frequency) and not word.sizes
        return signed and Fact.REVERSE not in word.valid

    @functools.cached_property
    def kind(self) -> Kind:
        """How grave the code is; the bits have the last word ([C50], [C95])."""
        if self.word is None:
            return self.listed.kind
        return self.model.profile.status_word.kind(self.word, self.listed.kind)

    @functools.cached_property
    def state(self) -> State:
        """The state of the generic state machine."""
        if self.word is None:
            return State.UNKNOWN
        return self.model.profile.status_word.state(self.word)

    @functools.cached_property
    def unknown(self) -> bool:
        """Neither its word nor its code is one that the manual lists: it says nothing."""
        stateless = self.word is not None and self.model.profile.status_word.stateless
        if self.state is not State.UNKNOWN or stateless:
            return False
        return self.code_is_of_word or self.code not in self.model.status_codes

    @property
    def code_is_of_word(self) -> bool:
        """The word has the code, too."""
        return self.word is not None and self.model.profile.status_word.code is not None

    @property
    def faulted(self) -> bool:
        """A fault is active, or waits for being acknowledged [M0 table 15]."""
        return Fact.FAULT in self.facts

    @property
    def standby(self) -> bool:
        """It waits for a command over the bus."""
        return self.means(Meaning.BUS_STANDBY)

    @property
    def from_bus(self) -> bool:
        """The bus has control, or may have it: where the word only echoes, a motor that turns."""
        if self._from_bus_by_code or Fact.NETWORK_CONTROL in self.facts:
            return True
        turns = self._only_frequency and abs(self.frequency) > 0
        return turns and not self.means(Meaning.WITHHELD)

    @property
    def runs(self) -> bool:
        """The motor is driven and not on its way to a stop."""
        if self.state is State.UNKNOWN:
            return self._driven_by_code
        return self.state is State.OPERATION_ENABLED

    @property
    def may_run(self) -> bool:
        """
        It runs, or it stands where a run command shows only while the motor turns.

        One that waits for its start delay does not run yet, though its word may show a ramp before.
        """
        if self.means(Meaning.START_DELAY):
            return False
        hidden = self.model.profile.status_word.runs_by_turning
        return self.runs or (hidden and self.state is State.READY_TO_SWITCH_ON)

    @property
    def runs_by_bus(self) -> bool:
        """The motor is driven on a command that came over the bus."""
        return self.runs and self.from_bus

    @property
    def keeps_running(self) -> bool:
        """It runs on a command from the bus, and may not be on its way to a stop."""
        # without a status word nothing distinguishes a stop from a lower reference
        may_stop = self.word is None and self.means(Meaning.SLOWING)
        falls = self.fell[1] >= self.at - FALLS_WITHIN
        slows = self.by_frequency and (self.frequency == 0 or falls)
        return self.runs_by_bus and not may_stop and not slows

    def keeps_running_since(self, stopped_at: float) -> bool:
        """
        Return whether it keeps running, although it was given a stop.

        :param stopped_at: when, s of ``time.monotonic``: a frequency that fell before says nothing.
        """
        if not self.by_frequency:
            return self.keeps_running
        stands = self.at > stopped_at and self.frequency == 0
        stops = stands or self.falls_since(stopped_at)
        if self._only_frequency:
            # energised at set-point 0 it stands, too
            return self.from_bus and not (stops and not self.runs)
        return self.runs_by_bus and not stops

    def falls_since(self, moment: float) -> bool:
        """Return whether its frequency has begun to fall after a moment, s, and has not risen."""
        return self.fell[0] > moment

    @property
    def stands_running(self) -> bool:
        """The motor stands, and the word goes on saying that the bus runs it."""
        return self.by_frequency and self.runs_by_bus and self.frequency == 0

    @property
    def by_frequency(self) -> bool:
        """Its word goes on saying that the motor runs while that ramps to a stop."""
        return self.model.profile.status_word.by_frequency

    @property
    def tuning(self) -> bool:
        """It measures the motor, which is energised then, whatever else the status says."""
        return self.means(Meaning.TUNING)

    @property
    def plain(self) -> bool:
        """
        The motor stands or runs, without alarm or fault, and nothing is on its way.

        As long as the status word stays as it is then, the code can only change to another that
        requires no action: speeding up, at the reference, slowing down, the brake chopper,
        standing by for keypad or terminals [M0 tables 15, 16 and 19].
        """
        if self.kind is not Kind.STATUS or self.means(Meaning.TUNING, Meaning.START_DELAY):
            return False
        # and both say the same
        return self.driven == self.runs == self._driven_by_code

    @property
    def local(self) -> bool:
        """The code says that keypad or terminals have control, and no word that the bus has."""
        elsewhere = self.means(Meaning.TERMINALS, Meaning.KEYPAD)
        return elsewhere and not self.means(Meaning.ANONYMOUS) and not self.from_bus

    @property
    def driven(self) -> bool:
        """The output stage drives the motor, be it only to a stop; or nothing denies that."""
        if self.state is State.UNKNOWN or self.tuning:
            return self.tuning or self.unknown or self._driven_by_code
        stands = self.by_frequency and self.frequency == 0
        turns = self._only_frequency and abs(self.frequency) > 0
        return turns or self.ramp_hidden or (self.state in _DRIVEN and not stands)

    @property
    def ramp_hidden(self) -> bool:
        """The frequency alone shows that the motor is driven, on its ramp to a stop."""
        hides = self.model.profile.status_word.hides_ramp and self.state in _AFTER_RAMP
        return hides and abs(self.frequency) > 0

    @property
    def _only_frequency(self) -> bool:
        return self.model.profile.status_word.only_frequency

    @property
    def _from_bus_by_code(self) -> bool:
        if self.means(Meaning.ANONYMOUS):
            return self.by_mode
        return self.means(Meaning.BUS_RUNNING, Meaning.BUS_STANDBY)

    @property
    def _driven_by_code(self) -> bool:
        return self.means(Meaning.BUS_RUNNING, Meaning.LOCAL_RUNNING, Meaning.RUNNING)
