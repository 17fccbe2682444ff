# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Judges what a driver did on a line, from the trace of the simulated drive's own end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
import functools
import itertools
from typing import Any

from nfo_sinus_driver.catalog import Access, load_family
from nfo_sinus_driver.families.sinus_g2.words import ControlWord, Mode, Scmd
from support.movitrac_laws import MovitracJudge
from support.wire import PROFILE, WITH_GAP, Request, understand

#: The Classic address that every drive obeys [M0 §6.1].
_EVERYBODY = 95
#: Where a set-point is written, of whichever control mode ([M0 §8.2], [C11], [C12], [C53]).
_SETPOINTS = {
    'modbus': frozenset((0x03FC, 0x025C, 0x0408, 0x0410)),
    'classic': frozenset((0x001E,)),
}
#: ControlWord of the drive profile, "enable operation"; target velocity and torque (CiA 402).
_CONTROL_WORD, _ENABLED = 0x6040, 0x0F
_TARGETS = frozenset((0x6042, 0x6071))

_DIRECTIONS = ControlWord.ENABLE_OP | ControlWord.ENABLE_REV_OP

#: A master waits at least so long for an answer, s; a later one may meet the next request, and
#: so many frames behind it are looked at.
_GIVEN_UP = 0.19
_NEAR = 8

Frame = dict[str, Any]


@dataclass(frozen=True)
class _Places:
    """
    Where things stand on one bus of one model: registers, or Classic ids.

    :ivar methods: by which control method a command is given there.
    :ivar whole: place and number of words of everything that can be read or written.
    """

    mode: int
    command: int
    mask: int
    control: int
    acknowledging: frozenset[int]
    setpoints: frozenset[int]
    methods: Mapping[int, str]
    whole: frozenset[tuple[int, int]]


def violations(
    frames: list[Frame],
    frame_gap: float,
    model: str = 'sinus_g2',
    protocol: str = 'modbus_rtu',
    method: str = '',
    *,
    may_stand_still: bool = False,
) -> list[str]:
    """
    Return what breaks the laws of the house in a trace; nothing is as it should be.

    :param frame_gap: the least silence before a request, t3.5, s; counts for Modbus RTU alone.
    :param may_stand_still: the far end may have; it then has two requests at once, or a request
        before it answers the one before.
    """
    by_terminals = method == 'remote_setpoint'
    judge = (
        MovitracJudge(by_terminals=by_terminals)
        if protocol == 'movitrac'
        else _Judge(model, protocol)
    )

    def has_gap(frame: Frame) -> bool:
        return protocol in WITH_GAP and not (may_stand_still and (frame['gap'] or 0.0) <= 0.0)

    return [
        f'frame {number}: {complaint} ({frame["hex"]})'
        for number, frame in enumerate(frames)
        if frame['direction'] == 'request'
        for complaint in (
            *(_wrong_gap(frames, number, frame_gap) if has_gap(frame) else ()),
            *judge.complaints(bytes.fromhex(frame['hex'])),
        )
    ]


def _wrong_gap(frames: list[Frame], number: int, frame_gap: float) -> Iterator[str]:
    gap = frames[number]['gap']
    if number and gap < frame_gap and not _behind_a_late_answer(frames, number):
        yield f'came {1000 * gap:.3f} ms after the frame before, t3.5 is not kept'


def _behind_a_late_answer(frames: list[Frame], number: int) -> bool:
    """Return whether a request was given up just before: a late one keeps no gap to the next."""
    near = frames[max(0, number - _NEAR) : number]
    return any(
        frame['direction'] == 'request' and other['first'] - frame['last'] >= _GIVEN_UP
        for frame, other in itertools.pairwise(near)
        if 'first' in other and 'last' in frame
    )


class _Judge:
    """Hears the requests on one line, one after another."""

    def __init__(self, model: str, protocol: str) -> None:
        self._protocol = protocol
        self._places = _places(model, protocol)
        #: The set-point of each unit is 0 and was written since its last run command.
        self._zero: dict[int, bool] = {}
        #: The set-point of each unit that was written last is 0.
        self._stands: dict[int, bool] = {}
        #: How each unit was commanded at first.
        self._methods: dict[int, str] = {}
        #: Who was spoken to, and who of them was given a run command that was not removed.
        self._known: set[int] = set()
        self._running: set[int] = set()

    def complaints(self, data: bytes) -> Iterator[str]:
        """Take a request; yield what is wrong with it."""
        try:
            request = understand(data, self._protocol)
        except ValueError as error:
            yield str(error)
            return
        if request is None:
            return
        places = self._places
        unit, place, count, words, source = request
        if (place if words is None else source and source[0]) in places.acknowledging:
            yield 'reads the status that acknowledges'
        if source is not None and place not in places.setpoints:
            yield 'function 23 is not for parameters other than set-points'
        for start, size in ((place, count), *(() if source is None else (source,))):
            if (start, size) not in places.whole:
                yield f'{size} words at {start:04X}h are not exactly one parameter'
        if unit != _EVERYBODY or self._protocol != 'classic':
            self._known.add(unit)
        if words is None:
            return
        if place == places.mode and words[0] == Mode.EXT:
            yield 'MODE = 2 can start the motor'
        if self._protocol == 'classic' and unit == _EVERYBODY:
            yield from self._call(request)
            return
        if place == places.mask:
            wrong = list(_wrong_control_word(words[1]))
            yield from wrong
            if not wrong and words[1] & _DIRECTIONS and not self._stands.get(unit):
                yield 'another direction beside a set-point'
            if words[1] & ControlWord.SWITCH_ON:
                yield 'a mask switches on'
        if place == places.control:
            yield from _wrong_control_word(words[0])
        method = places.methods.get(place, '')
        if method and self._methods.setdefault(unit, method) != method:
            yield f'is commanded by {method}, and was by {self._methods[unit]}'
        if place in places.setpoints:
            self._zero[unit] = self._stands[unit] = words == (0,)
        if _runs(request, places):
            turns = place == places.control and unit in self._running
            if not (self._stands if turns else self._zero).get(unit):
                yield 'a run command without set-point 0 before it'
            self._zero[unit] = False
            self._running.add(unit)
        elif place in (places.command, places.control, places.mode, _CONTROL_WORD):
            self._running.discard(unit)

    def _call(self, request: Request) -> Iterator[str]:
        """Judge what is broadcast: a stop, or a set-point where all have been enabled."""
        places, words = self._places, request.words
        if _stops(request, places):
            self._running.clear()
        elif request.place not in places.setpoints:
            yield 'a broadcast that is neither a stop nor a set-point'
        elif self._known - self._running:
            yield f'a set-point for all, but {sorted(self._known - self._running)} are not enabled'
        else:
            self._zero.update(dict.fromkeys(self._known, words == (0,)))
            self._stands.update(self._zero)


def _stops(request: Request, places: _Places) -> bool:
    return request.place == places.mode and request.words == (Mode.STOP,)


def _wrong_control_word(word: int) -> Iterator[str]:
    if word & ControlWord.ENABLE_OP and word & ControlWord.ENABLE_REV_OP:
        yield 'both directions at once are no direction'


def _runs(request: Request, places: _Places) -> bool:
    """Return whether a write makes the motor follow the set-point of the bus."""
    assert request.words is not None
    if request.place == places.control:
        wanted = ControlWord.SWITCH_ON | ControlWord.NET_REF
        return request.words[0] & wanted == wanted and bool(request.words[0] & _DIRECTIONS)
    if request.place == _CONTROL_WORD:
        return request.words[0] & _ENABLED == _ENABLED
    return request.place == places.command and request.words[0] == Scmd.FIELDBUS


@functools.cache
def _places(model: str, protocol: str) -> _Places:
    bus = 'classic' if protocol == 'classic' else 'modbus'
    parameters = [row for row in load_family(model).values() if bus in row.addresses]
    whole = set()
    for parameter in parameters:
        place = parameter.at(bus)
        if bus == 'classic':
            whole |= {(number, 1) for number in place.numbers}
        else:
            whole.add((place.index, place.codec.size // 2))
    area = load_family(model).error_logs.get(bus)
    if area is not None:
        for entry in range(area.entries if bus == 'modbus' else area.limit):
            low = area.address(entry)
            whole |= {(low, 1), (low + 1, 1)} if bus == 'classic' else {(low, 2)}
    acknowledging = frozenset(
        parameter.at(bus).index
        for parameter in parameters
        if parameter.access is Access.ACKNOWLEDGE
    )
    at = {parameter.key: parameter.at(bus).index for parameter in parameters}
    command = at.get('fieldbus.scmd', at.get('fieldbus.smode', -1))
    mask = at.get('fieldbus.drv_ctrl_write_mask', -1)
    word = at.get('fieldbus.drive_control', -1)
    return _Places(
        mode=at.get('fieldbus.mode', -1),
        command=command,
        # the control word of the Optimal has other bits
        mask=mask,
        control=word if model == 'sinus_g2' else -1,
        acknowledging=acknowledging,
        setpoints=_SETPOINTS[bus] | _TARGETS,
        methods={
            command: 'SCMD',
            mask: 'the control word',
            word: 'the control word',
            _CONTROL_WORD: 'ControlWord',
        },
        whole=frozenset(whole | set(PROFILE.items())),
    )
