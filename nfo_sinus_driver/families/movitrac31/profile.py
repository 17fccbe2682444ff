# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""
How a MOVITRAC 31 is commanded: by function bits, while P841 is Remote control [M4 §4].

The set-point is a size (index 223) beside a direction (two of the function bits). The bits are ORed
with the terminals, and an enable has to stand at those, too; so both are looked at before anything
is written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import contextlib
import math

from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import (
    ControlMethod,
    Holder,
    Limits,
    NotPossible,
    Profile,
    Read,
    Refusal,
    Removal,
    SetpointTarget,
    Status,
    Steps,
    Write,
    one,
    taken,
)
from nfo_sinus_driver.catalog.status import Role, StatusCode
from nfo_sinus_driver.families.movitrac31 import words
from nfo_sinus_driver.families.movitrac31.product import read_if_there, read_product
from nfo_sinus_driver.families.movitrac31.words import Bits

BITS = 'fieldbus.function_bits'
SIZE = 'fieldbus.remote_setpoint'
STATUS_WORD = 'fieldbus.inverter_status'
TERMINALS = 'status.terminals'
FREQUENCY = 'status.frequency'
CONTROL_MODE = 'serial.control_mode'

_HOLDERS: Mapping[Value, Holder] = {
    words.STANDARD: Holder.LOCAL,
    words.REMOTE_SETPOINT: Holder.LOCAL,
    words.REMOTE_CONTROL: Holder.BUS,
    # a PLC, which is as little us as a terminal is
    words.FIELDBUS: Holder.LOCAL,
}
#: The greatest set-point of index 223, Hz.
_MOST = 400.0
#: The function of each terminal, by the parameter that assigns it; that of 41 is fixed.
_ASSIGNED = {
    terminal: f'terminal.input_{terminal}' for terminal in words.TERMINALS if terminal != 41
}
_DIRECTIONS = ('CW/Stop', 'CCW/Stop')
_ENABLE = 'Enable/Stop'
_INHIBIT = '/Controller inhibit'
#: What drives the motor by itself whatever the line says, and how that is ended.
_ELSEWHERE = (
    ('control.operating_mode', 'Positioning control', 'P770 to V/f mode or Speed control'),
    ('control.synchronous_operation', True, 'P760 to No'),
    ('serial.master_slave', True, 'P880 to No'),
    ('serial.manual_operation', True, 'P870 to No at the keypad'),
)
#: The V/f pattern of each parameter set, and the least frequency of each pattern.
_PATTERNS = ('frequency.vf_pattern_1', 'frequency.vf_pattern_2')
_LEAST = {
    'V/f pattern 1': 'frequency.f_min_1',
    'V/f pattern 2': 'frequency.f_min_2',
    'V/f pattern 3': 'frequency.f_min_3',
}
#: Changed while the motor is enabled, each could turn it otherwise than the line says.
_START_SETTINGS = frozenset(
    (
        *(key for key, _, _ in _ELSEWHERE),
        *_ASSIGNED.values(),
        *_PATTERNS,
        *_LEAST.values(),
        *(CONTROL_MODE, 'motor.enable_set_selection'),
    )
)
#: The frequency at which a motor has its rated voltage, and the greatest, by pattern.
_BASE = {
    'V/f pattern 1': 'frequency.f_base_1',
    'V/f pattern 2': 'frequency.f_base_2',
    'V/f pattern 3': 'frequency.f_base_3',
}
_GREATEST = {
    'V/f pattern 1': 'frequency.f_max_1',
    'V/f pattern 2': 'frequency.f_max_2',
    'V/f pattern 3': 'frequency.f_max_3',
}


class DirectionAndSize(SetpointTarget):
    """
    A set-point whose size stands in index 223, and whose sign is one of two direction bits.

    The size is 0 before the direction changes, and the motor ramps through zero. At set-point 0 the
    direction stays as it was.
    """

    def writes(self, value: float, before: float = math.nan) -> Sequence[Write]:
        """
        Return what is to be written for a set-point: where the direction changes, size 0 first.

        :param before: the set-point that the drive has, -0.0 being one in reverse; NaN if
            unknown.
        """
        unknown = math.isnan(before)
        reverse = _reverse(before if value == 0 and not unknown else value)
        run = Bits.ENABLE | (Bits.COUNTER_CLOCKWISE if reverse else Bits.CLOCKWISE)
        written = Write(BITS, int(run)), Write(self.key, abs(value))
        turns = before != 0 and reverse is not _reverse(before)
        return (Write(self.key, 0.0), *written) if unknown or turns else written

    def value(self, values: Mapping[str, Value]) -> float:
        """Return the set-point that size and bits mean; -0.0 is 0 in reverse."""
        reverse = int(values[BITS]) & Bits.COUNTER_CLOCKWISE
        return math.copysign(float(values[self.key]), -1 if reverse else 1)

    def read_limits(self, has: Callable[[str], bool], *, older: bool = False) -> Steps[Limits]:
        """Read base and greatest frequency of the V/f pattern in use (P201, P202 and the like)."""
        pattern = yield from _pattern()
        nominal = yield from _read_of(_BASE, pattern)
        most = min(self.most, (yield from _read_of(_GREATEST, pattern)))
        return Limits(-most, most, nominal)

    def zero(self, *, retry: bool) -> Steps[None]:
        """Write size 0 and leave the bits alone, for a direction among them would be a command."""
        yield Write(self.key, 0.0, retry=retry)

    def set_to_zero(self) -> Steps[None]:
        """Write size 0, and read it back alone."""
        yield from self.zero(retry=True)
        kept = float((yield Read(self.key)))
        if kept:
            raise NotPossible(f'the drive keeps a set-point of {kept:g} where 0 was written')


def _reverse(value: float) -> bool:
    return math.copysign(1, value) < 0


_SETPOINT = DirectionAndSize(SIZE, _MOST)


class FunctionBits(ControlMethod):
    """
    Control through the function bits while P841 is Remote control.

    A stop takes the direction away and leaves the enable, so that the motor ramps as for set-point
    0; without the enable it would take the stop ramp.
    """

    means = 'function bits'
    references = ('fieldbus',)
    coasts = True
    control_retained = (
        'P841 stays Remote control, for another value can start the motor; change '
        'serial.control_mode, or P841 at the keypad, to give it to the terminals'
    )

    def in_control(self) -> Steps[bool]:
        """Tell whether the line has control of the drive, from us or from whom was here before."""
        return (yield from self.holder()) is Holder.BUS

    def holder(self) -> Steps[Holder]:
        """Tell who has control of the drive."""
        return _HOLDERS.get((yield Read(CONTROL_MODE)), Holder.UNKNOWN)

    def require_startable(self) -> Steps[None]:
        """
        See to it that the motor does what the line says, and nothing before; it only reads.

        :raises NotPossible: something else drives it, or would, or it would turn at set-point 0.
        """
        for key, value, remedy in _ELSEWHERE:
            if (yield from read_if_there(key)) == value:
                raise NotPossible(
                    f'the motor is not driven by set-points of the line: set {remedy}'
                )
        assigned = yield from _assignments()
        closed = int((yield Read(TERMINALS)))
        _require_no_direction(assigned, closed)
        _require_enable(assigned, closed)
        # at standstill, too, a drive may show that it is enabled
        if not (yield from self.in_control()) and (yield Read(FREQUENCY)):
            raise NotPossible('the motor is driven by a fieldbus or by terminals (P841): stop it')
        yield from _require_still_at_zero()

    def take_control(self) -> Steps[None]:
        """
        Remove function bits and set-point, then set P841 to Remote control if it is not.

        With another P841 the drive may refuse or ignore the others, so they are written again
        [C110]. Where a direction and a set-point are left behind by that, by which the motor would
        turn at once, it goes by way of Remote setpoint: there the set-point counts, and the bits do
        not.

        :raises NotPossible: it keeps other function bits, or another set-point.
        """
        found = yield Read(CONTROL_MODE)
        if found != words.REMOTE_CONTROL:
            for write in (Write(BITS, 0), Write(SIZE, 0.0)):
                with contextlib.suppress(Refusal):
                    yield write
            if (yield from _would_turn()):
                yield from self._pass_remote_setpoint(found)
            else:
                yield Write(CONTROL_MODE, words.REMOTE_CONTROL, stored=True)
        yield Write(BITS, 0, head=True)
        yield from self.zero_setpoint('')
        kept = int((yield Read(BITS)))
        if kept:
            raise NotPossible(f'the drive keeps function bits {kept:04X}h where 0 was written')

    def _pass_remote_setpoint(self, found: Value) -> Steps[None]:
        """
        Set P841 to Remote setpoint, remove the set-point, and go on to Remote control.

        Where that fails P841 is put back, unless the motor could start by it.
        """
        yield Write(CONTROL_MODE, words.REMOTE_SETPOINT, stored=True)
        try:
            yield from self.zero_setpoint('')
            yield Write(CONTROL_MODE, words.REMOTE_CONTROL, stored=True)
        except (NotPossible, Refusal):
            yield from taken(_put_back(found))
            raise

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """
        Write set-point 0, and read it back; the direction is left alone.

        :raises NotPossible: the drive keeps another value.
        """
        yield from _SETPOINT.set_to_zero()

    def run(self) -> Steps[None]:
        """Enable, forward; once, for the state before a second one would be unknown."""
        yield Write(BITS, int(Bits.ENABLE | Bits.CLOCKWISE), retry=False)

    def stop(self, control_mode: str) -> Steps[None]:
        """
        Take the direction away, and write set-point 0 [C126]; an enable that stands is left.

        None is given, for a direction may come from a terminal. Does nothing to a drive that is not
        under control of the line: refused if it is and does not obey.
        """
        yield from self._stop_by(_take_direction(), _SETPOINT.zero(retry=False))

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Release the motor at once, by controller inhibit; control is kept."""
        inhibit = Write(BITS, int(Bits.CONTROLLER_INHIBIT))
        yield from self._stop_by(one(inhibit), _SETPOINT.zero(retry=True))

    def release(self) -> Steps[None]:
        """Remove function bits and set-point; P841 stays, for another one can start the motor."""
        if (yield from self.in_control()):
            yield from self._stop_by(one(Write(BITS, 0)), _SETPOINT.zero(retry=True))

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Remove function bits and set-point while a fault is active, each by itself."""
        command = yield from taken(one(Write(BITS, 0)))
        setpoint = yield from taken(self.zero_setpoint(control_mode))
        if command:
            return Removal.COMMAND
        return Removal.SETPOINT if setpoint else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault by one rising edge of the reset bit, the run bits removed first.

        :raises NotPossible: a direction stands at a terminal, by which the motor could start; the
            drive keeps its function bits; or it ignores them.
        """
        _require_no_direction((yield from _assignments()), int((yield Read(TERMINALS))))
        if (yield from self.remove(control_mode)) is not Removal.COMMAND:
            raise NotPossible(
                'the drive refuses function bits: reset it at the keypad or by a terminal'
            )
        for bits in (Bits.RESET, Bits(0)):
            yield Write(BITS, int(bits))
        # with another P841 the drive may ignore function bits [C110]
        if not (yield from self.in_control()) and int((yield Read(STATUS_WORD))) & words.FAULT:
            raise NotPossible(
                'P841 is not Remote control, and the drive ignores function bits: reset it at the '
                'keypad or by a terminal'
            )
        return ''


def _take_direction() -> Steps[None]:
    """
    Take the direction away, and keep enable and inhibit.

    Where the bits cannot be read nothing of them is kept: without its enable the motor takes the
    stop ramp, and none is given that did not stand.
    """
    kept = Bits(0)
    with contextlib.suppress(Refusal):
        kept = Bits(int((yield Read(BITS, retry=False))))
    yield Write(BITS, int(kept & (Bits.ENABLE | Bits.CONTROLLER_INHIBIT)), retry=False)


def _put_back(found: Value) -> Steps[None]:
    """Set P841 to what it was, where neither a terminal nor a fieldbus can start the motor then."""
    if found != words.STANDARD:
        return
    _require_no_direction((yield from _assignments()), int((yield Read(TERMINALS))))
    if not (yield Read(FREQUENCY)):
        yield Write(CONTROL_MODE, found, stored=True)


def _would_turn() -> Steps[bool]:
    """Tell whether function bits and set-point would turn the motor if they counted."""
    bits = yield from read_if_there(BITS)
    directed = bits is not None and int(bits) & (Bits.CLOCKWISE | Bits.COUNTER_CLOCKWISE)
    return bool(directed) and bool((yield from read_if_there(SIZE)))


def _assignments() -> Steps[Mapping[int, Value | None]]:
    """Return what each terminal is for; ``None`` of those that the drive does not have."""
    found: dict[int, Value | None] = {41: 'CW/Stop'}
    for terminal, key in _ASSIGNED.items():
        found[terminal] = yield from read_if_there(key)
    return found


def _require_no_direction(assigned: Mapping[int, Value | None], closed: int) -> None:
    for terminal, function in assigned.items():
        if function in _DIRECTIONS and closed & words.TERMINALS[terminal]:
            raise NotPossible(
                f'terminal {terminal} ({function}) is closed: the motor would turn by it; open it'
            )


def _require_enable(assigned: Mapping[int, Value | None], closed: int) -> None:
    for terminal, function in assigned.items():
        if function in (_ENABLE, _INHIBIT) and not closed & words.TERMINALS[terminal]:
            raise NotPossible(
                f'terminal {terminal} ({function}) is open: the motor cannot run; close it'
            )


def _require_still_at_zero() -> Steps[None]:
    """
    See to it that the motor stands at set-point 0.

    :raises NotPossible: the parameter set in use has a least frequency.
    """
    least = _LEAST.get((yield from _pattern()))
    frequency: float = 0.0 if least is None else (yield Read(least))
    if frequency:
        raise NotPossible(
            f'the motor would turn at set-point 0: set {least} to 0 (it is {frequency:g} Hz)'
        )


def _read_of(keys: Mapping[str, str], pattern: str) -> Steps[float]:
    """Read the frequency of a V/f pattern; infinite for one that the manual does not list."""
    return float((yield Read(keys[pattern]))) if pattern in keys else math.inf


def _pattern() -> Steps[str]:
    """Return the V/f pattern of the parameter set in use."""
    word = int((yield Read(STATUS_WORD)))
    pattern = yield Read(_PATTERNS[bool(word & words.IN_SET_2)])
    return str(pattern)


def _in_charge(status: Status | None) -> Steps[str]:
    """Return the control method, of which there is one."""
    yield from ()
    return 'function_bits'


PROFILE = Profile(
    title='MOVITRAC 31',
    enable_input='enable terminal (43 from the factory)',
    status_word=words.STATUS_WORD,
    holders=_HOLDERS,
    methods={'function_bits': FunctionBits},
    setpoints={'Freque': _SETPOINT},
    in_charge=_in_charge,
    product=read_product,
    start_settings=_START_SETTINGS,
    measured=(
        'status.heat_sink_temperature',
        'status.external_current_limit',
        'status.apparent_current',
        'status.inverter_utilization',
        'status.motor_utilization_1',
        'status.motor_utilization_2',
        'status.terminals',
    ),
    # a tenth above what the display values have [M4 §4]: the motor may be overhauled
    most={Role.ACTUAL_FREQUENCY: 440.0, Role.ACTUAL_SPEED: 9999.0},
)
