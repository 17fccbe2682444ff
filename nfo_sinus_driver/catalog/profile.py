# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the profile of a family is made of: data, and sequences of steps that others carry out.

A sequence is a generator. It yields a step, is given what the step has brought, and yields the next
one; so it says what to write and nothing of when, by which bus and how urgent, and is tried without
any. A step that the drive refuses raises :class:`Refusal` where it was yielded; whatever else goes
wrong with it ends the sequence.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
import enum
from fractions import Fraction
import math
from typing import Any, ClassVar, Protocol, TypeVar

from nfo_sinus_driver.catalog.own_parameters import OwnAddresses
from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.speed_mode import SpeedMode
from nfo_sinus_driver.catalog.status import Role, State, StatusCode, StatusWord

_T = TypeVar('_T')


class Refusal(Exception):
    """
    The drive has refused a step; what it answered is the cause.

    In :meth:`ControlMethod.force_stop` a step without an answer counts as refused, too.
    """


class NotTried(Refusal):
    """
    What a step reads was not even tried, for it takes longer than a stop may wait.

    What cannot be written rightly without it raises this again: the next try reads.
    """


class NotPossible(Exception):
    """A sequence cannot be carried out; the message says why and what to do."""


class Status(Protocol):
    """What a sequence may ask of the status that the drive reports."""

    @property
    def word(self) -> int | None:
        """The status word; ``None`` if the drive has none."""

    @property
    def state(self) -> State:
        """The state of the generic state machine."""

    @property
    def from_bus(self) -> bool:
        """The bus has control."""


# --- steps ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Read:
    """Read a parameter; brings its value. ``retry``: repeat the request without a response."""

    key: str
    retry: bool = True


@dataclass(frozen=True)
class Write:
    """
    Write a parameter.

    :ivar value: a float is rounded to the drive's step; anything else is written as it is or not.
    :ivar at: the parameter in whose place it is written where the line reaches that one; ``key``
        still says how.
    :ivar retry: repeat the request when there is no response.
    :ivar head: at the head of the bus, as the very next frame.
    :ivar stored: it goes to a memory that wears out: it is written only where another value stands,
        and reported.
    """

    key: str
    value: Value
    at: str = ''
    retry: bool = True
    head: bool = False
    stored: bool = False


@dataclass(frozen=True)
class Acknowledge:
    """Read a parameter whose reading acknowledges, once; brings its value."""

    key: str


@dataclass(frozen=True)
class AcknowledgeThenWrite:
    """
    Read a parameter whose reading acknowledges, and write another as the very next frame.

    What became of the reading is not returned.
    """

    key: str
    write: Write


@dataclass(frozen=True)
class Until:
    """
    Wait until a status from after the last write fulfils a condition; else the sequence ends.

    Only when control is taken and when the motor is started.
    """

    condition: Callable[[Status], bool]


@dataclass(frozen=True)
class Hold:
    """
    Wait until a status from after the last write fulfils a condition, and go on if none does.

    Only when a fault is acknowledged. Brings whether it does.

    :ivar seconds: how long at most.
    """

    condition: Callable[[Status], bool]
    seconds: float


@dataclass(frozen=True)
class Wait:
    """Let time pass, s."""

    seconds: float


#: Follows a bit that rises to acknowledge, before it falls: a drive that takes its word only now
#: and then has to find it [C117].
FAULT_GONE = Hold(
    lambda status: status.state not in (State.FAULTED, State.FAULT_REACTION_ACTIVE), 1.0
)

Step = Read | Write | Acknowledge | AcknowledgeThenWrite | Until | Hold | Wait
Steps = Generator[Step, Any, _T]


def one_step(step: Step) -> Steps[Any]:
    """Return a sequence of one step."""
    return (yield step)


def try_steps(steps: Steps[None]) -> Steps[bool]:
    """Take some steps; return whether the drive accepted them all."""
    try:
        yield from steps
    except (Refusal, NotPossible):
        return False
    return True


# --- set-points -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Limits:
    """
    Between what a set-point may be, in the unit of the control mode.

    :ivar least: the drive takes none below it.
    :ivar most: it takes none above it.
    :ivar nominal: what the motor is made for, in either direction; infinite where it is unknown.
    """

    least: float = -math.inf
    most: float = math.inf
    nominal: float = math.inf


@dataclass(frozen=True)
class SetpointTarget:
    """
    Where the set-points of one control mode go; here one parameter that takes them as they are.

    :ivar key: that parameter.
    :ivar most: the greatest set-point in either direction, in the unit of the control mode.
    :ivar at: the parameter in whose place it is written, as for :class:`Write`.
    :ivar forward_only: the drive takes none below 0.
    :ivar directed: its sign is the direction of the motor; else something else gives that.
    :ivar nominal: what the motor is made for, in the same unit: the parameter that has it, or the
        value itself; infinite where it is unknown.
    :ivar ends: the two parameters between which the drive takes set-points, if it has such.
    :ivar older_most: as ``most``, of the family's :class:`OlderDialect`.
    :ivar followed: the parameter that reports what the drive follows, from any source; ``''``:
        :attr:`key` does.
    :ivar is_command: it is the run command, too: the motor follows it without another one.
    """

    key: str
    most: float
    at: str = ''
    forward_only: bool = False
    directed: bool = True
    nominal: str | float = math.inf
    ends: tuple[str, str] | None = None
    older_most: float = math.inf
    followed: str = ''
    is_command: bool = False

    @property
    def least(self) -> float:
        """The least set-point: the greatest one in reverse, or 0."""
        return 0.0 if self.forward_only else -self.most

    @property
    def has_sign(self) -> bool:
        """What is written to it has the sign of the set-point; else it is a size."""
        return True

    @property
    def written_once(self) -> frozenset[str]:
        """The parameters that are not written again as long as the same stands in the drive."""
        return frozenset()

    def read_nominal(self, has: Callable[[str], bool]) -> Steps[float]:
        """
        Find out what the motor is made for, in the unit of the control mode; it only reads.

        :param has: returns whether the drive has a parameter.
        :returns: infinite where nothing reports it.
        """
        if isinstance(self.nominal, float):
            return self.nominal
        return float((yield Read(self.nominal))) if has(self.nominal) else math.inf

    def read_limits(self, has: Callable[[str], bool], *, older: bool = False) -> Steps[Limits]:
        """
        Find out what a set-point may be; it only reads.

        :param has: returns whether the drive has a parameter.
        :param older: its firmware is of the family's :class:`OlderDialect`.
        """
        least, most = self.least, self.most
        if older:
            least, most = max(least, -self.older_most), min(most, self.older_most)
        if self.ends is not None and all(map(has, self.ends)):
            first, last = self.ends
            low, high = sorted((float((yield Read(first))), float((yield Read(last)))))
            # two that are equal are not set
            if low < high:
                least, most = max(least, low), min(most, high)
        return Limits(least, most, (yield from self.read_nominal(has)))

    def writes(self, value: float, before: float = math.nan) -> Sequence[Write]:
        """
        Return what is to be written for a set-point, in this order: always the same keys.

        Only the first write that changes something is carried out; then this is asked anew, be it
        for a newer set-point. So the motor follows each write as it comes, and each has to do no
        harm alone: where the size stands beside the direction, one that is not 0 is made 0 before
        the direction changes. A key may stand in it twice, then.

        :param before: the set-point that the drive has; NaN if unknown.
        """
        return (Write(self.key, value, at=self.at),)

    def value(self, values: Mapping[str, Value]) -> float:
        """Return the set-point that the values of these keys mean to the drive."""
        return float(values[self.key])

    def zero(self, *, retry: bool) -> Steps[None]:
        """Write set-point 0; ``retry``: repeat a request without a response."""
        for write in self.writes(0.0):
            yield Write(write.key, write.value, at=write.at, retry=retry)

    def set_to_zero(self) -> Steps[None]:
        """Write set-point 0, and read it back, or :class:`NotPossible`."""
        yield from self.zero(retry=True)
        values: dict[str, Value] = {}
        for key in dict.fromkeys(write.key for write in self.writes(0.0)):
            values[key] = yield Read(key)
        kept = self.value(values)
        if kept != 0:
            raise NotPossible(f'the drive keeps a set-point of {kept:g} where 0 was written')


# --- control --------------------------------------------------------------------------------------


class Holder(enum.Enum):
    """Who has control of a drive."""

    NOBODY = enum.auto()
    BUS = enum.auto()
    #: Keypad or terminals.
    LOCAL = enum.auto()
    #: It cannot be taken now.
    INHIBITED = enum.auto()
    #: The drive reports what its manual does not list.
    UNKNOWN = enum.auto()


class Removal(enum.Enum):
    """What a drive with a fault has let go of, so that it does not turn the motor afterwards."""

    #: It has refused everything: a run command may stand, and a set-point.
    NOTHING = enum.auto()
    #: The set-point is 0; a run command may stand.
    SETPOINT = enum.auto()
    #: No run command stands.
    COMMAND = enum.auto()


class Procedure(enum.Enum):
    """What can be tuned, by name; the order is that of the action Tune."""

    FULL = 'full tuning'
    BASIC = 'basic tuning'
    STATOR_RESISTANCE = 'stator resistance measurement'
    CALCULATE = 'parameter calculation'


class Reset(enum.Enum):
    """What else a drive does by itself on a command while its motor stands, by name."""

    ERROR_LOG = 'erasing the error log'
    ENERGY = 'resetting the kWh counter'


class ControlMethod(abc.ABC):
    """
    One way to command a drive: what to write, so that it does something.

    :param reference: where a running drive takes its reference from, one of :attr:`references`.
    :param reaches: returns whether a parameter can be reached over the line.
    :cvar means: what takes its commands.
    :cvar references: those that there are.
    :cvar coasts: it can release the motor at once.
    :cvar stop_ramp: it can have the drive take a stop ramp of its own.
    :cvar reads_run_command: its status may show a run without a run command of the line, so that
        :meth:`has_run_command` finds out whether one stands.
    :cvar older: firmware of the family's :class:`OlderDialect` has it, too.
    :cvar unused_scales: parameters that multiply its set-points where they are not all the same;
        a start requires that they are.
    :cvar unfollowed_scale: numerator and denominator of what multiplies its set-points in Speed
        mode and is not followed; a start requires that it is 1.
    :cvar needs: parameters without which a drive cannot be commanded by it.
    :cvar procedures: what begins each procedure that it has.
    :cvar holders: who has control, where this method sees that otherwise than its :class:`Profile`.
    :cvar setpoints: where its set-points go, likewise.
    :cvar addressing: how it reaches the parameters of its tables, where that is another way than
        that of the line; ``''``: that of the line.
    :cvar plc_time: after so long without a word of ours a PLC stops the drive, s; 0: there is none.
    :cvar caution: what of the drive itself decides whether it stops when the line is gone, and
        cannot be read; ``''``: nothing.
    :cvar control_retained: why :meth:`release` leaves control to the bus; ``''``: it does not.
    """

    means: ClassVar[str]
    references: ClassVar[Sequence[str]]
    coasts: ClassVar[bool] = False
    stop_ramp: ClassVar[bool] = False
    reads_run_command: ClassVar[bool] = False
    older: ClassVar[bool] = True
    unused_scales: ClassVar[Sequence[str]] = ()
    unfollowed_scale: ClassVar[Sequence[str]] = ()
    needs: ClassVar[Sequence[str]] = ()
    procedures: ClassVar[Mapping[Procedure | Reset, Write]] = {}
    control_retained: ClassVar[str] = ''
    holders: ClassVar[Mapping[Value, Holder]] = {}
    setpoints: ClassVar[Mapping[str, SetpointTarget]] = {}
    addressing: ClassVar[str] = ''
    plc_time: ClassVar[float] = 0.0
    caution: ClassVar[str] = ''

    def __init__(self, reference: str, reaches: Callable[[str], bool]) -> None:
        self._reference = reference
        self._reaches = reaches

    @abc.abstractmethod
    def in_control(self) -> Steps[bool]:
        """Return whether the bus has control, taken by this session or an earlier one."""

    @abc.abstractmethod
    def holder(self) -> Steps[Holder]:
        """Tell who has control of the drive."""

    def setpoint_target(self, target: SetpointTarget) -> SetpointTarget:
        """Return where set-points of a control mode go by this method: here where others do."""
        return target

    def require_startable(self) -> Steps[None]:
        """Raise :class:`NotPossible` if more than a fault keeps the motor from being started."""
        yield from ()

    @abc.abstractmethod
    def take_control(self) -> Steps[None]:
        """Put the drive under bus control with no run command, or :class:`NotPossible`."""

    @abc.abstractmethod
    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """
        Write set-point 0 in the unit of a control mode, and read it back.

        :raises NotPossible: the drive keeps another value, or takes none in this control mode.
        """

    @abc.abstractmethod
    def run(self) -> Steps[None]:
        """Give the run command; once, for the state before a second one would be unknown."""

    @abc.abstractmethod
    def stop(self, control_mode: str) -> Steps[None]:
        """
        Remove the run command and write set-point 0; each is tried even if the other fails [C126].

        Does nothing to a drive that is not under bus control; refused if it is and keeps the run
        command.
        """

    def remove_leftover(self) -> Steps[None]:
        """
        Remove a run command of an earlier session from a drive that the bus does not control.

        It would start the motor once the bus has control, whichever way. Here there is nothing
        to be done: control is taken by a write of the driver alone, and the stop is the next.
        """
        yield from ()

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Release the motor; control may be given back. Where it cannot be, stop as usual."""
        return self.stop(control_mode)

    def rapid_stop(self, control_mode: str) -> Steps[None]:
        """Stop along the stop ramp of the drive, if it has one; control is kept."""
        return self.stop(control_mode)

    def force_stop(self, control_mode: str) -> Steps[bool]:
        """
        Stop by all that is left where :meth:`stop` is refused or does not help, each by itself.

        Run command and set-point again, control taken away where that is safe, then the quick stop.

        :returns: whether the drive has taken one of those that leave no run command.
        """
        removed = yield from self.remove(control_mode)
        obeyed = yield from try_steps(self.quick_stop(control_mode))
        return obeyed or removed is Removal.COMMAND

    def has_run_command(self) -> Steps[bool | None]:
        """Return whether a run command of the line is read back; ``None``: none can be read."""
        yield from ()
        return None

    def perhaps_in_control(self) -> Steps[bool]:
        """Return whether the bus may have control: it has, or the drive does not report who has."""
        try:
            return (yield from self.in_control())
        except Refusal:
            return True

    def _stop_by(self, command: Steps[None], *others: Steps[None]) -> Steps[None]:
        """
        Remove a run command, then do the others, whatever the drive refuses of all this.

        Where the run command is refused and the bus has no control, nothing more is done.

        :raises Refusal: the run command is refused, and the bus may have control.
        """
        refusal: Refusal | None = None
        try:
            yield from command
        except Refusal as error:
            if not (yield from self.perhaps_in_control()):
                return
            refusal = error
        for steps in others:
            yield from try_steps(steps)
        if refusal is not None:
            raise refusal

    @abc.abstractmethod
    def release(self) -> Steps[None]:
        """Give control back; never by a MODE that can start the motor [C43], [C51]."""

    @abc.abstractmethod
    def remove(self, control_mode: str) -> Steps[Removal]:
        """
        Remove run command and set-point while a fault is active, each by itself [C98].

        A drive may refuse any of it then, and may go on by what is left once the fault is over.
        """

    @abc.abstractmethod
    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault, run command and set-point first where the bus has control.

        From a drive that refuses to let go of them the stop is the very next frame [C98].

        :param shown: the inverter status that is shown.
        :returns: what more the drive said of it; ``''`` if nothing.
        :raises NotPossible: it cannot be, without taking control from keypad or terminals.
        """


@dataclass(frozen=True)
class Product:
    """
    What a drive identifies itself as by its parameters; ``''`` is what it does not report.

    :ivar vendor: who made it.
    :ivar model: its product name and size.
    :ivar software: the part number of its software.
    :ivar listed: the manual lists this model.
    """

    vendor: str = ''
    model: str = ''
    software: str = ''
    listed: bool = True


@dataclass(frozen=True)
class OlderDialect:
    """
    Firmware that lacks parameters of the family, on a protocol where asking for one does harm.

    :ivar protocol: that protocol.
    :ivar name: the dialect, as a person chooses it.
    :ivar before: the first firmware that is not of it.
    :ivar harmless: while one of these has control, asking for what it does not know does no harm.
    :ivar factors: by what the factor of a parameter is multiplied there, by its key.
    """

    protocol: str
    name: str
    before: float
    harmless: frozenset[Holder]
    factors: Mapping[str, Fraction] = field(default_factory=dict)


@dataclass(frozen=True)
class Profile:
    """
    What is to be known of a family beside its tables.

    :ivar title: what its maker calls it.
    :ivar enable_input: what its manual calls the input that lets the motor run, with its terminal.
    :ivar has_enable_input: it is known to have one.
    :ivar has_stop_key: it is known to have a key that stops a motor which the bus runs.
    :ivar status_word: what its status word means.
    :ivar holders: who has control, by the value of the control source.
    :ivar methods: the ways to command it, by name; the first one is the usual one.
    :ivar setpoints: where set-points go, by control mode.
    :ivar active_method: finds out by which control method the bus has control of a drive, taken by
        an earlier session; given the last status, or ``None``.
    :ivar broadcast_stop: releases the motors of all drives of a line that has a broadcast.
    :ivar names_itself: it reports who it is by Modbus functions 43 and 17.
    :ivar product: reads who it is, where parameters report that; :class:`NotPossible` if it is none
        of this family. ``None``: none reports it.
    :ivar identify: parameters that tell its drives from those of other makers, and the values by
        which they do.
    :ivar vendor: how the name of its maker begins in function 43; ``''``: not known.
    :ivar identified_by: a parameter that no other family has there; ``''``: there is none.
    :ivar writes_and_reads: it has Modbus function 23.
    :ivar releases: what its stop mode is where an ordinary stop releases the motor.
    :ivar older: its firmware that lacks parameters.
    :ivar most: beyond which size a measured value is none of this drive, by its role.
    :ivar uncertain: what codes mean differs in firmware before this, by parameter.
    :ivar may_lack: parameters that not every drive has, by the protocol; looked for at connect.
    :ivar mailbox: behind a PLC with a mailbox for parameters, the protocol by which the tables of
        the family say where each of them is; ``''``: they do not.
    :ivar own_addresses: the parameters that a user may name; ``None``: there are none such.
    :ivar words: the profile of each set of words that a PLC can map, by name; this is the first.
    :ivar speed_mode: how it means its values in Speed mode, where it does not report the mode and
        has no parameters of their own for it; ``None``: it is otherwise, or has none.
    :ivar start_settings: what :meth:`ControlMethod.require_startable` depends on: none of these
        settings changes while the motor is enabled.
    :ivar line_check: what to look at, in this order, while a drive of it has never answered, by the
        protocol; where one is not there, what the protocol says itself.
    :ivar measured: the usual ones of ``~/measured``: what matters beside the telemetry.
    :ivar line: of the factory, by its manual, by the names of the driver's settings.
    :ivar refusals: what exception codes mean that say something of their own; by the code.
    :ivar busy: exception codes by which it says that it may take the request the next moment.
    :ivar timeout_conditions: the parameters on which it depends that the motor stops when its own
        time-out is over, each with the values by which it does, first the one to be written; where
        there is none, the motor stops.
    :ivar fault_code: gives the status code of what the parameter reports that names a fault.
    :ivar after_write: what makes settings take effect that were written, or keeps them.
    :ivar gap: the least silence of the line before each request to it, s; 0: that of the protocol.
    :ivar rest_after_write: for how long it is asked nothing after a parameter was written, s.
    :ivar pole_pairs: of the motor, where no parameter reports them; 0: not known.
    :ivar holds_control: why the first request gives the bus control for good, by the protocol.
    :ivar spelled: by parameter, what a tool shows beside a number that the display of the drive
        shows otherwise; ``''``: nothing.
    :ivar bit_fields: the parameters whose bits mean something each, beside the status word.
    :ivar module: the parameters by which its fieldbus module says what it is, each with how that is
        put into words.
    :ivar resync_reads: parameters that every drive of it has and that are safe to read at any time,
        by the protocol; a protocol that is not there reads others.
    :ivar why_refused: finds out why it refused a write over a protocol that does not say it; by a
        call that reads a parameter, and the status code just before (``None``: not known). Returns
        the exception code of Modbus that means the same, and the text.
    :ivar keeps_run: it keeps its run command without power, and runs again when it is back;
        ``None``: no manual says.
    :ivar rung: of a drive that a file describes, what its numbers were taken from; ``''``: the file
        does not say.
    :ivar narrow: what may be greater than the 16 bits that some buses have for it, by its
        parameter: how far it is below 0 at most, as a parameter and what that is multiplied by;
        ``''``: never.
    :ivar inhibited: why none can take control while its control source says so.
    :ivar line_words: what the driver's own settings of the line call what the drive shows of its.
    :ivar cuts_off: the values by which a setting ends all communication until its keypad gives it
        another one, by the parameter.
    """

    title: str
    status_word: StatusWord
    holders: Mapping[Value, Holder]
    methods: Mapping[str, type[ControlMethod]]
    setpoints: Mapping[str, SetpointTarget]
    active_method: Callable[[Status | None], Steps[str]]
    enable_input: str = 'enable input'
    has_enable_input: bool = True
    has_stop_key: bool = True
    broadcast_stop: Write | None = None
    names_itself: bool = False
    product: Callable[[], Steps[Product]] | None = None
    identify: Mapping[str, Sequence[Value]] = field(default_factory=dict)
    vendor: str = ''
    identified_by: str = ''
    writes_and_reads: bool = False
    releases: Value = ''
    older: OlderDialect | None = None
    most: Mapping[Role, float] = field(default_factory=dict)
    uncertain: Mapping[str, float] = field(default_factory=dict)
    may_lack: Mapping[str, Sequence[str]] = field(default_factory=dict)
    start_settings: frozenset[str] = frozenset()
    line_check: Mapping[str, str] = field(default_factory=dict)
    holds_control: Mapping[str, str] = field(default_factory=dict)
    measured: tuple[str, ...] = ()
    mailbox: str = ''
    own_addresses: OwnAddresses | None = None
    words: Mapping[str, Profile] = field(default_factory=dict)
    speed_mode: SpeedMode | None = None
    line: Mapping[str, int | str] = field(default_factory=dict)
    refusals: Mapping[int, str] = field(default_factory=dict)
    busy: frozenset[int] = frozenset()
    timeout_conditions: Mapping[str, Sequence[Value]] = field(default_factory=dict)
    fault_code: Callable[[int], int] = int
    after_write: Sequence[Write | Wait] = ()
    gap: float = 0.0
    rest_after_write: float = 0.0
    pole_pairs: int = 0
    spelled: Mapping[str, Callable[[int], str]] = field(default_factory=dict)
    bit_fields: frozenset[str] = frozenset()
    module: Mapping[str, Callable[[Value], str]] = field(default_factory=dict)
    resync_reads: Mapping[str, Sequence[str]] = field(default_factory=dict)
    why_refused: Callable[[Callable[[str], int], int | None], tuple[int, str]] | None = None
    keeps_run: bool | None = None
    rung: str = ''
    narrow: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    inhibited: str = ''
    line_words: Mapping[Value, str] = field(default_factory=dict)
    cuts_off: Mapping[str, Value] = field(default_factory=dict)

    @property
    def may_run_again(self) -> bool:
        """
        A drive that was without power for a moment would run again.

        By the run command that it keeps; or by the next set-point, where that is the command.
        """
        return bool(self.keeps_run) or any(at.is_command for at in self.setpoints.values())

    def seen_by(self, method: str) -> Profile:
        """Return the same as one of its control methods sees it."""
        own = self.methods.get(method)
        if own is None or not (own.holders or own.setpoints):
            return self
        return replace(
            self,
            holders=own.holders or self.holders,
            setpoints=own.setpoints or self.setpoints,
        )

    def methods_with(self, procedure: Procedure | Reset) -> Sequence[str]:
        """Return the control methods that have a procedure."""
        return [name for name, method in self.methods.items() if procedure in method.procedures]
