# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a drive reports of itself and what it has, in terms that mean the same in every family.

The same bit and the same code say different things ([C49] to [C55]): a family's tables and a
:class:`StatusWord` turn them into facts, states and meanings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import enum
from fractions import Fraction
import functools
from typing import NamedTuple


class _LookedUp(enum.Enum):
    """What is looked up with every poll, by identity: an enum's own hash is a call of its own."""

    __hash__ = object.__hash__


class Kind(_LookedUp):
    """How grave an inverter status is; the drive's fault bit has the last word [C95]."""

    STATUS = 'status'
    ALARM = 'alarm'
    FAULT = 'fault'


class Meaning(_LookedUp):
    """What an inverter status code means; one may mean several of these, or none."""

    #: Motor off, waiting for a command over the bus.
    BUS_STANDBY = 'bus_standby'
    #: Running under bus control.
    BUS_RUNNING = 'bus_running'
    #: The speed may decrease under bus control, be it to a stop.
    SLOWING = 'slowing'
    #: Who is between, a PLC, does not let the bus have control.
    WITHHELD = 'withheld'
    #: Standing by or running under terminal control.
    TERMINALS = 'terminals'
    #: Running where neither the bus nor the terminals have control.
    KEYPAD = 'keypad'
    #: Of these two: the motor is driven.
    LOCAL_RUNNING = 'local_running'
    #: The motor is driven, under any control.
    RUNNING = 'running'
    #: It does not say who controls.
    ANONYMOUS = 'anonymous'
    #: The run command is there and the start is delayed.
    START_DELAY = 'start_delay'
    #: A tuning procedure is going on; has ended well; has not.
    TUNING = 'tuning'
    TUNED = 'tuned'
    TUNING_FAILED = 'tuning_failed'
    #: The current limit holds the motor back.
    CURRENT_LIMIT = 'current_limit'
    #: There is a fault or an alarm; another parameter names it.
    UNNAMED = 'unnamed'
    #: The serial line was silent for too long, or damaged; the same of the fieldbus.
    SERIAL_FAILURE = 'serial_failure'
    FIELDBUS_FAILURE = 'fieldbus_failure'


@dataclass(frozen=True)
class StatusCode:
    """
    One inverter status code of one family.

    :ivar text: what the display shows.
    :ivar old_text: what it shows before firmware :attr:`renamed`, where that is otherwise [C3].
    """

    code: int
    text: str
    old_text: str = ''
    renamed: Fraction | None = None
    kind: Kind = Kind.STATUS
    requires_ack: bool = False
    meanings: frozenset[Meaning] = frozenset()
    description: str = ''
    remedy: str = ''

    def shown(self, firmware: Fraction | None) -> str:
        """Return the text on the display of a drive with this firmware; ``None``: unknown."""
        old = self.renamed is not None and firmware is not None and firmware < self.renamed
        return self.old_text if old else self.text


class Fact(enum.IntFlag):
    """What a drive may say of itself; names and values are those of the message DriveStatus."""

    READY = 1 << 0
    SWITCHED_ON = 1 << 1
    OPERATION_ENABLED = 1 << 2
    FAULT = 1 << 3
    ALARM = 1 << 4
    VOLTAGE_ENABLED = 1 << 5
    QUICK_STOP_ACTIVE = 1 << 6
    SWITCH_ON_DISABLED = 1 << 7
    NETWORK_REFERENCE = 1 << 8
    NETWORK_CONTROL = 1 << 9
    SETPOINT_REACHED = 1 << 10
    LIMIT_ACTIVE = 1 << 11
    SLEEPING = 1 << 12
    STOP_MODE_BRAKE = 1 << 13
    REVERSE = 1 << 14
    STOPPING = 1 << 15
    RUN_INPUT_MISSING = 1 << 16


class State(_LookedUp):
    """States of the generic state machine [M0 table 16]."""

    UNKNOWN = 0
    NOT_READY_TO_SWITCH_ON = 1
    SWITCH_ON_DISABLED = 2
    READY_TO_SWITCH_ON = 3
    SWITCHED_ON = 4
    OPERATION_ENABLED = 5
    #: DISABLE or SHUTDOWN: the status word does not distinguish them [C37].
    STOPPING = 6
    QUICK_STOP = 7
    FAULT_REACTION_ACTIVE = 8
    FAULTED = 9


@dataclass(frozen=True)
class StatusWord:
    """
    What the status word of one family means.

    :ivar state: gives the state that a status word shows.
    :ivar by_bit: which facts each bit reports.
    :ivar by_state: which facts only the state reports.
    :ivar by_clear_bit: which facts each bit reports when it is 0.
    :ivar stateless: a status word may show none; where not, such a word is none of this drive.
    :ivar code: gives the status code that a word reports, whatever the word; ``None``: the code is
        a parameter of its own.
    :ivar shown: which bits of it are published.
    :ivar by_frequency: it goes on saying that the motor runs while that ramps to a stop, so that
        the frequency has to show; it is read with every status.
    :ivar hides_ramp: it may say that the drive is only ready, or switched on, while the motor ramps
        to a stop: its frequency shows that.
    :ivar only_frequency: it may say that the motor runs, or that it does not, while it does the
        other: whether it turns is for the frequency alone to show.
    :ivar frequency_beside: the frequency comes in the telegram of the status word, and is read with
        every status.
    :ivar runs_by_turning: a run command shows only while the motor turns: at set-point 0 an enabled
        drive reports the same as one without.
    :ivar sizes: which of frequency and speed are measured without a sign; REVERSE reports it, or,
        where no bit means that, nothing does.
    """

    state: Callable[[int], State]
    by_bit: Mapping[int, Fact]
    by_state: Mapping[State, Fact]
    by_clear_bit: Mapping[int, Fact] = field(default_factory=dict)
    stateless: bool = False
    code: Callable[[int], int] | None = None
    shown: int = 0xFFFFFFFF
    by_frequency: bool = False
    hides_ramp: bool = False
    only_frequency: bool = False
    frequency_beside: bool = False
    runs_by_turning: bool = False
    sizes: frozenset[Role] = frozenset()

    def may_say(self, word: int) -> bool:
        """Return whether a status word is one of those that the manual knows."""
        return self.stateless or self.state(word) is not State.UNKNOWN

    @functools.cached_property
    def valid(self) -> Fact:
        """The facts that this family reports at all; of the others nothing is known."""
        valid = Fact.ALARM  # where no bit reports it, the inverter status does
        for facts in (self.by_bit, self.by_state, self.by_clear_bit):
            for fact in facts.values():
                valid |= fact
        return valid

    def facts(self, word: int, listed: Kind) -> Fact:
        """Return what a status word says, with the kind that the table lists for its code."""
        facts = self._bits(word) | self.by_state.get(self.state(word), Fact(0))
        return facts | Fact.ALARM if self.kind(word, listed) is Kind.ALARM else facts

    def kind(self, word: int, listed: Kind) -> Kind:
        """
        Return how grave the inverter status is: the bits have the last word ([C50], [C95]).

        :param listed: as its table has it.
        """
        facts = self._bits(word)
        if Fact.FAULT in facts:
            return Kind.FAULT
        if self.tells_alarms:
            return Kind.ALARM if Fact.ALARM in facts else Kind.STATUS
        return Kind.ALARM if listed is Kind.FAULT else listed

    @property
    def tells_alarms(self) -> bool:
        """It has a bit for alarms."""
        return Fact.ALARM in self.by_bit.values()

    @functools.cached_property
    def _facts_of_bits(self) -> tuple[tuple[int, bool, int], ...]:
        # plain numbers: this is done with every poll, and flags take their time
        sources = ((True, self.by_bit), (False, self.by_clear_bit))
        return tuple(
            (int(bit), is_set, int(fact)) for is_set, bits in sources for bit, fact in bits.items()
        )

    def _bits(self, word: int) -> Fact:
        facts = 0
        for bit, is_set, fact in self._facts_of_bits:
            if bool(word & bit) is is_set:
                facts |= fact
        return Fact(facts)


class Role(_LookedUp):
    """
    What a parameter is to the driver; a family without it lacks the feature.

    What is measured has the name of its field in the message Telemetry, but for ``actual_``.
    """

    STATUS_CODE = 'status_code'
    STATUS_WORD = 'status_word'
    #: Who controls the drive.
    CONTROL_SOURCE = 'control_source'
    #: Whether keypad or terminals command, whatever the control source says.
    LOCAL_OPERATION = 'local_operation'
    #: Behind a PLC: which telegram is exchanged; a drive that reports it has parameters there.
    TELEGRAM = 'telegram'
    #: Which fault or alarm it is, where the status word only says that there is one.
    FAULT_CODE = 'fault_code'
    FIRMWARE = 'firmware'
    MOTOR_FIRMWARE = 'motor_firmware'

    CONTROL_MODE = 'control_mode'
    PROCESS_UNIT = 'process_unit'
    STOP_MODE = 'stop_mode'
    START_DELAY = 'start_delay'
    #: How long the motor is braked by direct current before it starts, and once it has stopped.
    START_BRAKING = 'start_braking'
    STOP_BRAKING = 'stop_braking'

    ACTUAL_FREQUENCY = 'actual_frequency'
    ACTUAL_SPEED = 'actual_speed'
    ACTUAL_TORQUE = 'actual_torque'
    ACTUAL_PROCESS_VALUE = 'actual_process_value'
    OUTPUT_VOLTAGE = 'output_voltage'
    OUTPUT_CURRENT = 'output_current'
    OUTPUT_POWER = 'output_power'
    POWER_FACTOR = 'power_factor'
    DC_LINK_VOLTAGE = 'dc_link_voltage'
    MOTOR_TEMPERATURE = 'motor_temperature'
    PT1000_TEMPERATURE = 'pt1000_temperature'
    OPERATING_TIME = 'operating_time'
    RUNNING_TIME = 'running_time'
    BRAKE_TIME = 'brake_time'
    ENERGY = 'energy'
    TOTAL_ENERGY = 'total_energy'

    NOMINAL_POWER = 'nominal_power'
    NOMINAL_VOLTAGE = 'nominal_voltage'
    NOMINAL_FREQUENCY = 'nominal_frequency'
    NOMINAL_SPEED = 'nominal_speed'
    #: By numerator over denominator the values are multiplied that have the scale of the speed.
    SPEED_SCALE_NUMERATOR = 'speed_scale_numerator'
    SPEED_SCALE_DENOMINATOR = 'speed_scale_denominator'
    #: Of the motor; where it is missing, nominal frequency and speed report it.
    POLE_PAIRS = 'pole_pairs'
    NOMINAL_CURRENT = 'nominal_current'
    NOMINAL_POWER_FACTOR = 'nominal_power_factor'

    #: After how long a silence of the line the drive stops the motor by itself.
    COMMUNICATION_TIMEOUT = 'communication_timeout'
    BUS_PROTOCOL = 'bus_protocol'
    BUS_ADDRESS = 'bus_address'
    BAUD_RATE = 'baud_rate'
    CHARACTER_FORMAT = 'character_format'


#: What the motor plate says.
MOTOR_PLATE = (
    Role.NOMINAL_POWER,
    Role.NOMINAL_VOLTAGE,
    Role.NOMINAL_FREQUENCY,
    Role.NOMINAL_SPEED,
    Role.NOMINAL_CURRENT,
    Role.NOMINAL_POWER_FACTOR,
)


class Quantity(NamedTuple):
    """
    What a drive controls in one control mode.

    :ivar mode: that control mode, as an NFO drive displays it.
    :ivar unit: of its set-points; ``''``: a parameter of the drive tells it.
    :ivar role: its actual value.
    :ivar hertz: what one of the unit is, Hz: of a speed, turns a second; 0: it is no speed.
    """

    mode: str
    unit: str
    role: Role
    hertz: float = 0.0


FREQUENCY = Quantity('Freque', 'Hz', Role.ACTUAL_FREQUENCY, 1.0)
SPEED = Quantity('Speed', 'rpm', Role.ACTUAL_SPEED, 1 / 60)
TORQUE = Quantity('Torque', '%', Role.ACTUAL_TORQUE)
PROCESS_VALUE = Quantity('PI-Reg', '', Role.ACTUAL_PROCESS_VALUE)
#: By the control mode.
QUANTITIES = {quantity.mode: quantity for quantity in (FREQUENCY, SPEED, TORQUE, PROCESS_VALUE)}
