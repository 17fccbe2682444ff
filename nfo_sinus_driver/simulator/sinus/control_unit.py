# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a Sinus is commanded, what reference it follows, and what its display says of it.

Here stands what the families share; what each does its own way is behind
:class:`SinusControlUnit`. Where the manuals leave the drive's behaviour open, it does what makes a
careless driver fail: a run command stands through a lost RUN input, a set-point through a power
cycle, and MODE = Ext or Auto starts the motor; or what its variant says.
"""

from __future__ import annotations

import abc
from collections.abc import Collection, Iterator, Mapping, Sequence
import contextlib
from dataclasses import dataclass
import enum
from typing import Any, ClassVar

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.simulator.classic import LineError
from nfo_sinus_driver.simulator.control_unit import ControlUnit, Variant, choice
from nfo_sinus_driver.simulator.memory import Memory, Reason, Refused
from nfo_sinus_driver.simulator.motor import Nameplate
from nfo_sinus_driver.simulator.sinus.serial_side import (
    LINE_SETTINGS,
    LineRules,
    Rules,
    SerialSide,
    SinusFaults,
)
from nfo_sinus_driver.simulator.telegram1 import FieldbusWatch
from nfo_sinus_driver.simulator.timing import Timing


class Source(enum.Enum):
    """Where the drive takes its commands from."""

    #: None: status Stop.
    STOP = 'stop'
    #: The terminals.
    EXT = 'ext'
    #: The keypad's own run command.
    KEYPAD = 'keypad'
    #: SCMD or SMODE.
    SCMD = 'scmd'
    #: DriveControl.
    CONTROL_WORD = 'control_word'


#: The keys that hand control over; STOP releases the motor [M0 §5.2].
KEYS: Mapping[str, Source] = {'stop': Source.STOP, 'ext': Source.EXT, 'start': Source.KEYPAD}
#: The reference of the terminals, as a share of the nominal value.
TERMINAL_SHARE = 0.5

#: Codes of MODE: to the terminals, to the bus; the others differ between the families [C51].
_MODE_TERMINALS, _MODE_BUS = 2, 3
_STOP = 0
#: InvSt by source: standing by, running, accelerating, retarding ([M0 table 19], [M1]).
_BUS_CODES = (37, 38, 39, 40)
_FIELDBUS_CODES = (41, 42, 43, 44)
_CODES = {
    Source.STOP: (24, 24, 24, 24),
    Source.EXT: (33, 34, 35, 36),
    Source.KEYPAD: (24, 30, 31, 32),
    Source.SCMD: _BUS_CODES,
    Source.CONTROL_WORD: _BUS_CODES,
}
#: How long the fieldbus module waits for a telegram (s); its master sets it, no manual says.
FIELDBUS_TIME = 0.2
_BRAKE_CHOPPER = 26
_CURRENT_LIMIT = 27

#: What leaves the factory, in engineering units. The motor is a 1.5 kW one on 400 V; no manual
#: prints these.
FACTORY: Mapping[str, Value] = {
    'motor.p_nom': 1.5,
    'motor.u_nom': 400,
    'motor.f_nom': 50,
    'motor.n_nom': 1440,
    'motor.i_nom': 3.4,
    'motor.i_magn': 1.8,
    'motor.i_limt': 5.1,
    'motor.r_stat': 4.2,
    'control.mode': 'Freque',
    'control.accel': 5.0,
    'control.retard': 5.0,
    'control.st_mode': 'Brake',
    'control.auto_start': False,
    'serial.bus_type': 'MbusRtu',
    'serial.address': 1,
    'serial.si_baud': '19200bps',
    'serial.si_prot': '8b Ep 1s',
    'serial.sio_tot': 0,
    'serial.auto_reset': False,
    'serial.auto_stop': False,
}


@dataclass(frozen=True)
class SinusVariant(Variant):
    """One way to read the manuals; by default a G2 that follows [M0 table 16]."""

    newer_functions: str = choice(
        'known',
        'refused',
        'silent',
        text='how drives treat functions 17, 23 and 43, which older ones do not have',
    )
    #: What is kept starts the motor by itself when the fault is over; what is dropped, also by an
    #: acknowledgement that was given meanwhile, needs a new run command [C98]. A fault that the
    #: drive ends by itself starts the motor in either case: that is what RstDly and ErrCnt are for.
    #: So do the terminals, whose RUN stands. With DriveControl the G2's state machine decides.
    run_command_in_fault: str = choice(
        'drops',
        'keeps',
        text='what an acknowledged fault does to a run command; others than a G2 keep it',
    )
    #: In whatever protocol: all but DriveControl and MODE = Stop in a serial fault, or the run
    #: command [C98]. Classic refuses all whatever this says [M0 §6.1.5].
    refuses_in_fault: str = choice(
        'nothing',
        'all',
        'scmd',
        text='what is refused while a fault is active; on Classic always all',
    )
    #: While MODE is Inhibit [C101].
    stop_in_tuning: str = choice(
        'taken', 'refused', text='whether SCMD = Stop ends a tuning, or is refused until it is over'
    )
    #: [C112]
    tuning_ends_in: str = choice(
        'code',
        'standby',
        text='what a tuning that succeeds ends in: a code of success, or standby',
    )
    commands: str = choice(
        'edges',
        'levels',
        text='on telegram 1: a command counts when its bit rises, or as long as it stands',
    )


class SinusControlUnit(ControlUnit):
    """
    Takes the commands of a Sinus.

    :param rules: gives how it takes its line by a protocol.

    :ivar source: who commands.
    :ivar scmd: the run command that stands, or Stop. It stands through a lost RUN input, so the
        motor starts by itself when that is over; through a fault as ``variant`` says.
    :ivar by_fieldbus: the bus that commands is a fieldbus, to the older firmware [C3].
    :ivar fieldbus: the telegrams of a fieldbus module, where it has one.
    :ivar ack_reads: how often 02A4h or E00E8 was read, which acknowledges.
    :ivar sio_err_reads: how often SioErr was read, which clears it and Sio Fail.
    :ivar mode_ext_writes: how often MODE = 2 was written, which may start the motor.
    """

    #: The set-point of each control mode, by the code of control.mode.
    setpoint_of: ClassVar[Mapping[int, str]]
    #: InvSt while the start is delayed.
    delayed: ClassVar[int]
    #: The run command of this family, and the codes that it takes.
    run_command: ClassVar[str]
    run_codes: ClassVar[Collection[int]]
    line_settings = LINE_SETTINGS
    keys = tuple(KEYS)

    faults: SinusFaults
    variant: SinusVariant
    scmd: int

    def __init__(
        self,
        memory: Memory,
        address: int,
        variant: SinusVariant,
        faults: SinusFaults,
        rules: Rules = lambda protocol: LineRules(),
    ) -> None:
        super().__init__(memory, address, variant, faults)
        memory.set('serial.address', address)
        self.serial = SerialSide(memory, rules)
        self.source = Source.STOP
        self.scmd = _STOP
        self.by_fieldbus = False
        self.ack_reads = 0
        self.sio_err_reads = 0
        self.mode_ext_writes = 0
        self.fieldbus = FieldbusWatch()
        self._telegram: int | None = None
        #: Seconds of RunDly left; None while no run command stands.
        self._delay_left: float | None = None

    # ---- who commands ----

    def restart(self) -> None:
        """Begin as after power-on: without control. Set-points are in the memory and stay."""
        self.initialised = False
        self._forget_fieldbus()
        self.hand_control_to(Source.STOP)

    def boot(self) -> None:
        """End the self-test after power-on; AutoStart hands control to the terminals."""
        self.serial.initialise()
        super().boot()
        if self.memory.raw('control.auto_start'):
            self.hand_control_to(Source.EXT)

    def hand_control_to(self, source: Source) -> None:
        """Hand control over; a run command that stood is forgotten."""
        self.source = source
        self.scmd = _STOP
        self._delay_left = None

    def press(self, key: str) -> None:
        """Press one of :data:`KEYS`; start is the keypad's own run command."""
        self.hand_control_to(KEYS[key])
        self.settle()

    @property
    @abc.abstractmethod
    def mode(self) -> int:
        """What MODE reads."""

    @property
    def on_bus(self) -> bool:
        """Whether the bus commands, by one way or the other."""
        return self.source in (Source.SCMD, Source.CONTROL_WORD)

    @property
    def setpoint_key(self) -> str:
        """The key of the set-point that the control mode takes."""
        return self.setpoint_of[self.memory.raw('control.mode')]

    # ---- the bus ----

    def write(self, key: str, raw: int) -> bool:
        """Carry out MODE, the run command or the control word."""
        if key == 'fieldbus.mode':
            self._write_mode(raw)
            self.mode_ext_writes += raw == _MODE_TERMINALS
            self.note_frame()
        elif key == self.run_command:
            self._write_scmd(raw)
        elif key == 'fieldbus.drive_control':
            self._write_control(raw)
        else:
            return False
        return True

    def read(self, key: str) -> int | None:
        """Read what acknowledges: the status at 02A4h every fault but Sio Fail, SioErr that."""
        if key == 'fieldbus.inv_st_with_ack':
            self.ack_reads += 1
            code = self.status_code
            with self._acknowledging():
                self.faults.acknowledge()
            return code
        if key == 'fieldbus.sio_err':
            self.sio_err_reads += 1
            with self._acknowledging():
                flags = self.faults.take_sio_err()
            return flags
        return None

    def show(self, key: str) -> int | None:
        """Return the raw number of MODE, SioErr, the control word or a status."""
        if key in ('fieldbus.inv_st', 'fieldbus.inv_st_with_ack'):
            return self.status_code
        if key == 'fieldbus.sio_err':
            return self.faults.sio_err
        if key == 'fieldbus.mode':
            return self.mode
        if key == 'fieldbus.drive_control':
            return int(self.control_word)
        if key == 'fieldbus.drive_status':
            return int(self.status_word)
        return None

    def validate(self, key: str) -> None:
        """Refuse what the drive does not take while a fault is active."""
        refused = self.variant.refuses_in_fault
        if self.faults and (refused == 'all' or (refused == 'scmd' and key == self.run_command)):
            raise Refused(Reason.STATE, f'fault {self.faults.shown} is active')

    def stored(self, key: str) -> None:
        """Record the motor's data and of the settings of the line."""
        if key.startswith('motor.'):
            self.motor.plate = self.nameplate()
        if key.startswith('serial.'):
            self.serial.changed()

    @abc.abstractmethod
    def _write_mode(self, raw: int) -> None:
        """Hand control over as MODE says."""

    def _write_scmd(self, raw: int) -> None:
        name = self.memory.model[self.run_command].name
        if raw not in self.run_codes:
            raise Refused(Reason.VALUE, f'{name} has no code {raw:#x}')
        self.validate(self.run_command)
        if not self.on_bus:
            raise Refused(Reason.STATE, f'{name} needs MODE = Bus')
        self._command(raw)

    @abc.abstractmethod
    def _command(self, raw: int) -> None:
        """Carry out a run command, or another of its codes."""

    @abc.abstractmethod
    def _write_control(self, raw: int) -> None:
        """Take a control word."""

    @contextlib.contextmanager
    def _acknowledging(self) -> Iterator[None]:
        """Let an acknowledgement have its effect: with the last fault a run command may end."""
        faulted = bool(self.faults)
        yield
        if faulted and not self.faults:
            self.acknowledged()
        self.settle()

    def acknowledged(self) -> None:
        """Record that an acknowledgement ended the last fault."""
        if self.variant.run_command_in_fault == 'drops':
            self._drop_run_command()

    def _drop_run_command(self) -> None:
        """Forget the run command, from any source; the terminals give theirs all the time."""
        self.scmd = _STOP
        if self.source is Source.KEYPAD:
            self.hand_control_to(Source.STOP)

    # ---- the fieldbus ----

    def take_telegram(self, word: int, setpoint: int) -> None:
        """
        Take a control word, as this family has it, and a set-point by telegram 1.

        The word counts when it changes: who takes control away, at the keypad or by MODE, keeps
        it until then.
        """
        self.fieldbus.note_telegram()
        self._take_setpoint(setpoint)
        if word != self._telegram:
            self._telegram = word
            with contextlib.suppress(Refused):
                self._write_control(word)
        self.settle()

    @abc.abstractmethod
    def _take_setpoint(self, setpoint: int) -> None:
        """Take the set-point of a telegram, signed."""

    def _forget_fieldbus(self) -> None:
        self.fieldbus.forget()
        self._telegram = None

    def _miss_fieldbus(self) -> None:
        """Stop where the telegrams have ended: with AutoStop, else it runs on [M0 §5.3.5]."""
        if self._misses_fieldbus and self.fieldbus.silent_for(FIELDBUS_TIME):
            self._forget_fieldbus()
            self.trip(self.faults.fieldbus_lost)

    @property
    def _misses_fieldbus(self) -> bool:
        """Whether missing telegrams have a consequence."""
        commands = self.source is Source.CONTROL_WORD and self.fieldbus.active
        return commands and bool(self.memory.raw('serial.auto_stop'))

    # ---- the line ----

    @property
    def address(self) -> int:
        """The address that is in effect."""
        return self.serial.address

    def set_to(self, lines: Sequence[tuple[str, Timing]]) -> None:
        """Configure the serial settings for ``lines[0]``; answer on all of them."""
        self.serial.set_to(lines)

    def hears(self, protocol: str, timing: Timing) -> bool:
        """Whether it is set to this protocol, speed and format."""
        return self.serial.hears(protocol, timing)

    def note_frame(self) -> None:
        """Record a valid frame: the bus is alive."""
        self.serial.note_frame()

    def serial_error(self, what: LineError) -> None:
        """
        Note what went wrong on the line; a serial fault if the bus has control [M0 §6.1.5].

        That another fault blocks the drive is no fault of its own.
        """
        self.faults.sio_err |= what
        if self.bus_controls and what & ~LineError.BLOCKED:
            self.trip(self.faults.line_lost)
            self.settle()

    @property
    def bus_controls(self) -> bool:
        """Whether MODE reads Bus."""
        return self.mode == _MODE_BUS

    # ---- what it does ----

    def trip(self, code: int, *, cause_present: bool = False) -> None:
        """Let a fault happen; those of the line take control away."""
        super().trip(code, cause_present=cause_present)
        if code in self.faults.of_the_line:
            self.hand_control_to(Source.STOP)

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass, of silence too."""
        self.fieldbus.wait(dt)
        self._miss_fieldbus()
        self.serial.advance(dt)
        if self.serial.timed_out:
            self.serial_error(LineError.TIMEOUT)
        if self._delay_left is not None:
            self._delay_left = max(0.0, self._delay_left - dt)

    @property
    def settled(self) -> bool:
        """Whether nothing happens by the clock alone: no start delay, no watch on silence."""
        watched = self.serial.watches and self.bus_controls
        return not self._delay_left and not watched and not self._misses_fieldbus

    def nameplate(self) -> Nameplate:
        """Return the motor's data as the parameters say."""
        number = self.memory.number
        return Nameplate(
            power=1000 * number('motor.p_nom'),
            voltage=number('motor.u_nom'),
            frequency=number('motor.f_nom'),
            speed=number('motor.n_nom'),
            current=number('motor.i_nom'),
            magnetising=number('motor.i_magn'),
            limit=number('motor.i_limt'),
            resistance=number('motor.r_stat'),
        )

    @property
    def preparing(self) -> bool:
        """Whether it shows standby although the start has begun."""
        return False

    @property
    @abc.abstractmethod
    def stopping(self) -> bool:
        """Whether the motor is on its way to a stop."""

    @abc.abstractmethod
    def _commanded(self) -> bool:
        """Whether a run command stands that is not the keypad's."""

    @property
    def _wanted(self) -> bool:
        """Whether a run command stands, and RUN allows it."""
        return self.source is Source.KEYPAD or (self.run_input and self._commanded())

    def _keep_delay(self) -> None:
        """Start RunDly when a run is wanted, forget it when not."""
        if self.faults or not self._wanted:
            self._delay_left = None
        elif self._delay_left is None:
            self._delay_left = self.memory.number('control.run_dly')

    @property
    def _brakes(self) -> bool:
        """Whether a stop goes down the ramp: StMode."""
        return bool(self.memory.raw('control.st_mode'))

    def _ramps(self) -> None:
        self.motor.accel = max(self.memory.number('control.accel'), 0.01)
        self.motor.retard = max(self.memory.number('control.retard'), 0.01)

    # ---- what it shows ----

    @property
    @abc.abstractmethod
    def control_word(self) -> int:
        """The control word, as it is read."""

    @property
    @abc.abstractmethod
    def status_word(self) -> int:
        """The status word."""

    @property
    @abc.abstractmethod
    def state(self) -> str:
        """The state that the drive is in, by its name."""

    @property
    def status_code(self) -> int:
        """The inverter status: the first fault or alarm, else what it does."""
        return self.faults.shown or self.inv_st

    @property
    def status_text(self) -> str:
        """What the display says."""
        return self.memory.model.status_code(self.status_code).shown(self.memory.version)

    @property
    def inv_st(self) -> int:
        """The inverter status while no fault is active ([M0 table 19], [M1])."""
        codes = _CODES[self.source]
        standby, running, faster, slower = (
            _FIELDBUS_CODES if self.by_fieldbus and codes is _BUS_CODES else codes
        )
        motor = self.motor
        if self._delay_left:
            return self.delayed
        if not motor.driven or self.preparing:
            return standby
        if motor.chopper:
            return _BRAKE_CHOPPER
        if motor.limited:
            return _CURRENT_LIMIT
        if self.stopping or motor.trend < 0:
            return slower
        return faster if motor.trend > 0 else running

    def report(self) -> dict[str, Any]:
        """Return what a Sinus shows, by the names of its manuals."""
        return {
            'mode': int(self.mode),
            'source': self.source.value,
            'scmd': int(self.scmd),
            'inv_st': self.status_code,
            'inv_st_text': self.status_text,
            'state': self.state,
            'control_word': int(self.control_word),
            'status_word': int(self.status_word),
            'setpoint': self.memory.get(self.setpoint_key),
            'setpoint_raw': self.memory.raw(self.setpoint_key),
            'setpoint_key': self.setpoint_key,
            'sio_err': int(self.faults.sio_err),
            'ack_reads': self.ack_reads,
            'sio_err_reads': self.sio_err_reads,
            'mode_ext_writes': self.mode_ext_writes,
        }
