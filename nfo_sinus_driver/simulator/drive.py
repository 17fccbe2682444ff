# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
A whole NFO Sinus made of software: parameters, commands, state machine, motor, faults.

It knows parameters by catalog key and raw numbers, and time only as it is told of it; which
protocol asks is not its business. Where the manuals leave the drive's behaviour open, it does
what makes a careless driver fail: a run command stands through a lost RUN input, a set-point
through a power cycle, and MODE = Ext or Auto starts the motor; or what its variant says.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import contextlib
from fractions import Fraction

from nfo_sinus_driver.catalog import Access
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.catalog import to_bytes
from nfo_sinus_driver.catalog import to_words
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.simulator import identification
from nfo_sinus_driver.simulator.control_source import Source
from nfo_sinus_driver.simulator.faults import REFUSALS
from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.faults import SioErr
from nfo_sinus_driver.simulator.firmware import firmware_of
from nfo_sinus_driver.simulator.firmware import version
from nfo_sinus_driver.simulator.identification import KNOWN
from nfo_sinus_driver.simulator.machine import machine_of
from nfo_sinus_driver.simulator.measured import Counters
from nfo_sinus_driver.simulator.measured import measure
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.memory import RegisterMap
from nfo_sinus_driver.simulator.memory import home
from nfo_sinus_driver.simulator.motor import Motor
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused
from nfo_sinus_driver.simulator.runner import Runner
from nfo_sinus_driver.simulator.runner import nameplate
from nfo_sinus_driver.simulator.runner_g2 import G2Runner
from nfo_sinus_driver.simulator.runner_optimal import OptimalRunner
from nfo_sinus_driver.simulator.self_restart import SelfRestart
from nfo_sinus_driver.simulator.serial_side import SerialSide
from nfo_sinus_driver.simulator.variant import Variant

#: What a factory reset leaves as it is: without them the drive would not hear the line any more.
LINE_SETTINGS = frozenset(
    {'serial.bus_type', 'serial.address', 'serial.si_baud', 'serial.si_prot'}
)
#: Who runs the motor, by drive family: what one does its own way.
_RUNNERS: Mapping[str, type[Runner]] = {'sinus_g2': G2Runner, 'sinus_optimal': OptimalRunner}
#: By these the bus takes control.
COMMANDS = frozenset({'fieldbus.mode', 'fieldbus.drive_control'})
#: The longest step of model time (s) while something moves, and while nothing does.
_STEP = 0.005
_IDLE_STEP = 0.1


class SimulatedDrive:
    """
    One simulated drive.

    :param model: the drive family, one of the catalog's.
    :param address: its address on the line, 1 to 247.
    :param settings: parameters other than factory, in engineering units, by key.
    :param run_input: whether the digital input RUN is active.
    :param boot_time: how long it is silent after the mains come back (s).
    :param serial_number: at most 16 characters; by default one for each address.
    :param newer_functions: how it treats functions 17, 23 and 43: ``known``, ``refused`` as by
        older firmware, or ``silent``.
    :param lenient: a Classic message that it refuses is no serial fault.
    :param variant: what it does where the manuals leave it open; by default as its family does.
    :raises ValueError: an unknown model or parameter, or a value that the drive would refuse.

    :ivar settings: the keys of the parameters that live in EEPROM: no set-points, no commands.
    :ivar firmware: what its firmware does its own way.
    :ivar tears: how many times yet a counter goes on between the readings of its two halves.
    :ivar step: the longest step of model time while something moves (s).
    :ivar time: model time since the start (s).
    :ivar identification: the objects of Read Device Identification, by number [M0 §6.2.4].
    :ivar writes: how often the bus wrote each parameter that lives in EEPROM, by key.
    :ivar command_writes: how often it wrote each set-point or command, by key.
    :ivar ack_reads: how often 02A4h or E00E8 was read, which acknowledges.
    :ivar sio_err_reads: how often SioErr was read, which clears it and Sio Fail.
    :ivar mode_ext_writes: how often MODE = 2 was written, which may start the motor.
    """

    def __init__(
        self,
        model: str = 'sinus_g2',
        address: int = 1,
        *,
        settings: Mapping[str, Value] | None = None,
        run_input: bool = True,
        boot_time: float = 2.0,
        serial_number: str | None = None,
        newer_functions: str = KNOWN,
        lenient: bool = False,
        variant: Variant | None = None,
    ) -> None:
        self.model = load_family(model)
        machine = machine_of(self.model)
        self._setpoints = frozenset(_RUNNERS[model].setpoint_of.values())
        self.settings = frozenset(
            key
            for key, parameter in machine.items()
            if parameter.access is Access.READ_WRITE
            and not key.startswith('fieldbus.')
            and key not in self._setpoints
        )
        self.memory = Memory(machine, {**(settings or {}), 'serial.address': address})
        self.firmware = firmware_of(self.memory)
        self.faults = Faults(self.model, self.firmware.log_size)
        self.self_restart = SelfRestart(self.memory, self.faults)
        self.motor = Motor(nameplate(self.memory))
        self.counters = Counters()
        self.runner = _RUNNERS[model](self.memory, self.motor, self.faults, self.counters)
        self.runner.variant = variant or self.runner.usual
        self.runner.run_input = run_input
        self.serial_number = identification.serial_number(serial_number, address)
        self.identification = identification.device_objects(self.memory)
        self.newer_functions = newer_functions
        self.boot_time = boot_time
        self.writes: Counter[str] = Counter()
        self.command_writes: Counter[str] = Counter()
        self.ack_reads = 0
        self.sio_err_reads = 0
        self.mode_ext_writes = 0
        self.tears = 0
        self.step = _STEP
        self.time = 0.0
        self._lenient = lenient
        self._registers = RegisterMap(self.model)
        self._origin: float | None = None
        self._boot_left = 0.0
        self._silent_left = 0.0
        self.serial = SerialSide(self.memory)
        self._booted()

    # ---- time ----

    def advance(self, dt: float) -> None:
        """Let ``dt`` seconds of model time pass."""
        while dt > 1e-9:
            resting = self._resting
            step = min(dt, _IDLE_STEP if resting else self.step)
            self._pass(step, resting)
            dt -= step

    def advance_to(self, now: float) -> None:
        """Catch up with the caller's clock (s); the first call only sets the clock."""
        if self._origin is None:
            self._origin = now - self.time
        self.advance(now - self._origin - self.time)

    # ---- the bus ----

    @property
    def listening(self) -> bool:
        """Whether it hears the line and answers: not while it boots or is held silent."""
        return self._boot_left <= 0 and self._silent_left <= 0

    def heard(self) -> None:
        """Take note that a valid frame addressed to this drive arrived."""
        self.serial.heard()

    def read(self, register: int, count: int) -> tuple[int, ...]:
        """
        Read the parameter at a Modbus register, as words, the low one first.

        :raises Refused: no such parameter, or not its length.
        """
        entry = self._registers.log_entry(register, count)
        if entry is not None:
            log = self.model.error_logs['modbus']
            return to_words(log.codec.encode(self.faults.log_word(entry)))
        parameter = self._registers.find(register, count)
        raw = self.read_raw(parameter.key)
        return to_words(parameter.at('modbus').number.encode(raw))

    def write(self, register: int, words: Sequence[int]) -> None:
        """
        Write the parameter at a Modbus register.

        :raises Refused: as the reason says.
        """
        parameter = self._registers.find(register, len(words))
        raw = parameter.at('modbus').number.decode(to_bytes(words))
        self.write_raw(parameter.key, raw)
        if parameter.key in COMMANDS:
            self.runner.by_fieldbus = self.firmware.own_bus_codes

    def write_and_read(
        self, register: int, words: Sequence[int], source: int, count: int
    ) -> tuple[int, ...]:
        """
        Write the parameter at ``register``, then read the one at ``source``.

        :raises Refused: as the reason says; nothing was written if there is none at ``source``.
        """
        self._registers.find(source, count)
        self.write(register, words)
        return self.read(source, count)

    def read_raw(self, key: str) -> int:
        """
        Read a parameter as the bus does, a number of the memory, side effects included.

        :raises Refused: ADDRESS; it can only be written.
        """
        if self.memory.model[key].access is Access.WRITE:
            raise Refused(Reason.ADDRESS, f'{key} cannot be read')
        if key == 'fieldbus.inv_st_with_ack':
            self.ack_reads += 1
            code = self.inv_st
            with self._acknowledging():
                self.faults.acknowledge()
            return code
        if key == 'fieldbus.sio_err':
            self.sio_err_reads += 1
            with self._acknowledging():
                flags = self.faults.take_sio_err()
            return flags
        return self._peek(key)

    def write_raw(self, key: str, raw: int) -> None:
        """
        Write a parameter as the bus does, a number of the memory.

        :raises Refused: ADDRESS when it can only be read, VALUE or STATE.
        """
        if key == 'fieldbus.setpoint':
            key = self.runner.setpoint_key
        parameter = self.memory.model[key]
        if parameter.access not in (Access.WRITE, Access.READ_WRITE):
            raise Refused(Reason.ADDRESS, f'{key} cannot be written')
        Memory.check(parameter, raw)
        if not self.runner.write(key, raw):
            self.runner.refuse_when_faulted(key)
            if parameter.stopped and (self.motor.driven or self.motor.turning):
                raise Refused(Reason.STATE, f'{key} changes only while the motor stands')
            self._store(key, raw)
        elif key == 'fieldbus.mode':
            self.mode_ext_writes += raw == Mode.EXT
            self.heard()
        counter = self.writes if key in self.settings else self.command_writes
        counter[key] += 1
        self._settle()

    def serial_error(self, what: SioErr) -> None:
        """
        Note what went wrong on the line; a serial fault if the bus has control [M0 §6.1.5].

        That another fault blocks the drive is no fault of its own.
        """
        self.faults.sio_err |= what
        harmless = REFUSALS if self._lenient else SioErr.BLOCKED
        if self._bus_controls and what & ~harmless:
            self.trip(self.faults.line_lost)

    # ---- what happens to it ----

    def trip(self, code: int, *, cause_present: bool = False) -> None:
        """
        Let a fault happen: the motor coasts, and it wants acknowledging.

        :param cause_present: the cause lasts, so that it cannot be acknowledged yet.
        :raises ValueError: the model has no such fault.
        """
        self.faults.trip(code, self.counters.op_time, cause_present=cause_present)
        self.self_restart.tripped(code)
        if code in self.faults.of_the_line:
            self.runner.take(Source.STOP)
        self._settle()

    def end_fault_causes(self) -> None:
        """Take away the causes of all faults; they still want acknowledging."""
        self.faults.end_causes()

    def set_run_input(self, active: bool) -> None:
        """Switch the digital input RUN."""
        self.runner.run_input = active
        self._settle()

    def press_stop(self) -> None:
        """Press <STOP>: the motor is released and control goes to the keypad [M0 §5.2]."""
        self.runner.take(Source.STOP)
        self._settle()

    def press_ext(self) -> None:
        """Press <SHIFT+STOP>: control goes to the terminals, which may start the motor."""
        self.runner.take(Source.EXT)
        self._settle()

    def press_start(self) -> None:
        """Start the motor from the keypad."""
        self.runner.take(Source.KEYPAD)
        self._settle()

    def set_from_keypad(self, key: str, value: Value) -> None:
        """
        Change a parameter at the keypad, in engineering units.

        :raises ValueError: an unknown key or a value that the drive would refuse.
        """
        if key not in self.settings and key not in self._setpoints:
            raise ValueError(f'{key} cannot be changed at the keypad')
        self.memory.set(key, value)
        self._store(key, self.memory.raw(key))
        self._settle()

    def factory_reset(self) -> None:
        """Give the parameters their factory values, but those of the line, so that it answers."""
        for key in self.settings - LINE_SETTINGS:
            self._store(key, self.memory.factory_raw(key))
        self._settle()

    def power_cycle(self, boot_time: float | None = None) -> None:
        """Take the mains away and give them back: silent for the boot time (s), then anew."""
        self._boot_left = self.boot_time if boot_time is None else boot_time
        self.motor.release(at_once=True)
        self.motor.dc_link = 0.0
        self.runner.restart()
        if self._boot_left <= 0:
            self._booted()

    def silence(self, seconds: float) -> None:
        """Neither hear nor answer for a while, as with a loose connector; the motor runs on."""
        self._silent_left = seconds

    # ---- what it shows ----

    @property
    def address(self) -> int:
        """The address that is in effect."""
        return self.serial.address

    @property
    def version(self) -> Fraction | None:
        """SWVer; ``None`` of a drive that has none."""
        return version(self.memory)

    @property
    def inv_st_text(self) -> str:
        """What the display says."""
        return self.model.status_code(self.inv_st).shown(self.version)

    @property
    def inv_st(self) -> int:
        """The inverter status, without acknowledging anything [M0 table 19]."""
        return self.faults.shown or self.runner.inv_st

    # ---- inside ----

    def _peek(self, key: str) -> int:
        """Read a parameter without side effects."""
        if key == 'fieldbus.setpoint':
            key = self.runner.setpoint_key
        if key in ('fieldbus.inv_st', 'fieldbus.inv_st_with_ack'):
            return self.inv_st
        if key == 'fieldbus.sio_err':
            return self.faults.sio_err
        parameter = self.memory.model[key]
        shown = measure(parameter, home(parameter), self.motor, self.counters)
        if shown is None:
            shown = self.runner.show(key)
        return self.memory.raw(key) if shown is None else shown

    def peek(self, key: str) -> Value:
        """Return a parameter in engineering units, without side effects."""
        return Memory.show(self.memory.model[key], self._peek(key))

    @contextlib.contextmanager
    def _acknowledging(self) -> Iterator[None]:
        """Let an acknowledgement have its effect: with the last fault a run command may end."""
        faulted = bool(self.faults)
        yield
        if faulted and not self.faults:
            self.runner.acknowledged()
        self._settle()

    def _store(self, key: str, raw: int) -> None:
        self.memory.put(key, raw)
        if key.startswith('motor.'):
            self.motor.plate = nameplate(self.memory)
        if key.startswith('serial.'):
            self.serial.changed()

    def _booted(self) -> None:
        self._boot_left = 0.0
        self.faults.restart()
        self.serial.initialise()
        self.runner.restart()
        self.runner.initialised = True
        if self.memory.raw('control.auto_start'):
            self.runner.take(Source.EXT)
        self.heard()
        self._settle()

    @property
    def _resting(self) -> bool:
        timers = self._boot_left > 0 or self._silent_left > 0 or self.runner.waiting
        timers = timers or self.self_restart.waiting
        watched = self.serial.watches and self._bus_controls
        return self.motor.settled and self.runner.settled and not timers and not watched

    @property
    def _bus_controls(self) -> bool:
        return self.runner.mode == Mode.BUS

    def _pass(self, dt: float, resting: bool) -> None:
        self.time += dt
        self._silent_left = max(0.0, self._silent_left - dt)
        if self._boot_left > 0:
            self.motor.advance(dt)
            self._boot_left -= dt
            if self._boot_left <= 1e-9:
                self._booted()
            return
        self.serial.advance(dt)
        if self.serial.timed_out:
            self.serial_error(SioErr.TIMEOUT)
        self.runner.wait(dt)
        self.self_restart.wait(dt, driven=self.motor.driven, voltage=self.motor.voltage_on)
        self.motor.advance(dt)
        self.counters.advance(dt, self.motor)
        if not resting:
            self._settle()

    def _settle(self) -> None:
        self.runner.settle()
