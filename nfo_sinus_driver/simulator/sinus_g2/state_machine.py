# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a G2 goes through: its state machine, tuning, and the restart after a fault by itself.

Every way of control ends in the generic state machine [M0 §7.1, tables 14 to 16]: DriveControl
reaches it directly, MODE and SCMD and the terminals are translated to control words for it [M0 §7].
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
import enum
import math

from nfo_sinus_driver.families.sinus_g2.words import ControlWord, Scmd, Status
from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.sinus.control_unit import TERMINAL_SHARE

#: Without both of these the power is off, or a quick stop is wanted [M0 table 14].
_POWER = ControlWord.ENABLE_VOLTAGE | ControlWord.DISABLE_QUICK_STOP


class Phase(enum.Enum):
    """
    The states of [M0 table 16].

    The status word shows DISABLE and SHUTDOWN alike [C37]; inside they differ.
    """

    NOT_READY_TO_SWITCH_ON = 'NOT_READY_TO_SWITCH_ON'
    SWITCH_ON_DISABLED = 'SWITCH_ON_DISABLED'
    READY_TO_SWITCH_ON = 'READY_TO_SWITCH_ON'
    SWITCHED_ON = 'SWITCHED_ON'
    OPERATION_ENABLED = 'OPERATION_ENABLED'
    DISABLE = 'DISABLE'
    SHUTDOWN = 'SHUTDOWN'
    QUICK_STOP = 'QUICK_STOP'
    FAULT_REACTION_ACTIVE = 'FAULT_REACTION_ACTIVE'
    FAULTED = 'FAULTED'


@dataclass(frozen=True)
class Conditions:
    """
    What the state machine knows of the rest of the drive.

    :ivar initialised: the self-test is over.
    :ivar fault: a fault is present, or not yet acknowledged.
    :ivar brake: StMode, the manual's ShutdownOptionCode: brake on the ramp, else coast.
    :ivar at_zero: zero rpm is reached.
    :ivar voltage: there is still voltage on the motor.
    """

    initialised: bool = True
    fault: bool = False
    brake: bool = True
    at_zero: bool = True
    voltage: bool = False


class StateMachine:
    """The generic state machine; its direction, 1 or -1, is kept while the motor brakes."""

    def __init__(self) -> None:
        self.phase = Phase.NOT_READY_TO_SWITCH_ON
        self.word = ControlWord(0)
        self.direction = 1
        self._asked = 0
        self._asked_here = False
        self._braked = False

    @property
    def driven(self) -> bool:
        """Whether the power stage works on the motor; it coasts otherwise."""
        if self.phase is Phase.SHUTDOWN:
            return not self._braked
        return self.phase in (Phase.OPERATION_ENABLED, Phase.DISABLE)

    def update(self, word: ControlWord, conditions: Conditions) -> None:
        """Take a control word and what became of the drive, and go as far as they lead."""
        self._take(word)
        for _ in Phase:
            following = self._following(conditions)
            if following is self.phase:
                return
            self.phase = following
            self._asked_here = False
            self._braked = False

    def asks_reset(self, word: ControlWord) -> bool:
        """Whether ``word``, coming now, acknowledges a fault: bit 7 rises in FAULTED."""
        rises = bool(word & ~self.word & ControlWord.RESET_MALFUNCTION)
        return rises and self.phase is Phase.FAULTED

    def status(self) -> Status:
        """The status word's bits that this machine decides, as the patterns of table 16 show."""
        status = _PATTERNS[self.phase]
        if self.phase in _DIRECTED:
            status |= Status.OP_ENABLED if self.direction > 0 else Status.REV_OP_ENABLED
        if self.word & ControlWord.ENABLE_VOLTAGE or self.driven:
            status |= Status.VOLTAGE_ENABLED
        echo = self.phase in _ECHOES and self.word & ControlWord.DISABLE_QUICK_STOP
        if echo:
            status |= Status.QUICK_STOP_DISABLED
        return status

    def _take(self, word: ControlWord) -> None:
        self.word = word
        forward = bool(word & ControlWord.ENABLE_OP)
        reverse = bool(word & ControlWord.ENABLE_REV_OP)
        # both bits together mean: no change [M0 table 14, bit 3]
        asked = self._asked if forward and reverse else int(forward) - int(reverse)
        if asked != self._asked and self.phase is Phase.SWITCHED_ON:
            self._asked_here = True
        self._asked = asked
        if asked:
            self.direction = asked

    def _following(self, now: Conditions) -> Phase:
        """The state after this one: the exits of [M0 table 16], one paragraph a state."""
        word, phase = self.word, self.phase
        power = word & _POWER == _POWER
        on = bool(word & ControlWord.SWITCH_ON)
        coast = bool(word & ControlWord.OVERRIDE_COAST)

        if phase is Phase.FAULT_REACTION_ACTIVE:
            return phase if now.voltage else Phase.FAULTED
        if phase is Phase.FAULTED:
            return phase if now.fault else Phase.SWITCH_ON_DISABLED
        if now.fault:
            return Phase.FAULT_REACTION_ACTIVE

        if phase is Phase.NOT_READY_TO_SWITCH_ON:
            return Phase.SWITCH_ON_DISABLED if now.initialised else phase

        if phase is Phase.SWITCH_ON_DISABLED:
            again = not on or bool(word & ControlWord.AUTO_INIT)
            return Phase.READY_TO_SWITCH_ON if power and again else phase

        if phase is Phase.READY_TO_SWITCH_ON:
            if not power:
                return Phase.SWITCH_ON_DISABLED
            return Phase.SWITCHED_ON if on else phase

        if phase is Phase.SWITCHED_ON:
            if not (power and on):
                return phase if now.voltage else Phase.READY_TO_SWITCH_ON
            event = self._asked_here or not word & ControlWord.EVENT_TRIGGERED_OP
            return Phase.OPERATION_ENABLED if self._asked and event else phase

        if phase is Phase.QUICK_STOP:
            return phase if now.voltage else Phase.SWITCH_ON_DISABLED

        # what is left has the motor running: OPERATION_ENABLED, DISABLE and SHUTDOWN
        if not power:
            return Phase.QUICK_STOP
        if phase is Phase.SHUTDOWN:
            if on:
                return Phase.OPERATION_ENABLED
            self._braked = self._braked or coast or not now.brake or now.at_zero
            return Phase.READY_TO_SWITCH_ON if self._braked and not now.voltage else phase
        if not on:
            return Phase.SHUTDOWN
        if self._asked:
            return Phase.OPERATION_ENABLED
        if phase is Phase.DISABLE and (now.at_zero or coast):
            return Phase.SWITCHED_ON
        return Phase.DISABLE


_READY = Status.READY_TO_SWITCH_ON | Status.QUICK_STOP_DISABLED
_ON = _READY | Status.SWITCHED_ON
_STOPPING = Status.STOPPING | Status.READY_TO_SWITCH_ON | Status.SWITCHED_ON

#: The fixed bits of each state [M0 table 16].
_PATTERNS = {
    Phase.NOT_READY_TO_SWITCH_ON: Status(0),
    Phase.SWITCH_ON_DISABLED: Status.SWITCH_ON_DISABLED,
    Phase.READY_TO_SWITCH_ON: _READY,
    Phase.SWITCHED_ON: _ON,
    Phase.OPERATION_ENABLED: _ON,
    Phase.DISABLE: _STOPPING | Status.QUICK_STOP_DISABLED,
    Phase.SHUTDOWN: _STOPPING | Status.QUICK_STOP_DISABLED,
    Phase.QUICK_STOP: _STOPPING,
    Phase.FAULT_REACTION_ACTIVE: _STOPPING | Status.FAULTED,
    Phase.FAULTED: Status.FAULTED,
}
#: States that show the direction in bits 2 and 14.
_DIRECTED = frozenset(
    {
        Phase.OPERATION_ENABLED,
        Phase.DISABLE,
        Phase.SHUTDOWN,
        Phase.QUICK_STOP,
        Phase.FAULT_REACTION_ACTIVE,
    }
)
#: States whose bit 5 is free: they echo the control word.
_ECHOES = frozenset(
    {
        Phase.NOT_READY_TO_SWITCH_ON,
        Phase.SWITCH_ON_DISABLED,
        Phase.FAULT_REACTION_ACTIVE,
        Phase.FAULTED,
    }
)


#: The motor is released: MODE = Stop.
RELEASED = ControlWord(0)
#: Ready, waiting for a run command. From a run it stops the motor as StMode says.
STANDBY = ControlWord.ENABLE_VOLTAGE | ControlWord.DISABLE_QUICK_STOP | ControlWord.AUTO_INIT
#: Runs, but for the direction.
RUNNING = (
    STANDBY
    | ControlWord.SWITCH_ON
    | ControlWord.ENABLE_RFG
    | ControlWord.UNLOCK_RFG
    | ControlWord.USE_REF_FOR_RFG
)

#: SCMD codes that run the motor.
RUN_COMMANDS = frozenset(code for code in Scmd if code & 1 and code < Scmd.FULL_TUNING)

#: The references that do not come over the bus, as shares of the nominal value.
_ANALOG_SHARE = 0.6
_FIXED_SHARES = (0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)


def local_share(code: int, fixed: Mapping[int, float]) -> float:
    """
    Return the reference of an SCMD run code other than Fieldbus, as a share of the nominal value.

    :param fixed: shares that the drive's own fixed references (1 to 7) have, where it has them.
    """
    if code in (Scmd.TERMINAL, Scmd.OP_MODE):
        return TERMINAL_SHARE
    sign = -1 if code & 4 else 1
    number = code >> 3
    if number == 0:
        return sign * _ANALOG_SHARE
    return sign * fixed.get(number, _FIXED_SHARES[number - 1])


# ---- tuning ----


@dataclass(frozen=True)
class Procedure:
    """
    What one SCMD of tuning does: the drive measures its motor, or calculates it [M0 table 18].

    No manual says how.

    :ivar seconds: how long it takes; real drives take minutes.
    :ivar measures: the power stage works meanwhile, so RUN must be active.
    :ivar done: InvSt when it is finished [M0 table 19]; that of the full tuning is also that of the
        basic one, which has none of its own.
    :ivar finds: the parameters that it changes.
    """

    seconds: float
    measures: bool
    done: int
    finds: tuple[str, ...]


_MODEL = ('motor.r_rot', 'motor.l_main', 'motor.sigma', 'motor.i_magn')
PROCEDURES: Mapping[int, Procedure] = {
    Scmd.FULL_TUNING: Procedure(4.0, True, 45, ('motor.r_stat', *_MODEL)),
    Scmd.BASIC_TUNING: Procedure(2.0, True, 45, ('motor.r_stat', 'motor.sigma')),
    Scmd.RS_MEASURE: Procedure(1.0, True, 46, ('motor.r_stat',)),
    Scmd.PAR_CALC: Procedure(0.3, False, 47, _MODEL),
}
#: What InvSt says when one has failed: calculation overflow, measurement fault.
FAILURES = frozenset({16, 17})


@dataclass
class Tuning:
    """One procedure that is going on."""

    procedure: Procedure
    left: float

    @classmethod
    def begun(cls, scmd: int) -> Tuning:
        """Return the one that a command starts."""
        procedure = PROCEDURES[scmd]
        return cls(procedure, procedure.seconds)

    def store(self, memory: Memory) -> None:
        """Put what was found into the memory: a motor of the usual proportions."""
        impedance = memory.number('motor.u_nom') / math.sqrt(3) / memory.number('motor.i_nom')
        reactance = 2 * math.pi * memory.number('motor.f_nom')
        found = {
            'motor.r_stat': round(0.055 * impedance, 2),
            'motor.r_rot': round(0.045 * impedance, 2),
            'motor.l_main': round(1.7 * impedance / reactance, 4),
            'motor.sigma': 0.075,
            'motor.i_magn': round(0.5 * memory.number('motor.i_nom'), 2),
        }
        for key in self.procedure.finds:
            memory.set(key, found[key])


# ---- restart by itself ----

_RST_DLY, _TR_TIME = 'error.rst_dly', 'error.tr_time'
#: The tries of each fault that has any; a short circuit shows as no fault of its own.
TRIES: Mapping[int, str] = {
    2: 'error.ac_fail_err_cnt',
    3: 'error.temp_hi_err_cnt',
    4: 'error.ptc_temp_err_cnt',
    5: 'error.overload_err_cnt',
    6: 'error.ain_fail_err_cnt',
    7: 'error.dc_low_err_cnt',
    8: 'error.dc_high_err_cnt',
    10: 'error.imagn_low_err_cnt',
    11: 'error.cur_low_err_cnt',
    12: 'error.cur_high_err_cnt',
    13: 'error.run_fail_err_cnt',
}


class SelfRestart:
    """
    Acknowledges faults by itself, and goes on: RstDly, TrTime and ErrCnt of the group Error.

    [M0] and [M2] have one line for each of them: "time from when fault disappears to restart",
    "time inverter must run perfectly not to stop" and "tries". What is simulated is how we read
    them: a fault whose cause is gone ends after RstDly, as often as ErrCnt says; a drive that then
    runs for TrTime without a fault has all tries again. With ErrCnt = 0, the factory setting, it
    waits to be acknowledged.
    """

    def __init__(self, memory: Memory, faults: Faults) -> None:
        self._memory = memory
        self._faults = faults
        self._tries: Counter[int] = Counter()
        self._waited = 0.0
        self._ran = 0.0

    def tripped(self, code: int) -> None:
        """Record a fault."""
        self._tries[code] += 1
        self._waited = self._ran = 0.0

    def wait(self, dt: float, *, driven: bool, voltage: bool) -> None:
        """Let ``dt`` seconds pass; while there is voltage, the reaction to a fault goes on."""
        if self.waiting and not voltage:
            self._waited += dt
            if self._waited >= self._memory.number(_RST_DLY):
                self._waited = 0.0
                self._faults.acknowledge()
        elif self._tries and not self._faults and driven:
            self._ran += dt
            if self._ran >= self._memory.number(_TR_TIME):
                self._tries.clear()

    @property
    def waiting(self) -> bool:
        """Whether a fault is active that ends by itself."""
        codes = self._faults.codes
        return bool(codes) and not self._faults.lasting and all(map(self._has_tries, codes))

    def _has_tries(self, code: int) -> bool:
        key = TRIES.get(code, '')
        return key in self._memory.model and self._tries[code] <= self._memory.number(key)
