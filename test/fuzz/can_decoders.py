# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The decoders of what comes over a CAN bus under fuzz, each with its judge."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from random import Random
import re
import struct

from fuzz.decoders import Case
from fuzz.mutations import Mutator
from nfo_sinus_driver.link.canopen import lawicel, sdo
from nfo_sinus_driver.link.canopen.can import Frame
from nfo_sinus_driver.link.interface import DamagedAnswer, Refused

_MOST_KEPT = 30
_MANY = 25
_LINE = re.compile(rb't([0-7][0-9A-Fa-f]{2})(\d)((?:[0-9A-Fa-f]{2})*)')

# --- LAWICEL --------------------------------------------------------------------------------------


def _lawicel(random: Random, frames: int) -> None:
    mutator = Mutator(random)
    while frames > 0:
        count = 1 + int(random.random() * min(_MANY, frames))
        frames -= count
        stream = b''
        for _ in range(count):
            line = _line(random)
            way = random.random()
            if way < 0.1:
                stream += mutator.rubbish()
            elif way < 0.5:
                stream += mutator.frame(line, [_line(random), b'\a', b'z\r'], bytes)
            else:
                stream += line
        reader = lawicel.Reader()
        found: list[Frame] = []
        done = refused = 0
        for piece in mutator.pieces(stream):
            heard = reader.feed(piece)
            found += heard.frames
            done += heard.done
            refused += heard.refused
            assert reader.pending <= _MOST_KEPT, 'the reader keeps more than a line'
        lines = _lines(stream)
        right = [frame for line in lines if (frame := _frame_of(line)) is not None]
        assert found == right, f'{found} instead of {right}'
        assert refused == stream.count(b'\a')
        assert done == sum(line in (b'', b'z', b'Z') for line in lines)


def _line(random: Random) -> bytes:
    """Return a line that an adapter may say, of every kind."""
    identifier = random.choice((0x585, 0x705, random.getrandbits(11)))
    data = random.randbytes(random.choice((8, 8, random.getrandbits(3))))
    stamp = random.choice((b'', b'', b'1A2b'))
    frame = b't%03X%d' % (identifier, len(data)) + data.hex().encode() + stamp + b'\r'
    return random.choice((frame, frame, frame.lower(), b'\r', b'z\r', b'\a', b'T000005851AA\r'))


def _lines(stream: bytes) -> Iterable[bytes]:
    """Return the lines that are whole, one character after the other."""
    line = b''
    lines = []
    for char in stream:
        if char == 0x0D:
            lines.append(line)
        if char in (0x0D, 0x07):
            line = b''
        else:
            line += bytes((char,))
    return lines


def _frame_of(line: bytes) -> Frame | None:
    match = _LINE.fullmatch(line)
    if match is None or int(match[2]) > 8:
        return None
    digits = match[3].decode()
    size = 2 * int(match[2])
    if len(digits) - size not in (0, 4):
        return None
    return Frame(int(match[1], 16), bytes.fromhex(digits[:size]))


# --- SDO ------------------------------------------------------------------------------------------

_WAITS, _DAMAGED = 'waits', 'damaged'
_PLACE = (0x2013, 1)


def _sdo(random: Random, frames: int) -> None:
    mutator = Mutator(random)
    for _ in range(frames):
        stream = list(_reported(random))
        for at, message in enumerate(stream):
            if random.random() < 0.3:
                stream[at] = mutator.frame(message, stream, bytes)
        if random.random() < 0.3:
            stream.insert(int(random.random() * len(stream)), random.choice(stream))
        upload = sdo.Upload(5, *_PLACE)
        outcome: object = _WAITS
        for message in stream:
            try:
                upload.take_message(message)
            except Refused as refused:
                outcome = str(refused)[-10:-2]
            except DamagedAnswer:
                outcome = _DAMAGED
            if upload.request is None and outcome == _WAITS:
                outcome = upload.value
            if outcome != _WAITS:
                break
            assert upload.request is not None and len(upload.request) == 8
        right = _outcome(stream)
        assert outcome == right, f'{outcome!r} instead of {right!r} of {stream}'


def _reported(random: Random) -> Iterable[bytes]:
    """Return what a node may tell when an object is read."""
    index, sub_index = _PLACE if random.random() < 0.9 else (0x2014, 1)
    name = struct.pack('<HB', index, sub_index)
    way = random.random()
    if way < 0.3:
        flags = random.choice((0x43, 0x47, 0x4B, 0x4F, 0x42))
        yield bytes((flags,)) + name + random.randbytes(4)
    elif way < 0.4:
        yield b'\x80' + name + random.randbytes(4)
    else:
        value = random.randbytes(int(random.random() * 40))
        if random.random() < 0.5:
            yield b'\x41' + name + struct.pack('<I', len(value))
        else:
            yield b'\x40' + name + bytes(4)
        cuts = range(0, len(value), 7) or range(1)
        for number, begin in enumerate(cuts):
            data = value[begin : begin + 7]
            last = number == len(cuts) - 1
            head = (number & 1) << 4 | (7 - len(data)) << 1 | last
            yield bytes((head,)) + data.ljust(7, b'\0')


def _outcome(stream: Iterable[bytes]) -> object:
    """Return what becomes of a read by what a node tells (CiA 301 §7.2.4.3)."""
    name = struct.pack('<HB', *_PLACE)
    value, size, toggle, segments = b'', None, 0, False
    for message in stream:
        if len(message) != 8:
            continue
        command = message[0] >> 5
        if command == 4 and message[1:4] == name:
            return f'{int.from_bytes(message[4:], "little"):08X}'
        if not segments:
            if command != 2 or message[1:4] != name:
                continue
            if message[0] & 2:
                return message[4 : 8 - (message[0] >> 2 & 3 if message[0] & 1 else 0)]
            segments = True
            size = int.from_bytes(message[4:], 'little') if message[0] & 1 else None
            if size is not None and size > sdo.LONGEST_VALUE:
                return _DAMAGED
            continue
        if command != 0 or message[0] >> 4 & 1 != toggle:
            continue
        toggle ^= 1
        data = message[1 : 8 - (message[0] >> 1 & 7)]
        value += data
        last = message[0] & 1
        most = sdo.LONGEST_VALUE if size is None else size
        if len(value) > most or not (data or last) or (last and size not in (None, len(value))):
            return _DAMAGED
        if last:
            return value
    return _WAITS


#: Every decoder of what comes over a CAN bus.
CAN_CASES: Mapping[str, Case] = {'lawicel': _lawicel, 'sdo': _sdo}
