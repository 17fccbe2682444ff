# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the simulator has to know of a Sinus H, its telegrams and its PNUs [M3 §7, §8]."""

from __future__ import annotations

from collections.abc import Callable

from nfo_sinus_driver.simulator import telegram1
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.memory import Refused
from nfo_sinus_driver.simulator.parameter_channel import (
    Entries,
    ParameterChannel,
    ParameterEntry,
    read_only,
)
from nfo_sinus_driver.simulator.sinus_h import keypad
from nfo_sinus_driver.simulator.sinus_h.control_unit import SinusHControlUnit, SinusHVariant
from nfo_sinus_driver.simulator.telegram1 import Stw1, Zsw1, clipped


class Server(telegram1.Server):
    """
    The fieldbus side of one Sinus H.

    With bit 0 clear alone it would stay in operation, and with bit 10 clear nothing counts [C107].
    """

    lost_clears = int(Stw1.ON | Stw1.NO_QUICK_STOP)
    lost_sets = int(Stw1.CONTROL_BY_PLC)

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, SinusHControlUnit)
        self._unit = drive.control_unit
        self._drive = drive
        #: PNU 1000 to 1003: address, data, command, acknowledge.
        self._by_address = [0, 0, 0, 0]
        self.parameters = ParameterChannel(self._profile())

    @property
    def online(self) -> bool:
        """Whether the module is set to the telegram that its master exchanges (COM-22)."""
        return self._vendor is self.longer

    @property
    def _vendor(self) -> bool:
        return self._unit.memory.raw(keypad.TELEGRAM) != keypad.STANDARD_TELEGRAM

    @property
    def more(self) -> tuple[int, int, int]:
        """Alarm information, torque (0.1 %) and current (0.1 A) [M3 §7.2.5 to §7.2.7]."""
        unit = self._unit
        # which bit of it a trip sets is not printed [C69]
        alarms = (1 if unit.faults else 0) | (_WARNING if unit.status_word & Zsw1.WARNING else 0)
        torque, current = clipped(1000 * unit.motor.torque), clipped(10 * unit.motor.current)
        return alarms, torque & 0xFFFF, current & 0xFFFF

    def exchange(self, stw1: int, setpoint: int) -> tuple[int, int]:
        """Take control word and set-point; return status word and actual value."""
        self._unit.take_telegram(Stw1(stw1), setpoint)
        return int(self._unit.status_word), clipped(self._unit.actual)

    def _profile(self) -> Entries:
        """Return the parameters of PROFIdrive [M3 §8]."""
        unit = self._unit
        readable: dict[int, tuple[int | Callable[[], int], ...]] = {
            922: (lambda: _VENDOR_TELEGRAM if self._vendor else 1,),
            944: (lambda: len(unit.faults.log),),
            947: tuple(self._message(index) for index in range(_MESSAGES)),
            953: (lambda: int(bool(unit.status_word & Zsw1.WARNING)),),
            964: (849, 1, 102, 2015, 2512),
            965: (0x0328,),
            967: (lambda: int(unit.word),),
            968: (lambda: int(unit.status_word),),
        }
        registers = {(1000 + number, 0): self._register(number) for number in range(4)}
        reset = ParameterEntry(lambda: 0, self._reset)
        return {**read_only(readable), **registers, (972, 0): reset}

    def _register(self, number: int) -> ParameterEntry:
        """Return one of PNU 1000 to 1003 [M3 §10]."""

        def write(word: int) -> None:
            self._by_address[number] = word
            if number == _COMMAND and word:
                self._by_address[_ACKNOWLEDGE] = _DONE if self._carry_out(word) else _FAILED

        return ParameterEntry(lambda: self._by_address[number], write)

    def _carry_out(self, command: int) -> bool:
        """Write or read by address; false if the drive has none such, or does not take it."""
        address, data = self._by_address[:2]
        key = keypad.KEYS.get(address)
        if key is None:
            return False
        try:
            if command == _WRITE:
                self._drive.write_raw(key, data)
            else:
                self._by_address[1] = self._drive.read_raw(key)
        except Refused:
            return False
        return True

    def _message(self, index: int) -> Callable[[], int]:
        """Return what reads a fault message of PNU 947 [M3 §9, C68]."""

        def read() -> int:
            faults = self._unit.faults
            active = faults.codes
            past = [[entry.code] for entry in faults.log[len(active) :]]
            situation, message = divmod(index, _MESSAGES // 8)
            messages = [active, *past][situation : situation + 1]
            return dict(enumerate(messages[0] if messages else ())).get(message, 0)

        return read

    def _reset(self, value: int) -> None:
        """Begin as after power-on, by PNU 972 = 1."""
        if value == 1:
            self._unit.restart()
            self._unit.initialised = True


#: PNU 1002 and 1003 among the four; what writes, and what 1003 says.
_COMMAND, _ACKNOWLEDGE = 2, 3
_WRITE, _DONE, _FAILED = 1, 1, 2
#: What PNU 922 says of the longer telegram, and the bit of the alarm information for warnings.
_VENDOR_TELEGRAM = 100
_WARNING = 1 << 4
#: Words of PNU 947: eight situations of eight messages.
_MESSAGES = 64


FAMILY = SimulatedFamily(
    control_unit=SinusHControlUnit,
    variant=SinusHVariant,
    factory=keypad.FACTORY,
    machine=keypad.with_keypad,
    servers={'telegram1': Server},
)
