# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The serial interface of a Sinus: settings in effect, the watch on silence, its own faults."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from nfo_sinus_driver.catalog import Family, Meaning
from nfo_sinus_driver.simulator.classic import LineError
from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.timing import Timing

#: The codes of BusType, SiBaud and SiProt [M0 table 4].
BUS_TYPES: Mapping[str, int] = {'classic': 1, 'modbus_ascii': 2, 'modbus_rtu': 3, 'canopen': 4}
#: What a module speaks in place of the drive: SiBaud and SiProt have no codes for its line.
OF_A_MODULE = 'canopen'
BAUD_CODES = {1200: 16, 2400: 32, 4800: 64, 9600: 128, 19200: 256, 38400: 512, 57600: 768}
FORMAT_CODES = {'7E1': 0, '7O1': 1, '7N2': 2, '8E1': 4, '8O1': 5, '8N2': 6}
#: By these it hears the line.
LINE_SETTINGS = frozenset({'serial.bus_type', 'serial.address', 'serial.si_baud', 'serial.si_prot'})


@dataclass(frozen=True)
class LineRules:
    """
    How a drive takes its line by one protocol.

    :ivar formats: character formats by their names, and their codes of SiProt.
    :ivar most_baud: the highest baud rate.
    :ivar at_once: settings of the line count as soon as they are written.
    """

    formats: Mapping[str, int] = field(default_factory=lambda: FORMAT_CODES)
    most_baud: int = 57600
    at_once: bool = False

    def check(self, protocol: str, timing: Timing) -> None:
        """Look whether a drive can be set to a line, or a ValueError."""
        if timing.baud not in BAUD_CODES:
            choices = ', '.join(map(str, BAUD_CODES))
            raise ValueError(f'{timing.baud} baud: choose one of {choices}')
        if timing.char_format not in self.formats:
            formats = ', '.join(self.formats)
            raise ValueError(f'{timing.char_format}: this drive has {formats} on {protocol}')
        if timing.baud > self.most_baud:
            raise ValueError(f'{timing.baud} baud: this drive has {self.most_baud} at most')


#: The rules of a drive by the protocol that it speaks.
Rules = Callable[[str], LineRules]


class SerialSide:
    """
    What the group Serial does.

    A change of address, speed or format takes effect at the next power-on, or at once with
    AutoReset [M0 §5.3.4]; on older firmware always at once [C7].

    :ivar address: the address in effect.
    :ivar baud: code of SiBaud in effect.
    :ivar char_format: code of SiProt in effect.
    :ivar bus_type: code of BusType in effect.
    """

    address: int
    baud: int
    char_format: int
    bus_type: int

    def __init__(self, memory: Memory, rules: Rules) -> None:
        self._memory = memory
        self._rules = rules
        self._unheard = 0.0
        self.initialise()

    def initialise(self) -> None:
        """Put the settings into effect, as at power-on."""
        self.address = self._memory.raw('serial.address')
        self.baud = self._memory.raw('serial.si_baud')
        self.char_format = self._memory.raw('serial.si_prot')
        self.bus_type = self._memory.raw('serial.bus_type')

    def set_to(self, lines: Sequence[tuple[str, Timing]]) -> None:
        """Set the drive to the first of some lines, but for what was set otherwise."""
        if 'serial.address' in self._memory.given:
            raise ValueError('serial.address: give the address with --address')
        for spoken, timing in lines:
            if spoken != OF_A_MODULE:
                self._rules(spoken).check(spoken, timing)
        spoken, timing = lines[0]
        codes = {'serial.bus_type': BUS_TYPES[spoken]}
        if spoken != OF_A_MODULE:
            codes['serial.si_baud'] = BAUD_CODES[timing.baud]
            codes['serial.si_prot'] = self._rules(spoken).formats[timing.char_format]
        for key in codes.keys() - self._memory.given:
            self._memory.put(key, codes[key])
        self.initialise()

    def changed(self) -> None:
        """Record that one of the settings was written."""
        spoken = next((name for name, code in BUS_TYPES.items() if code == self.bus_type), '')
        if self._rules(spoken).at_once or self._memory.raw('serial.auto_reset'):
            self.initialise()

    def hears(self, protocol: str, timing: Timing) -> bool:
        """Whether it is set to this protocol, speed and format."""
        if protocol == OF_A_MODULE:
            return self.bus_type == BUS_TYPES[protocol]
        return (
            self.bus_type == BUS_TYPES[protocol]
            and self.baud == BAUD_CODES[timing.baud]
            and self.char_format == self._rules(protocol).formats.get(timing.char_format)
        )

    def note_frame(self) -> None:
        """Record a valid frame: the bus is alive."""
        self._unheard = 0.0

    def advance(self, dt: float) -> None:
        """Let ``dt`` seconds of silence pass."""
        self._unheard += dt

    @property
    def watches(self) -> bool:
        """Whether silence has a consequence: only with AutoStop [C91], and with a SioTot."""
        memory = self._memory
        return bool(memory.raw('serial.auto_stop') and memory.raw('serial.sio_tot'))

    @property
    def timed_out(self) -> bool:
        """Whether the silence has lasted longer than SioTot."""
        return self.watches and self._unheard >= self._memory.number('serial.sio_tot')


class SinusFaults(Faults):
    """
    The faults of a Sinus.

    :param log_size: entries that the error log holds [C4].

    :ivar sio_err: what went wrong on the line since it was last read.
    """

    def __init__(self, model: Family, *, log_size: int = 32) -> None:
        (lost,) = (code.code for code in model.codes(Meaning.SERIAL_FAILURE))
        # where SioErr can be read, that is how it is acknowledged [C42]
        kept = {lost} if 'fieldbus.sio_err' in model else set()
        super().__init__(model, log_size=log_size, kept=kept)
        #: What a silent or damaged line leads to.
        self.line_lost = lost
        #: What a fieldbus without telegrams leads to.
        (self.fieldbus_lost,) = (code.code for code in model.codes(Meaning.FIELDBUS_FAILURE))
        #: Faults of the serial channel: they end fieldbus control, and MODE = Stop acknowledges
        #: them [M0 §6.1.5].
        self.of_the_line = {lost, self.fieldbus_lost}
        self.sio_err = LineError(0)

    @property
    def serial(self) -> bool:
        """Whether a fault of the serial channel is active."""
        return not self.of_the_line.isdisjoint(self._present)

    def acknowledge_serial(self) -> None:
        """Acknowledge the serial channel's faults, as MODE = Stop does [M0 §6.1.5]."""
        self.sio_err = LineError(0)
        self._present = {
            code: cause for code, cause in self._present.items() if code not in self.of_the_line
        }

    def take_sio_err(self) -> LineError:
        """Return the flags of SioErr and clear them, and Sio Fail unless its cause lasts."""
        flags, self.sio_err = self.sio_err, LineError(0)
        if not self._present.get(self.line_lost, True):
            del self._present[self.line_lost]
        return flags

    def restart(self) -> None:
        """Forget what a power cycle makes forget."""
        self.sio_err = LineError(0)
        super().restart()
