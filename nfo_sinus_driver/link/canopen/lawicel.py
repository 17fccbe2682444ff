# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A CAN bus behind an adapter that speaks LAWICEL's protocol, which Linux calls slcan.

A line ends with CR: ``t`` identifier (three digits) length data; ``r`` and no data is a remote
frame, which is only sent. A BEL in place of a line means *no*; an empty line, ``z`` and ``Z`` mean
*done*. ``F`` asks for the status flags, two digits. Digits are sent in upper case and read in both.
Other lines, such as those of extended and remote frames, are passed over.
"""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import re
import time
from typing import NamedTuple

from nfo_sinus_driver.link.canopen.can import CANNOT_SEND, IDENTIFIERS, MOST_DATA, Frame
from nfo_sinus_driver.link.interface import Clock, PortError
from nfo_sinus_driver.link.ports.port import Port

#: The digit of the command that sets a bit rate, by the rate, bit/s.
BIT_RATES = {
    10_000: 0,
    20_000: 1,
    50_000: 2,
    100_000: 3,
    125_000: 4,
    250_000: 5,
    500_000: 6,
    800_000: 7,
    1_000_000: 8,
}
#: Ends a line.
CR = b'\r'
#: In place of a line: the adapter refused.
BEL = b'\a'
#: The command that takes the adapter off the bus; refused when it is off already.
CLOSE = b'C' + CR
#: The command that takes the adapter onto the bus.
OPEN = b'O' + CR
#: The command that reads the status flags, and what its bits mean; an old adapter may refuse it.
FLAGS = b'F' + CR
_FLAGS = {
    0x01: 'receive queue full',
    0x02: 'transmit queue full',
    0x04: 'error warning',
    0x08: 'data overrun',
    0x20: 'error passive',
    0x40: 'arbitration lost',
    0x80: 'bus error',
}
#: Ends an incomplete command of an earlier program; an adapter refuses or ignores it.
FLUSH = 3 * CR

#: The longest line that counts: a frame with eight bytes, a time stamp and a CR behind it.
_LONGEST_LINE = 26
#: A frame, with a time stamp or without.
_FRAME = re.compile(rb't([0-7][0-9A-Fa-f]{2})([0-8])((?:[0-9A-Fa-f]{2})*)')
_STAMP = 4
_FLAGS_LINE = re.compile(rb'F([0-9A-Fa-f]{2})')


class Output(NamedTuple):
    """
    What an adapter sent.

    :ivar frames: in their order.
    :ivar done: how often it confirmed a command.
    :ivar refused: how often it refused one.
    :ivar flags: the last status flags that it said; ``None``: none.
    """

    frames: Sequence[Frame]
    done: int
    refused: int
    flags: int | None = None


def encode(frame: Frame) -> bytes:
    """
    Return the line that sends a frame.

    :raises ValueError: there is no such standard frame.
    """
    if frame.identifier not in IDENTIFIERS or len(frame.data) > MOST_DATA:
        raise ValueError(f'{frame} is no standard frame')
    if frame.remote:
        return f'r{frame.identifier:03X}{len(frame.data)}'.encode() + CR
    data = frame.data.hex().upper()
    return f't{frame.identifier:03X}{len(frame.data)}{data}'.encode() + CR


def bit_rate(rate: int) -> bytes:
    """
    Return the command that sets a bit rate; an adapter takes it only while off the bus.

    :raises ValueError: the protocol has none for it; the message says which rates it has.
    """
    if rate not in BIT_RATES:
        raise ValueError(f'bit rate {rate}: there are {", ".join(map(str, BIT_RATES))}')
    return b'S%d' % BIT_RATES[rate] + CR


class Reader:
    """Finds the lines of an adapter in the bytes that come in, in any pieces."""

    def __init__(self) -> None:
        self._line = b''

    @property
    def pending(self) -> int:
        """How many bytes have come of a line that is not complete yet."""
        return len(self._line)

    def feed(self, data: bytes) -> Output:
        """Take bytes that came in; return what the lines say that they complete."""
        *lines, rest = (self._line + data).replace(BEL, BEL + CR).split(CR)
        # what is longer than any line is no line, however it ends
        self._line = rest[-_LONGEST_LINE:]
        frames = [frame for line in lines if (frame := _decode(line)) is not None]
        done = sum(line in (b'', b'z', b'Z') for line in lines)
        said = [int(match[1], 16) for line in lines if (match := _FLAGS_LINE.fullmatch(line))]
        refused = sum(line.endswith(BEL) for line in lines)
        return Output(frames, done, refused, said[-1] if said else None)


def _decode(line: bytes) -> Frame | None:
    """Return the frame of a line without its end; ``None`` if it is none."""
    match = _FRAME.fullmatch(line)
    if match is None:
        return None
    length = 2 * int(match[2])
    if len(match[3]) not in (length, length + _STAMP):
        return None
    return Frame(int(match[1], 16), bytes.fromhex(match[3][:length].decode()))


def _trouble(flags: int) -> str:
    """Return what an adapter with these status flags, which refuses a frame, has to say."""
    found = ', '.join(text for bit, text in _FLAGS.items() if flags & bit)
    return f'{CANNOT_SEND} (status flags of the adapter: {flags:02X}, {found or "no error"})'


#: How long an adapter may take to confirm a command, s; some never do.
_REPLY_TIME = 0.1
#: How long it has to be silent before it is set up, s: longer when it seemed to refuse.
_SILENCES = (0.1, 0.2, 0.4)
#: How long at most to wait for that silence, s.
_LONGEST_TALK = 1.0


class LawicelPort:
    """
    One adapter; it is on the bus as long as the port is open.

    After too many errors it leaves the bus by itself (bus-off), and refuses every frame until it
    was taken off the bus and onto it again, as :meth:`open` does. One that restarts when its port
    is opened hears none of that; so as long as nothing has shown that it is on the bus, it is taken
    onto it ahead of every frame.

    :param rate: bit rate of the bus, bit/s.
    :raises ValueError: there is no such bit rate; the message says which ones there are.
    """

    remark = ''

    def __init__(self, port: Port, rate: int, now: Clock = time.monotonic) -> None:
        self._now = now
        self._port = port
        self._rate = rate
        self._set_rate = bit_rate(rate)
        self._reader = Reader()
        self._is_on_bus = False
        self.trouble = ''

    @property
    def place(self) -> str:
        """Where the adapter is."""
        return self._port.place

    def open(self) -> None:
        """
        Open the port, and take the adapter onto the bus.

        :raises PortError: the port cannot be opened, or the adapter refuses the bit rate.
        """
        self._port.open()
        self._reader = Reader()
        self.trouble = ''
        try:
            for silence in _SILENCES:
                refused = self._set_up(silence)
                if not refused:
                    return
            raise PortError(refused)
        except PortError:
            self._port.close()
            raise

    def close(self) -> None:
        """Take the adapter off the bus and close the port; harmless when it is closed already."""
        with contextlib.suppress(PortError):
            self._port.write(CLOSE)
        self._port.close()

    def send(self, frame: Frame) -> None:
        """Hand a frame over."""
        if not self._is_on_bus:
            self._port.write(self._set_rate)
            self._port.write(OPEN)
        self._port.write(encode(frame))

    def receive(self, until: float) -> Sequence[Frame]:
        """Return what has come; wait for the first bytes until a moment of ``time.monotonic``."""
        output = self._reader.feed(self._port.read(until))
        if output.frames or output.done:
            self._is_on_bus = True
        if output.frames:
            self.trouble = ''
        elif output.flags is not None:
            self.trouble = _trouble(output.flags)
        elif output.refused and not self.trouble:
            # the answer comes as any other
            self.trouble = CANNOT_SEND
            self._port.write(FLAGS)
        return output.frames

    def _set_up(self, silence: float) -> str:
        """Take the adapter onto the bus after so long a silence, s; return why it refused."""
        # an earlier program may have left it on the bus, in the middle of a line
        self._port.write(FLUSH)
        self._port.write(CLOSE)
        self._hear_out(silence)
        if self._ask(self._set_rate).refused:
            return f'the adapter cannot do {self._rate} bit/s on the CAN bus'
        opened = self._ask(OPEN)
        if opened.refused:
            return 'the adapter does not go onto the CAN bus: unplug it and try again'
        self._is_on_bus = opened.done > 0
        return ''

    def _hear_out(self, silence: float) -> None:
        """Wait until it is silent: a late answer would count for another command."""
        now = self._now()
        end = now + _LONGEST_TALK
        while now < end and self._port.read(min(now + silence, end)):
            now = self._now()
        self._reader = Reader()

    def _ask(self, command: bytes) -> Output:
        """Send a command alone, and return the answer of the adapter."""
        self._port.write(command)
        until = self._now() + _REPLY_TIME
        output = self._reader.feed(b'')
        while not output.done and not output.refused and self._now() < until:
            output = self._reader.feed(self._port.read(until))
        return output
