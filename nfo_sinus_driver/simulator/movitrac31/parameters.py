# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the parameters of a MOVITRAC 31.. are made of, as its manual prints them [M4 §4].

The codes of its words, what it measures and remembers, its terminals and parameter sets, and which
settings go together.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
import enum

from nfo_sinus_driver.simulator.control_unit import Variant, choice
from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.motor import Motor
from nfo_sinus_driver.simulator.movitrac import ReturnCode

_MILLI = 0.001


class Bit(enum.IntFlag):
    """Function bits, index 281; byte 3, the last one on the line, has the lowest [C72]."""

    CW = 1 << 0
    CCW = 1 << 1
    ENABLE = 1 << 2
    SECOND_SET = 1 << 3
    RESET = 1 << 6
    INHIBIT = 1 << 8
    SECOND_RAMP = 1 << 12
    HOLD = 1 << 15


class Flag(enum.IntFlag):
    """Byte 3 of the inverter status, index 284."""

    NO_BRAKE_CHOPPER = 1 << 0
    SUPPLY_24_V = 1 << 1
    VOLTAGE_SIGNAL = 1 << 2
    SECOND_SET = 1 << 3
    CW = 1 << 4


class Number(enum.IntEnum):
    """The inverter status, byte 1 of index 284, as far as a drive without encoder comes to it."""

    INHIBIT = 0
    NO_ENABLE = 1
    START_MAGNETIZATION = 2
    STOP_MAGNETIZATION = 3
    HEATING_CURRENT = 5
    DC_BRAKING = 6
    DC_HOLDING_CURRENT = 7
    ENABLE = 10
    CHANGE_DIRECTION = 11
    NORMAL_STOP = 12
    RAPID_STOP = 13


class Mode(enum.IntEnum):
    """Control modes, P841."""

    STANDARD = 0
    REMOTE_SETPOINT = 1
    REMOTE_CONTROL = 2
    FIELDBUS = 3


class Input(enum.IntEnum):
    """Functions of a binary input, P600 to P609; those with a slash are on while it is open."""

    CCW = 0
    ENABLE = 1
    SECOND_SET = 2
    FIXED_1 = 3
    FIXED_2 = 4
    RESET = 5
    SECOND_RAMP = 10
    NOT_INHIBIT = 11
    NOT_EXTERNAL_FAULT = 12
    CW = 16


class Output(enum.IntEnum):
    """Functions of a binary output, P611 to P617, as far as they are simulated."""

    READY = 0
    FIELD_ON = 1
    FIELD_OFF = 2
    BRAKE_APPLIED = 3
    MANUAL = 4
    SECOND_SET = 5
    AT_SETPOINT = 11
    NOT_FAULT = 19
    BRAKE_RELEASED = 33
    STANDING = 35


#: What a status code has that is a fault: so much more than the fault's own number.
FAULTS = 100
EXTERNAL_FAULT = FAULTS + 27
PC_TIMEOUT = FAULTS + 45

#: What stands for "none" in a place for an option card.
_NONE = 9
#: The option cards [M4 §1], by the half-bytes of the places X20 and X21 (indices 237 and 284).
CARDS: Mapping[str, tuple[int, int]] = {
    'none': (_NONE, _NONE),
    'fea': (1, _NONE),
    'fio': (5, _NONE),
    'ffi': (2, _NONE),
    'ffp': (2, _NONE),
    'fen': (_NONE, 1),
    'fpi': (_NONE, 3),
    # the manual has parameters for it, and lists no number in either place
    'frs': (_NONE, _NONE),
}


@dataclass(frozen=True)
class MovitracVariant(Variant):
    """One way to fit out a drive, and to read the manual: the usual is what its words suggest."""

    option_card: str = choice(*CARDS, text='the option card that is plugged in')
    #: On RS-232 its address is of no significance [M4 §2.4.4].
    interface: str = choice('rs485', 'rs232', text='what its line is')
    #: [C105]
    status_numbers: str = choice(
        'binary', 'bcd', text='how status and fault number stand in index 284'
    )
    #: ``ored``: with an enable at the terminals the bit for it changes nothing, for "all subsequent
    #: bits are ORed with the terminal signals"; ``anded``: both are needed; ``either``: the bit
    #: alone will do.
    enable_bit: str = choice(
        'ored',
        'anded',
        'either',
        text='whether the enable of the terminals will do, the bit is needed too, or either does',
    )
    #: It ramps as if the enable were gone.
    timeout_stop: str = choice(
        'coasts', 'ramps', text='what fault 45, PC time-out, does to the motor'
    )
    #: [C110]; what is taken is followed once the mode allows.
    outside_remote_control: str = choice(
        'ignored',
        'refused',
        'taken',
        text='what becomes of function bits and set-point without use in the control mode',
    )
    #: After Normal stop on the way down; ``enable`` is shown there, too.
    stop_status: str = choice(
        'no_enable',
        'normal_stop',
        'enable',
        text='what is shown at standstill with an enable but no direction',
    )
    #: A driven motor refuses it (1Ch), or there has to be the controller inhibit (2Bh). The manual
    #: has these return codes and does not say for which parameters.
    settings_need: str = choice(
        'nothing', 'output_off', 'inhibit', text='what has to be so for a setting to be written'
    )
    negative_sign: str = choice(
        'f', '8', '1', text='the first half-byte of a negative number in BCD'
    )
    bits_after_power_on: str = choice(
        'cleared', 'kept', text='what becomes of function bits and set-point by power-off'
    )
    bits_in_fault: str = choice('kept', 'cleared', text='what a fault does to the function bits')


# ---- what is measured and remembered, as raw numbers of the line ----

#: By how much the motor's own warmth, 0 to 100, warms the heat sink (°C).
_WARMING = 0.4
#: The temperature around a drive at first (°C): that of the example in [M4 §2.1.3.1].
AMBIENT = 25.5


def _whole(value: float, most: int) -> int:
    """Return a number without decimals, of hundredths."""
    return 100 * min(round(abs(value)), most)


def _utilization(motor: Motor) -> int:
    return _whole(100 * (motor.current / motor.plate.current) ** 2, 125)


DISPLAYS: Mapping[str, Callable[[Motor], int]] = {
    # the size in steps of 0.05 Hz
    'status.frequency': lambda motor: 5 * round(20 * abs(motor.frequency)),
    'status.speed': lambda motor: _whole(motor.speed, 9999),
    'status.dc_link_voltage': lambda motor: _whole(motor.dc_link, 1000),
    'status.motor_voltage': lambda motor: _whole(motor.voltage, 1000),
    'status.apparent_current': lambda motor: _whole(100 * motor.current / motor.plate.current, 200),
    'status.inverter_utilization': _utilization,
    'status.motor_utilization_1': _utilization,
}


def heat_sink(motor: Motor, ambient: float) -> int:
    """Return its temperature in half degrees, of hundredths; it may be negative."""
    return 50 * round(2 * (ambient + _WARMING * motor.temperature))


class MovitracFaults(Faults):
    """Faults of which each may have a cause of its own that comes and goes."""

    def end_cause(self, code: int) -> None:
        """Take the cause of one fault away; it stays active until it is reset."""
        if code in self._present:
            self._present[code] = False


class FaultMemory:
    """
    What was measured when each of the last five faults happened (P060 to P064), the newest first.

    Power-off leaves it as it is.
    """

    def __init__(self) -> None:
        self._entries: list[Mapping[str, int]] = []

    def add(self, motor: Motor, ambient: float, words: Mapping[str, int]) -> None:
        """
        Remember a fault in place of the oldest.

        :param words: what does not come from the motor, by what follows ``fault_t0`` in the keys.
        """
        measured = {
            name: DISPLAYS[f'status.{name}'](motor)
            for name in ('dc_link_voltage', 'frequency', 'apparent_current')
        }
        heat = heat_sink(motor, ambient)
        measured |= {'heat_sink_temperature': heat, 'utilization': _utilization(motor)}
        self._entries = [{**measured, **words}, *self._entries[:4]]

    def raw(self, key: str) -> int | None:
        """Return a raw number of it; ``None`` for another parameter."""
        head, fault, rest = key.partition('.fault_t')
        if head != 'status' or not fault:
            return None
        number, name = int(rest[0]), rest[1:].removeprefix('_')
        return self._entries[number][name] if number < len(self._entries) else 0


class Eeprom:
    """What only the RAM has: the settings that stand otherwise in the EEPROM (P801)."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._saved: dict[str, int] = {}

    def lacks(self, key: str) -> bool:
        """Return whether a parameter has a value that is lost when power is off."""
        return key in self._saved

    def before(self, key: str) -> None:
        """Record that a parameter will be written."""
        if not self._saves:
            self._saved.setdefault(key, self._memory.raw(key))

    def after(self, key: str) -> None:
        """Record that it has been."""
        if self._saves:
            self._saved.pop(key, None)

    def restore(self) -> None:
        """Fill the memory from the EEPROM, as power-on does."""
        for key, raw in self._saved.items():
            self._memory.put(key, raw)
        self._saved.clear()

    @property
    def _saves(self) -> bool:
        """Whether what is written is saved: P801 is On, which is code 0."""
        return not self._memory.raw('special.save_to_eeprom')


# ---- terminals ----

#: The terminal that is always CW/Stop, and the one that is the enable from the factory.
_CW, ENABLE = 41, 43
#: The output that always is "Brake released".
_BRAKE = 61
#: The terminals by their bits in index 13 [C73].
_BITS = (41, 42, 43, 47, 48, 49, 50, 51, 61, 62, 63, 64, 69, 70, 71, 72, 52, 53, 54)
#: The binary inputs and outputs that each option card adds [M4 §1].
_MORE: Mapping[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    'fea': ((48, 49, 50, 51), (63, 64)),
    'fio': ((48, 49, 50, 51, 52, 53, 54), (63, 64, 69, 70, 71, 72)),
}


class Terminals:
    """
    The binary terminals and what they are assigned to (P600 to P617).

    :param card: the option card, which may bring more of them.

    :ivar inputs: the numbers of the binary inputs.
    :ivar closed: those that are closed.
    """

    def __init__(self, memory: Memory, card: str) -> None:
        inputs, outputs = _MORE.get(card, ((), ()))
        self._memory = memory
        self.inputs = (_CW, 42, ENABLE, 47, *inputs)
        self._outputs = (_BRAKE, 62, *outputs)
        self.closed: frozenset[int] = frozenset()

    def switch(self, number: int, closed: bool) -> None:
        """Close or open a binary input (ValueError: there is no such input)."""
        if number not in self.inputs:
            known = ', '.join(map(str, self.inputs))
            raise ValueError(f'there is no binary input {number}, only {known}')
        self.closed = self.closed | {number} if closed else self.closed - {number}

    def on(self, function: Input) -> bool:
        """Whether an input that has a function is closed."""
        return any(number in self.closed for number in self._having(function))

    def opened(self, function: Input) -> bool:
        """Whether an input that has a function is open, as for those with a slash."""
        return any(number not in self.closed for number in self._having(function))

    def word(self, active: Collection[Output]) -> int:
        """Return index 13: a bit for each terminal (active: the functions of outputs)."""
        closed = set(self.closed)
        for number in self._outputs:
            function = self._memory.number(f'terminal.output_{number}')
            if (Output.BRAKE_RELEASED if number == _BRAKE else function) in active:
                closed.add(number)
        return sum(1 << _BITS.index(number) for number in closed)

    def _having(self, function: Input) -> tuple[int, ...]:
        number_of = self._memory.number
        return tuple(
            number
            for number in self.inputs
            if function
            == (Input.CW if number == _CW else number_of(f'terminal.input_{number}'))
        )


# ---- parameter sets ----

#: The least time of a ramp that the simulation can follow (s).
_SHORTEST = 0.01
#: The change of frequency that the ramps are for (Hz).
_RAMP_SPAN = 50.0


@dataclass(frozen=True)
class ParameterSet:
    """
    What one of the two sets says of frequencies, ramps and stops.

    :ivar number: 1 or 2.
    :ivar f_min: the least frequency that it runs at (Hz).
    :ivar f_base: where the full voltage is reached (Hz).
    :ivar f_max: the greatest (Hz).
    :ivar up: how long the motor takes to f_base (s).
    :ivar down: how long back, and for a normal stop (s).
    :ivar stop: how long for a rapid stop (s).
    :ivar premagnetization: how long current flows before it turns (s).
    :ivar postmagnetization: how long after it has stopped (s).
    :ivar dc_braking: how long DC braking takes (s); 0: it is off.
    :ivar holds: direct current holds the motor as long as there is an enable.
    :ivar heats: direct current heats it while there is none.
    """

    number: int
    f_min: float
    f_base: float
    f_max: float
    up: float
    down: float
    stop: float
    premagnetization: float
    postmagnetization: float
    dc_braking: float
    holds: bool
    heats: bool

    def limited(self, setpoint: float) -> float:
        """Return what it runs at for a set-point (Hz)."""
        return min(max(setpoint, self.f_min), self.f_max)

    @classmethod
    def of(cls, memory: Memory, number: int, second_ramp: bool) -> ParameterSet:
        """Return what a set says (second_ramp: ramp 2 is chosen, which is one for both ways)."""
        get = memory.number
        # V/f pattern 3 is one for both sets
        pattern = number if get(f'frequency.vf_pattern_{number}') else 3
        f_base = float(memory.get(f'frequency.f_base_{pattern}'))
        braking = bool(get(f'control.dc_braking_{number}'))

        def ramp(name: str) -> float:
            return max(get(f'ramp.t{number}{name}') * f_base / _RAMP_SPAN, _SHORTEST)

        return cls(
            number=number,
            f_min=get(f'frequency.f_min_{pattern}'),
            f_base=f_base,
            f_max=get(f'frequency.f_max_{pattern}'),
            up=ramp('2_up_down' if second_ramp else '1_up'),
            down=ramp('2_up_down' if second_ramp else '1_down'),
            stop=ramp('3_stop'),
            premagnetization=_MILLI * get(f'motor.premagnetization_time_{number}'),
            postmagnetization=_MILLI * get(f'motor.postmagnetization_time_{number}'),
            dc_braking=get(f'control.dc_braking_time_{number}') if braking else 0.0,
            holds=braking and get(f'control.dc_holding_current_{number}') > 0,
            heats=bool(get(f'control.dc_heating_{number}')),
        )


# ---- which settings go with which ----

_4Q, _HOIST = 'special.four_quadrant', 'control.hoist'
_SIZE_UP, _RAPID, _BRAKING = 'motor.size_up', 'control.rapid_start', 'control.dc_braking'
#: A setting of a set is not switched so (``True``: on) while another of it stands so; and the
#: return code [M4 §2.1.2].
_RULES = (
    (_HOIST, True, _4Q, False, 'NEEDS_4Q'),
    (_4Q, False, _HOIST, True, 'HOIST_{}_ACTIVE'),
    (_SIZE_UP, True, _RAPID, True, 'SIZE_UP_OR_RAPID_START'),
    (_RAPID, True, _SIZE_UP, True, 'SIZE_UP_OR_RAPID_START'),
    (_4Q, True, _BRAKING, True, 'FOUR_Q_OR_DC_BRAKING'),
    (_BRAKING, True, _4Q, True, 'FOUR_Q_OR_DC_BRAKING'),
)


def broken(memory: Memory, key: str, raw: int) -> ReturnCode | None:
    """Return why a setting cannot have a raw number as the others stand, ``None`` if it can."""
    setting, _, number = key.rpartition('_')
    for own, on, other, other_on, code in _RULES:
        if own == setting and on == bool(raw) and other_on == bool(memory.raw(f'{other}_{number}')):
            return ReturnCode[code.format(number) if '{}' in code else f'{code}_{number}']
    return None
