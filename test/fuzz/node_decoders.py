# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated CAN adapter and the node behind it under fuzz, each with its judge."""

from __future__ import annotations

from collections.abc import Mapping
from random import Random
import re
import struct

from fuzz.decoders import Case
from fuzz.mutations import Mutator
from nfo_sinus_driver.families import USUAL
from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.canopen import Server
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.lawicel import Adapter

_MANY = 25
_NODE = 1
#: A frame's line: kind, identifier, length, data.
_LINE = re.compile(rb'([tr])([0-7][0-9A-Fa-f]{2})([0-8])((?:[0-9A-Fa-f]{2})*)')
_LONG = re.compile(rb'([TR])([01][0-9A-Fa-f]{7})([0-8])((?:[0-9A-Fa-f]{2})*)')
_REOPEN = b'\rC\rS4\rO\r'


def _adapter(random: Random, frames: int) -> None:
    """Judge which frames an adapter sends, and that it answers each line once."""
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
                stream += mutator.frame(line, [_line(random), b'V\r'], bytes)
            else:
                stream += line
        adapter = Adapter()
        list(adapter.take_bytes(_REOPEN))
        found: list[Frame] = []
        answered = 0
        for piece in mutator.pieces(stream):
            for said in adapter.take_bytes(piece):
                if isinstance(said, Frame):
                    found.append(said)
                    said = adapter.tried(said, sent=True)
                answered += said != b''
        lines = stream.split(b'\r')[:-1]
        right = list(_frames_of(lines))
        assert found == right, f'{found} instead of {right}'
        assert answered == sum(line != b'' for line in lines), 'a line has one answer'
        list(adapter.take_bytes(_REOPEN))
        assert adapter.on_bus(125_000), 'it does not come back'


def _line(random: Random) -> bytes:
    """Return a line that a master may say, of every kind."""
    data = random.randbytes(random.choice((8, 8, random.getrandbits(3))))
    text = data.hex().encode()
    standard = b'%03X%d' % (random.getrandbits(11), len(data))
    extended = b'%08X%d' % (random.getrandbits(29), len(data))
    frame = b't' + standard + text
    kinds = (
        *(3 * [frame, frame.lower()]),
        b'T' + extended + text,
        b'r' + standard,
        b'R' + extended,
        *(b'C', b'O', b'S4', b'S8', b'L', b'F', b'V', b'N', b'Z1', b'M00000000', b''),
    )
    return random.choice(kinds) + b'\r'


def _frames_of(lines: list[bytes]) -> list[Frame]:
    """Return the frames that an adapter has to send, which begins on the bus with S4."""
    found = []
    is_open, listens = True, False
    for line in lines:
        if line == b'C':
            is_open = listens = False
        elif line in (b'O', b'L') and not is_open:
            is_open, listens = True, line == b'L'
        match = _LINE.fullmatch(line) or _LONG.fullmatch(line)
        if match is None or not is_open or listens:
            continue
        remote, extended = match[1] in b'rR', match[1] in b'TR'
        length = int(match[3])
        if len(match[4]) == (0 if remote else 2 * length):
            data = bytes(length) if remote else bytes.fromhex(match[4].decode())
            found.append(Frame(int(match[2], 16), data, remote, extended))
    return found


def _node(random: Random, frames: int) -> None:
    """Judge what a node says to frames of every kind, damaged and out of order."""
    mutator = Mutator(random)
    drive = simulated_drive(USUAL, _NODE)
    node = drive.servers['canopen']
    assert isinstance(node, Server)
    now = 0.0
    for _ in range(frames):
        now += random.choice((0.0, 0.001, 0.3))
        drive.advance_to(now)
        data = _request(random)
        if random.random() < 0.3:
            data = mutator.frame(data, [_request(random)], bytes)[:8]
        identifier = random.choice((0x601, 0x601, 0x601, 0x000, 0x701, 0x77F, 0x602))
        frame = Frame(identifier, data, random.random() < 0.1)
        said = [*node.act(now), *node.receive(frame, now)]
        answers = [heard for heard in said if heard.identifier == 0x580 + _NODE]
        others = {heard.identifier for heard in said} - {0x580 + _NODE}
        assert others <= {0x080 + _NODE, 0x700 + _NODE}, f'frames of no known kind: {others}'
        asked = identifier == 0x600 + _NODE and not frame.remote
        assert len(answers) <= asked and all(len(heard.data) == 8 for heard in answers)
        for answer in answers:
            if data[0] >> 5 in (1, 2):
                assert answer.data[1:4] == data[1:4], 'an answer about another object'
    # whatever was said to it, a reset makes it as it was
    list(node.receive(Frame(0x000, b'\x81\x00'), now))
    (answer,) = node.receive(Frame(0x601, bytes.fromhex('4018100000000000')), now)
    assert answer.data == bytes.fromhex('4f18100004000000')


def _request(random: Random) -> bytes:
    """Return what a master may ask of a node, mostly of objects that are there."""
    index = random.choice((0x1000, 0x1008, 0x1016, 0x1017, 0x1018, 0x100C, 0x2022, 0x2023, 0x2026))
    name = struct.pack('<HB', index, random.choice((0, 0, 1, 2)))
    command = random.choice(
        (0x40, 0x40, 0x60, 0x70, 0x2B, 0x2F, 0x23, 0x22, 0x21, 0x00, 0x10, 0x01, 0x80, 0xA0)
    )
    return bytes((command,)) + name + random.randbytes(4)


#: What the simulator receives from a CAN bus.
NODE_CASES: Mapping[str, Case] = {'simulator lawicel': _adapter, 'simulator canopen': _node}
