# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What one drive has answered; nothing is written, nor read what has an effect."""

from __future__ import annotations

import abc
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
import math
import statistics
import struct
import time
from typing import ClassVar

from nfo_sinus_driver.catalog import Family, Parameter
from nfo_sinus_driver.cli.check.wire import NAK, Answer, Wire

HOLDING, INPUT = 3, 4
_SPACES = {'register': HOLDING, 'register_16': HOLDING, 'input': INPUT}
#: Of the block of a PLC: how many registers are read of it, of layout 2 as well; flags of +3.
_SHOWN, _SHOWN_OF_2, _LAYOUTS = 5, 8, (1, 2)
_VALID, _MORE_VALID = 1 << 0, 1 << 2
#: Where its parts stand, by their number in the tables: status with flags, actual value, the more.
_PLACES = {0: (0, 3), 1: (1,), 6: (5,), 7: (6,), 8: (7,)}
#: For how long its life counter is watched, s.
_WATCHED = 2.0
#: How often a request is repeated that gets no answer.
_TRIES = 3
#: How many answers are timed, and from how many of each pause.
_TIMED, _OF_EACH_PAUSE = 50, 5
#: The pauses between two requests that are tried, s.
_PAUSES = (0.02, 0.01, 0.005, 0.0035, 0.002, 0.001)


@dataclass(frozen=True)
class Register:
    """
    What came of one parameter.

    :ivar words: raw; ``None``: none.
    :ivar refused_with: the exception code, on Classic NAK, of a MOVITRAC the return code; ``None``:
        it was answered, or nothing came.
    :ivar remark: what is odd in the value.
    """

    key: str
    index: int
    words: tuple[int, ...] | None
    refused_with: int | None
    value: str = ''
    remark: str = ''


@dataclass(frozen=True)
class Timing:
    """
    How soon a drive answers, s.

    :ivar least_pause: the least silence before a request with which each was answered.
    """

    least: float
    median: float
    p99: float
    least_pause: float


class Sight(abc.ABC):
    """
    One drive, looked at, over one of the protocols.

    :cvar addressing: what its parameters have addresses for.
    """

    addressing: ClassVar[str]

    def __init__(self, wire: Wire, model: Family) -> None:
        self.wire = wire
        self.model = model
        self._asked: dict[bytes, Answer] = {}
        #: The requests without an answer, since this was emptied.
        self.missed: list[bytes] = []

    def ask(self, pdu: bytes) -> Answer:
        """Return what a request got, asked once; one without an answer is repeated."""
        if pdu not in self._asked:
            for _ in range(_TRIES):
                self._asked[pdu] = answer = self.wire.ask(pdu)
                if answer.pdu:
                    break
        if not self._asked[pdu].pdu:
            self.missed.append(pdu)
        return self._asked[pdu]

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Those that can be read without an effect."""
        return {
            parameter.key: parameter
            for parameter in self.model.values()
            if parameter.is_readable and self.addressing in parameter.addresses
        }

    @abc.abstractmethod
    def register(self, parameter: Parameter) -> Register:
        """Return what comes of a parameter."""

    @abc.abstractmethod
    def request(self, parameter: Parameter) -> bytes:
        """Return what asks for its first word."""

    def registers(self, step: Callable[[], None] = lambda: None) -> Iterator[Register]:
        """Read every parameter; yield what came of each."""
        for parameter in self.parameters.values():
            step()
            yield self.register(parameter)

    def timing(self, set_gap: Callable[[float], None] | None) -> Timing:
        """Measure how soon reads are answered, and with how short a silence before them."""
        request = self.request(next(iter(self.parameters.values())))
        firsts = sorted(
            answer.first for answer in (self.wire.ask(request) for _ in range(_TIMED))
            if answer.pdu
        )
        least_pause = math.nan
        for pause in _PAUSES if set_gap is not None else ():
            assert set_gap is not None
            set_gap(pause)
            if not all(self.wire.ask(request).pdu for _ in range(_OF_EACH_PAUSE)):
                break
            least_pause = pause
        if set_gap is not None:
            set_gap(_PAUSES[0])
        if not firsts:
            return Timing(math.nan, math.nan, math.nan, least_pause)
        p99 = firsts[math.ceil(0.99 * len(firsts)) - 1]
        return Timing(firsts[0], statistics.median(firsts), p99, least_pause)


class ModbusSight(Sight):
    """A drive, looked at over Modbus."""

    addressing = 'modbus'

    def read(self, register: int, count: int = 1, function: int = HOLDING) -> Answer:
        """Return what a read got."""
        return self.ask(struct.pack('>BHH', function, register, count))

    def words(
        self, register: int, count: int = 1, function: int = HOLDING
    ) -> tuple[int, ...] | None:
        """Return the words of registers, or ``None`` if they were not answered."""
        pdu = self.read(register, count, function).pdu
        right = len(pdu) == 2 + 2 * count and pdu[:2] == bytes((function, 2 * count))
        return struct.unpack(f'>{count}H', pdu[2:]) if right else None

    def word(self, register: int) -> int | None:
        """Return one word, or ``None``."""
        found = self.words(register)
        return found[0] if found else None

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Those that can be read without an effect, in registers."""
        return {
            parameter.key: parameter
            for parameter in self.model.values()
            if parameter.is_readable
            and 'modbus' in parameter.addresses
            and parameter.at('modbus').space in _SPACES
            and parameter.at('modbus').sub_index is None
        }

    def request(self, parameter: Parameter) -> bytes:
        """Return what asks for its first register."""
        address = parameter.at('modbus')
        return struct.pack('>BHH', _SPACES[address.space], address.index, 1)

    def register(self, parameter: Parameter) -> Register:
        """Return what comes of a parameter."""
        address = parameter.at('modbus')
        count, function = address.codec.size // 2, _SPACES[address.space]
        words = self.words(address.index, count, function)
        if words is None:
            refused = self.read(address.index, count, function).refused_with
            return Register(parameter.key, address.index, None, refused)
        value, remark = _means(parameter, 'modbus', struct.pack(f'>{count}H', *words))
        return Register(parameter.key, address.index, words, None, value, remark)


class BlockSight(ModbusSight):
    """
    A drive behind a PLC, looked at by the block of registers that the PLC shows of it.

    :param start: the first of them.
    """

    addressing = 'telegram1'

    def __init__(self, wire: Wire, model: Family, start: int) -> None:
        super().__init__(wire, model)
        self._start = start

    def block(self, count: int) -> tuple[int, ...] | None:
        """Return its first registers, or ``None`` if they were not answered."""
        return self.words(self._start, count)

    @property
    def shown(self) -> tuple[int, ...] | None:
        """What the PLC shows: 5 registers, of layout 2 8; ``None`` if the data are not valid."""
        words = self.block(_SHOWN)
        if words is None or words[4] not in _LAYOUTS or not words[3] & _VALID:
            return None
        return words if words[4] == 1 else self.block(_SHOWN_OF_2)

    def watch(self) -> Iterator[tuple[float, tuple[int, ...]]]:
        """Read the block again and again for a while; yield when, s, and what came."""
        began = time.monotonic()
        request = struct.pack('>BHH', HOLDING, self._start, _SHOWN)
        while (now := time.monotonic()) - began < _WATCHED:
            pdu = self.wire.ask(request).pdu
            if len(pdu) == 2 + 2 * _SHOWN and pdu[0] == HOLDING:
                yield now, struct.unpack(f'>{_SHOWN}H', pdu[2:])

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Those that stand in the block, for what a mailbox has is asked for by writing."""
        return {
            parameter.key: parameter
            for parameter in self.model.values()
            if parameter.is_readable
            and 'telegram1' in parameter.addresses
            and parameter.at('telegram1').space == 'telegram1'
        }

    def request(self, parameter: Parameter) -> bytes:
        """Return what asks for the block."""
        return struct.pack('>BHH', HOLDING, self._start, _SHOWN)

    def register(self, parameter: Parameter) -> Register:
        """Return what comes of a parameter; its index is that in the block."""
        part = parameter.at('telegram1').sub_index
        assert part is not None
        places, shown = _PLACES[part], self.shown
        if shown is None:
            remark = 'the PLC has no valid data of the drive'
            return Register(parameter.key, places[0], None, None, remark=remark)
        if places[0] >= _SHOWN and (len(shown) == _SHOWN or not shown[3] & _MORE_VALID):
            remark = 'the PLC does not show the longer telegram'
            return Register(parameter.key, places[0], None, None, remark=remark)
        words = tuple(shown[place] for place in places)
        data = struct.pack(f'>{len(words)}H', *words)
        value, remark = _means(parameter, 'telegram1', data)
        return Register(parameter.key, places[0], words, None, value, remark)


class ClassicSight(Sight):
    """A drive, looked at over Classic; each word has a number of its own."""

    addressing = 'classic'

    def word(self, number: int) -> int | None:
        """Return the word with a number, or ``None``."""
        pdu = self.ask(number.to_bytes(2, 'big')).pdu
        return int.from_bytes(pdu, 'big') if len(pdu) == 2 else None

    def is_refused(self, number: int) -> bool:
        """Return whether it answers NAK."""
        return self.ask(number.to_bytes(2, 'big')).pdu == NAK

    def request(self, parameter: Parameter) -> bytes:
        """Return what asks for its first word."""
        return parameter.at('classic').index.to_bytes(2, 'big')

    def register(self, parameter: Parameter) -> Register:
        """Return what comes of a parameter."""
        address = parameter.at('classic')
        second = address.sub_index
        numbers = [address.index, *(() if second is None else (second,))]
        words = [word for word in map(self.word, numbers) if word is not None]
        if len(words) < len(numbers):
            code = NAK[0] if any(map(self.is_refused, numbers)) else None
            return Register(parameter.key, address.index, None, code)
        data = struct.pack(f'>{len(words)}H', *words)
        value, remark = _means(parameter, 'classic', data)
        return Register(parameter.key, address.index, tuple(words), None, value, remark)


class MovitracSight(Sight):
    """A MOVITRAC, looked at over its line; each parameter has an index, and 4 or 8 bytes."""

    addressing = 'movitrac'

    def value(self, index: int) -> bytes | None:
        """Return the bytes at an index, or ``None`` if they were not answered."""
        answer = self.ask(index.to_bytes(2, 'big'))
        return answer.pdu if answer.pdu and answer.refused_with is None else None

    def refused_with(self, index: int) -> int | None:
        """Return the code of a refusal, or ``None`` if it was none."""
        return self.ask(index.to_bytes(2, 'big')).refused_with

    def request(self, parameter: Parameter) -> bytes:
        """Return what asks for it."""
        return parameter.at('movitrac').index.to_bytes(2, 'big')

    def register(self, parameter: Parameter) -> Register:
        """Return what comes of a parameter."""
        index = parameter.at('movitrac').index
        data = self.value(index)
        if data is None:
            code = self.refused_with(index)
            remark = '' if code is None else f'return code {code:02X}h'
            return Register(parameter.key, index, None, code, remark=remark)
        words = struct.unpack(f'>{len(data) // 2}H', data)
        value, remark = _means(parameter, 'movitrac', data)
        return Register(parameter.key, index, words, None, value, remark)


class CanopenSight(Sight):
    """A node, looked at by objects, each with an index and a sub-index."""

    addressing = 'canopen'

    def value(self, index: int, sub_index: int = 0) -> bytes | None:
        """Return the bytes of an object, the low one first, or ``None``."""
        answer = self.ask(struct.pack('>HB', index, sub_index))
        return answer.pdu[1:] if answer.pdu and answer.refused_with is None else None

    def aborted_with(self, index: int, sub_index: int = 0) -> int | None:
        """Return the code of an abort, or ``None`` if it was none."""
        return self.ask(struct.pack('>HB', index, sub_index)).refused_with

    def request(self, parameter: Parameter) -> bytes:
        """Return what asks for it."""
        address = parameter.at('canopen')
        return struct.pack('>HB', address.index, address.sub_index or 0)

    def register(self, parameter: Parameter) -> Register:
        """Return what comes of a parameter, its words with the high one first."""
        address = parameter.at('canopen')
        place = address.index, address.sub_index or 0
        data = self.value(*place)
        if data is None:
            code = self.aborted_with(*place)
            remark = '' if code is None else f'abort {code:08X}h'
            return Register(parameter.key, address.index, None, code, remark=remark)
        filled = bytes(len(data) % 2) + data[::-1]
        words = struct.unpack(f'>{len(filled) // 2}H', filled)
        value, remark = _means(parameter, 'canopen', data)
        return Register(parameter.key, address.index, words, None, value, remark)


def _means(parameter: Parameter, protocol: str, data: bytes) -> tuple[str, str]:
    """Return what the tables make of words, and what is odd in it."""
    try:
        value = parameter.decode(data, protocol)
    except ValueError as error:
        return '', str(error)
    shown = f'{value:g} {parameter.unit}'.strip() if isinstance(value, float) else str(value)
    if isinstance(value, float) and parameter.minimum is not None and value < parameter.minimum:
        return shown, f'below {parameter.minimum:g}'
    if isinstance(value, float) and parameter.maximum is not None and value > parameter.maximum:
        return shown, f'above {parameter.maximum:g}'
    return shown, ''
