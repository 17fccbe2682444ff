# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""
A CAN adapter that speaks LAWICEL's protocol on its serial port, without I/O (manual of the CANUSB).

A command is a line that ends with CR. The answer is CR, or what was asked for and CR; BEL says
*no*; an empty line is passed over. Frames are accepted and reported while the channel is open only;
what sets up the channel is accepted while it is closed only.
"""

from __future__ import annotations

from collections.abc import Iterator
import re

from nfo_sinus_driver.simulator.can_frames import EXTENDED, MOST_DATA, Frame

#: What S0 to S8 set, bit/s.
BIT_RATES = (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000)
_CR, _BEL = b'\r', b'\a'
#: The longest line that is one: an extended frame with eight bytes.
_LONGEST = 26
#: How many frames wait in it for the bus.
_DEPTH = 8
_FRAME = re.compile(rb'([tr])([0-7][0-9A-Fa-f]{2})([0-8])((?:[0-9A-Fa-f]{2})*)')
_LONG_FRAME = re.compile(rb'([TR])([01][0-9A-Fa-f]{7})([0-8])((?:[0-9A-Fa-f]{2})*)')
_REGISTER = re.compile(rb'([Mm])([0-9A-Fa-f]{8})')
#: Time stamps count milliseconds to a minute.
_MINUTE = 60_000
#: Bits of the status flags: transmit queue full, error warning, error passive, bus error.
_QUEUE_FULL, _WARNING, _PASSIVE, _BUS_ERROR = 0x02, 0x04, 0x20, 0x80


class Adapter:
    """
    One adapter.

    :param version: what it says of its version: four digits.
    :param serial: its serial number: four characters.

    :ivar rate: the bit rate that was set; ``None`` before it was.
    :ivar is_open: the channel is open.
    """

    def __init__(self, version: str = '1013', serial: str = 'NF01') -> None:
        self._version = version
        self._serial = serial
        self.restart()

    def restart(self) -> None:
        """Be as after it was plugged in."""
        self.rate: int | None = None
        self.is_open = False
        self._listens_only = False
        self._stamps = False
        self._flags = 0
        self._unsent = 0
        self._code, self._mask = bytes(4), b'\xff' * 4
        self._line = b''

    # ---- from the computer ----

    def take_bytes(self, data: bytes) -> Iterator[bytes | Frame]:
        """
        Take bytes from the computer.

        :returns: what it answers, and the frames that it puts on the bus, in order. Each frame
            wants :meth:`tried`.
        """
        *lines, rest = (self._line + data).split(_CR)
        # what is longer than any line is none, however it ends
        self._line = rest[: _LONGEST + 1]
        for line in lines:
            yield self._carry_out(line)

    def tried(self, frame: Frame, *, sent: bool) -> bytes:
        """Record that a frame could be sent, or could not; return what it answers."""
        if sent:
            self._unsent = 0
            return (b'Z' if frame.extended else b'z') + _CR
        self._flags |= _WARNING | _PASSIVE | _BUS_ERROR
        if self._unsent == _DEPTH:
            self._flags |= _QUEUE_FULL
            return _BEL
        # no node acknowledges it; until the queue is full that does not show
        self._unsent += 1
        return (b'Z' if frame.extended else b'z') + _CR

    def _carry_out(self, line: bytes) -> bytes | Frame:
        command, rest = line[:1], line[1:]
        if not line:
            return b''
        if command in (b't', b'r', b'T', b'R'):
            frame = _frame(line)
            able = self.is_open and not self._listens_only
            return frame if able and frame is not None else _BEL
        if command == b'V':
            return b'V' + self._version.encode() + _CR if not rest else _BEL
        if command == b'N':
            return b'N' + self._serial.encode() + _CR if not rest else _BEL
        if command == b'F' and self.is_open and not rest:
            flags, self._flags = self._flags, 0
            return b'F%02X' % flags + _CR
        if command == b'C' and self.is_open and not rest:
            self.is_open = False
            self._unsent = 0
            return _CR
        done = not self.is_open and self._set_up(command, rest)
        return _CR if done else _BEL

    def _set_up(self, command: bytes, rest: bytes) -> bool:
        """Carry out what a closed channel takes; return whether it is that."""
        if command == b'S' and len(rest) == 1 and rest.isdigit() and int(rest) < len(BIT_RATES):
            self.rate = BIT_RATES[int(rest)]
        elif command in (b'O', b'L') and not rest and self.rate is not None:
            self.is_open, self._listens_only, self._flags = True, command == b'L', 0
        elif command == b'Z' and rest in (b'0', b'1'):
            self._stamps = rest == b'1'
        elif command == b'X' and rest in (b'0', b'1'):
            # frames are reported as they come, whatever is said
            return rest == b'1'
        elif _REGISTER.fullmatch(command + rest):
            register = bytes.fromhex(rest.decode())
            if command == b'M':
                self._code = register
            else:
                self._mask = register
        else:
            return False
        return True

    # ---- from the bus ----

    def on_bus(self, rate: int) -> bool:
        """Return whether it takes part in a bus with this bit rate."""
        return self.is_open and self.rate == rate

    def text_of(self, frame: Frame, now: float) -> bytes:
        """Return what reports a frame from the bus to the computer; nothing if it is filtered."""
        if not self._passes(frame):
            return b''
        kind = ('R' if frame.remote else 'T') if frame.extended else 'r' if frame.remote else 't'
        identifier = f'{frame.identifier:08X}' if frame.extended else f'{frame.identifier:03X}'
        data = '' if frame.remote else frame.data.hex().upper()
        stamp = f'{int(now * 1000) % _MINUTE:04X}' if self._stamps else ''
        return f'{kind}{identifier}{len(frame.data)}{data}{stamp}'.encode() + _CR

    def _passes(self, frame: Frame) -> bool:
        """Return whether one of the two acceptance filters lets a frame through (SJA1000, dual)."""
        if frame.extended:
            seen = (frame.identifier >> 13).to_bytes(2, 'big')
            return any(_matches(seen, self._code[at:], self._mask[at:]) for at in (0, 2))
        # identifier, remote, and of the first filter the first byte of data
        head = frame.identifier << 5 | frame.remote << 4
        first = frame.data[0] if frame.data and not frame.remote else None
        high = head.to_bytes(2, 'big')
        code, mask = self._code, self._mask
        passes = _matches(high, code, bytes((mask[0], mask[1] | 0x0F)))
        if passes and first is not None:
            byte = bytes(((code[1] & 0x0F) << 4 | code[3] & 0x0F,))
            ignored = bytes(((mask[1] & 0x0F) << 4 | mask[3] & 0x0F,))
            passes = _matches(bytes((first,)), byte, ignored)
        return passes or _matches(high, code[2:], bytes((mask[2], mask[3] | 0x0F)))


def _matches(seen: bytes, code: bytes, mask: bytes) -> bool:
    """Return whether the bits that count, those that are 0 in the mask, are alike."""
    return all((a ^ b) & ~c & 0xFF == 0 for a, b, c in zip(seen, code, mask, strict=False))


def _frame(line: bytes) -> Frame | None:
    """Return the frame of a line without its end; ``None`` if it is none."""
    match = _FRAME.fullmatch(line) or _LONG_FRAME.fullmatch(line)
    if match is None:
        return None
    extended, remote = match[1] in b'TR', match[1] in b'rR'
    identifier, length = int(match[2], 16), int(match[3])
    if (extended and identifier not in EXTENDED) or len(match[4]) != (0 if remote else 2 * length):
        return None
    data = bytes(length) if remote else bytes.fromhex(match[4].decode())
    assert len(data) <= MOST_DATA
    return Frame(identifier, data, remote, extended)
