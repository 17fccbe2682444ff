# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Judges what a driver asks of MOVITRACs on a line, by the manual's indices and nothing else."""

from __future__ import annotations

from collections.abc import Iterator
import functools

from nfo_sinus_driver.catalog import load_family
from support.wire import Request, understand

#: Remote set-point, function bits and P841 [M4 §4].
_SIZE, _BITS, _CONTROL_MODE = 223, 281, 205
#: P841 as Remote control, as Remote setpoint, and as Standard.
_REMOTE_CONTROL, _REMOTE_SETPOINT, _STANDARD = (0x0000, 0x0200), (0x0000, 0x0100), (0, 0)
#: What is looked at before P841 is put back: the frequency, and the terminals.
_STANDS = frozenset((0, 13))
#: The factory setting, and an action of IPOS: never without a person.
_NEVER = frozenset((203, 704))
#: Of the function bits: CW and CCW, and reset.
_DIRECTIONS, _RESET = 0x0003, 0x0040
#: 400.00 Hz [M4 §4].
_MOST = 40000


class MovitracJudge:
    """
    Hears the requests on one line, one after another.

    :param by_terminals: terminals start the motors, while P841 is Remote setpoint.
    """

    def __init__(self, *, by_terminals: bool = False) -> None:
        self._by_terminals = by_terminals
        #: Of each unit: the set-point that was written last, and the function bits; none before.
        self._sizes: dict[int, int] = {}
        self._bits: dict[int, int] = {}
        #: Those on their way to Remote control by Remote setpoint, where the bits do not count, and
        #: what was read of them since.
        self._between: dict[int, set[int]] = {}

    def complaints(self, data: bytes) -> Iterator[str]:
        """Take a request; yield what is wrong with it."""
        try:
            request = understand(data, 'movitrac')
        except ValueError as error:
            yield str(error)
            return
        assert request is not None
        size = _sizes().get(request.place)
        if size is None:
            yield f'there is no index {request.place}'
        elif request.words is not None and 2 * len(request.words) != size:
            yield f'index {request.place} has {size} bytes'
        if request.words is not None:
            yield from self._judge_write(request, request.words)
        elif request.unit in self._between:
            self._between[request.unit].add(request.place)

    def _judge_write(self, request: Request, words: tuple[int, ...]) -> Iterator[str]:
        if request.place in _NEVER:
            yield f'index {request.place} is written, which starts what was not requested'
        if request.place == _CONTROL_MODE:
            looked = self._between.pop(request.unit, set())
            put_back = words == _STANDARD and looked >= _STANDS
            if words == _REMOTE_SETPOINT and not self._by_terminals:
                self._between[request.unit] = set()
            elif words not in self._modes and not put_back:
                yield 'another P841 than Remote control can start the motor'
        elif request.unit in self._between and any(words):
            # bits without a direction are a stop: an enable that fails half-way is followed by one
            is_stop = request.place == _BITS and not words[1] & _DIRECTIONS
            if not is_stop:
                yield 'while P841 is Remote setpoint no direction and no set-point but 0 is written'
        if request.place == _SIZE:
            yield from self._judge_size(request.unit, words)
        if request.place == _BITS:
            yield from self._judge_bits(request.unit, words)

    @property
    def _modes(self) -> tuple[tuple[int, int], ...]:
        return (_REMOTE_CONTROL, _REMOTE_SETPOINT) if self._by_terminals else (_REMOTE_CONTROL,)

    def _judge_size(self, unit: int, words: tuple[int, ...]) -> Iterator[str]:
        digits = ''.join(f'{word:04x}' for word in words)
        if not digits.isdecimal() or int(digits) > _MOST:
            yield f'the set-point {digits} is none'
            return
        self._sizes[unit] = int(digits)

    def _judge_bits(self, unit: int, words: tuple[int, ...]) -> Iterator[str]:
        before, bits = self._bits.get(unit, 0), words[1]
        self._bits[unit] = bits
        direction = bits & _DIRECTIONS
        if words[0]:
            yield 'bits that have no meaning'
        if direction and self._by_terminals:
            yield 'a direction, which the terminals give'
        if direction == _DIRECTIONS:
            yield 'both directions at once are no direction'
        if bits & _RESET and bits & ~_RESET:
            yield 'a reset beside other bits'
        if direction and direction != before & _DIRECTIONS and self._sizes.get(unit) != 0:
            yield 'a direction without set-point 0 before it'


@functools.cache
def _sizes() -> dict[int, int]:
    """Return the size of every index, bytes."""
    rows = [row.at('movitrac') for row in load_family('movitrac31').values()]
    return {row.index: row.codec.size for row in rows}
