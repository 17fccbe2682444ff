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

"""Judges what a driver did on a line, from the trace of the simulated drive's own end."""

from __future__ import annotations

from collections.abc import Iterator
import struct
from typing import Any

from nfo_sinus_driver.catalog import ERROR_LOG
from nfo_sinus_driver.catalog import MODELS
from nfo_sinus_driver.catalog import Control
from nfo_sinus_driver.catalog import Mode
from nfo_sinus_driver.catalog import Protocol
from nfo_sinus_driver.catalog import Scmd
from nfo_sinus_driver.catalog import load_model

_READ = 3
_WRITE_ONE = 6
_WRITE_SEVERAL = 16
#: Who are you: whole requests without unit and CRC. They touch no parameter [M0 §6.2.4].
_REPORT_SLAVE_ID = bytes((17,))
_READ_DEVICE = frozenset(
    bytes((43, 14, code, first)) for code in (1, 2, 4) for first in range(7)
)
_ACKNOWLEDGING = 0x02A4
_MODE = 0x0294
_SCMD = 0x0298
_MASK = 0x0250
_CONTROL = 0x0254
_METHODS = {_SCMD: 'SCMD', _MASK: 'the control word', _CONTROL: 'the control word'}
_SETPOINTS = frozenset((0x03FC, 0x025C, 0x0408, 0x0410))

Frame = dict[str, Any]


def violations(
    frames: list[Frame], frame_gap: float, model: str = 'sinus_g2'
) -> list[str]:
    """
    Return what breaks the laws of the house in a trace; nothing is as it should be.

    :param frame_gap: the least silence before a request, t3.5, s.
    """
    return [
        *_mixed_methods(frames),
        *_complaints(frames, frame_gap, model),
    ]


def _complaints(frames: list[Frame], frame_gap: float, model: str) -> list[str]:
    return [
        f'frame {number}: {complaint} ({frame["hex"]})'
        for number, frame in enumerate(frames)
        if frame['direction'] == 'request'
        for complaint in (
            *_wrong_gap(frame, number, frame_gap),
            *_wrong_request(frames, number, bytes.fromhex(frame['hex']), model),
        )
    ]


def _mixed_methods(frames: list[Frame]) -> Iterator[str]:
    """Complain of a drive that is commanded by SCMD and by its control word in one session."""
    methods: dict[int, set[str]] = {}
    for frame in frames:
        data = bytes.fromhex(frame['hex'])
        if frame['direction'] == 'request' and data[1] in (_WRITE_ONE, _WRITE_SEVERAL):
            method = _METHODS.get(int.from_bytes(data[2:4], 'big'))
            if method:
                methods.setdefault(data[0], set()).add(method)
    for unit, used in methods.items():
        if len(used) > 1:
            yield f'drive {unit} is commanded by {" and by ".join(sorted(used))}'


def _wrong_gap(frame: Frame, number: int, frame_gap: float) -> Iterator[str]:
    if number and frame['gap'] < frame_gap:
        yield f'came {1000 * frame["gap"]:.3f} ms after the frame before, t3.5 is not kept'


def _wrong_request(
    frames: list[Frame], number: int, data: bytes, model: str
) -> Iterator[str]:
    if data[1:-2] == _REPORT_SLAVE_ID or data[1:-2] in _READ_DEVICE:
        return
    unit, function, register = struct.unpack('>BBH', data[:4])
    if function == _READ:
        count = struct.unpack('>H', data[4:6])[0]
        words = None
    elif function == _WRITE_ONE:
        count = 1
        words = struct.unpack('>H', data[4:6])
    elif function == _WRITE_SEVERAL:
        count = struct.unpack('>H', data[4:6])[0]
        words = struct.unpack(f'>{count}H', data[7 : 7 + 2 * count])
    else:
        yield f'function {function} is not for parameters'
        return
    if register == _ACKNOWLEDGING:
        yield 'reads the status that acknowledges'
    if (register, count) not in _PARAMETERS[model]:
        yield f'{count} registers at {register:04X}h are not exactly one parameter'
    if words is None:
        return
    if register == _MODE and words[0] == Mode.EXT:
        yield 'MODE = 2 can start the motor'
    if register == _MASK:
        yield from _wrong_control_word(words[1])
    if register == _CONTROL and model == 'sinus_g2':
        yield from _wrong_control_word(words[0])
    if _runs(register, words[0], model) and not _zero_before(frames, number, unit, model):
        yield 'a run command without set-point 0 before it'


def _wrong_control_word(word: int) -> Iterator[str]:
    if word & Control.ENABLE_OP and word & Control.ENABLE_REV_OP:
        yield 'both directions at once are no direction'


def _runs(register: int, word: int, model: str) -> bool:
    """Tell whether a write makes the motor follow the set-point of the bus."""
    if register == _CONTROL and model == 'sinus_g2':
        wanted = Control.SWITCH_ON | Control.ENABLE_OP | Control.NET_REF
        return word & wanted == wanted
    return register == _SCMD and word == Scmd.FIELDBUS


def _zero_before(frames: list[Frame], number: int, unit: int, model: str) -> bool:
    """Tell whether the last set-point written to a unit was 0, since the last run command."""
    for frame in reversed(frames[:number]):
        data = bytes.fromhex(frame['hex'])
        if frame['direction'] != 'request' or data[0] != unit or data[1] != _WRITE_ONE:
            continue
        register, value = struct.unpack('>HH', data[2:6])
        if register in _SETPOINTS:
            return value == 0
        if _runs(register, value, model):
            return False
    return False


def _parameters(model: str) -> Iterator[tuple[int, int]]:
    for parameter in load_model(model).values():
        if Protocol.MODBUS in parameter.places:
            place = parameter.place(Protocol.MODBUS)
            yield place.address, place.words
    if model == 'sinus_g2':
        area = ERROR_LOG[Protocol.MODBUS]
        for entry in range(area.entries):
            yield area.address(entry), area.TYPE.words


_PARAMETERS = {model: frozenset(_parameters(model)) for model in MODELS}
