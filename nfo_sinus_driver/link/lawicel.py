# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A CAN bus behind an adapter that speaks LAWICEL's protocol, which Linux calls slcan.

A line ends with CR: ``t`` identifier (three digits) length data; ``r`` and no data is a remote
frame, which is only sent. A BEL stands for *no* in place of
a line; an empty line, ``z`` and ``Z`` stand for *done*. Digits are sent in upper case and read in
both. Lines of other kinds, such as those of extended and remote frames, are passed over.
"""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import re
import time
from typing import NamedTuple

from nfo_sinus_driver.link.can import CANNOT_SEND, IDENTIFIERS, MOST_DATA, Frame
from nfo_sinus_driver.link.interface import Clock, PortError
from nfo_sinus_driver.link.port import Port

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
#: In place of a line: the adapter did not do it.
BEL = b'\a'
#: A command that takes the adapter off the bus; it refuses it when it is off it.
CLOSE = b'C' + CR
#: A command that takes the adapter onto the bus.
OPEN = b'O' + CR
#: Ends whatever an earlier program left half said; an adapter refuses or ignores it.
FLUSH = 3 * CR

#: The longest line that counts: a frame with eight bytes, a time stamp and a CR behind it.
_LONGEST_LINE = 26
#: A frame, with a time stamp or without.
_FRAME = re.compile(rb't([0-7][0-9A-Fa-f]{2})([0-8])((?:[0-9A-Fa-f]{2})*)')
_STAMP = 4


class Heard(NamedTuple):
    """
    What an adapter said.

    :ivar frames: in their order.
    :ivar done: how often it said that something was done.
    :ivar refused: how often it said *no*.
    """

    frames: Sequence[Frame]
    done: int
    refused: int


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
    Return the command that sets a bit rate; an adapter takes it off the bus alone.

    :raises ValueError: the protocol has none for it; the message says which there are.
    """
    if rate not in BIT_RATES:
        raise ValueError(f'bit rate {rate}: there are {", ".join(map(str, BIT_RATES))}')
    return b'S%d' % BIT_RATES[rate] + CR


class Reader:
    """Finds what an adapter says in the bytes that come in, in whatever pieces."""

    def __init__(self) -> None:
        self._line = b''

    @property
    def pending(self) -> int:
        """How many bytes have come of a line that is not whole yet."""
        return len(self._line)

    def feed(self, data: bytes) -> Heard:
        """Take bytes that came in; return what the lines that became whole say."""
        *lines, rest = (self._line + data).replace(BEL, BEL + CR).split(CR)
        # what is longer than any line is no line, however it ends
        self._line = rest[-_LONGEST_LINE:]
        frames = [frame for line in lines if (frame := _decode(line)) is not None]
        done = sum(line in (b'', b'z', b'Z') for line in lines)
        return Heard(frames, done, sum(line.endswith(BEL) for line in lines))


def _decode(line: bytes) -> Frame | None:
    """Return the frame of a line without its end; ``None`` if it is none."""
    match = _FRAME.fullmatch(line)
    if match is None:
        return None
    length = 2 * int(match[2])
    if len(match[3]) not in (length, length + _STAMP):
        return None
    return Frame(int(match[1], 16), bytes.fromhex(match[3][:length].decode()))


#: How long an adapter may take to say that it has done something, s; some never say it.
_REPLY_TIME = 0.1
#: For how long it has to be silent before it is set up, s: longer when it seemed to refuse.
_SILENCES = (0.1, 0.2, 0.4)
#: For how long at most it is waited that it has nothing more to say, s.
_LONGEST_TALK = 1.0


class LawicelPort:
    """
    One adapter; it is on the bus as long as the port is open.

    :param rate: bit rate of the bus, bit/s.
    :raises ValueError: there is no such bit rate; the message says which there are.
    """

    def __init__(self, port: Port, rate: int, now: Clock = time.monotonic) -> None:
        self._now = now
        self._port = port
        self._rate = rate
        self._set_rate = bit_rate(rate)
        self._reader = Reader()
        self.trouble = ''

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
        self._port.write(encode(frame))

    def receive(self, until: float) -> Sequence[Frame]:
        """Return what has come; wait for the first bytes until a moment of ``time.monotonic``."""
        heard = self._reader.feed(self._port.read(until))
        if heard.refused:
            self.trouble = CANNOT_SEND
        elif heard.frames:
            self.trouble = ''
        return heard.frames

    def _set_up(self, silence: float) -> str:
        """Take the adapter onto the bus after so long a silence, s; return what it refused."""
        # an earlier program may have left it on the bus, in the middle of a line
        self._port.write(FLUSH)
        self._port.write(CLOSE)
        self._hear_out(silence)
        if self._ask(self._set_rate).refused:
            return f'the adapter cannot do {self._rate} bit/s on the CAN bus'
        if self._ask(OPEN).refused:
            return 'the adapter does not go onto the CAN bus: unplug it and try again'
        return ''

    def _hear_out(self, silence: float) -> None:
        """Wait until it says nothing more: a late answer would count for another command."""
        now = self._now()
        end = now + _LONGEST_TALK
        while now < end and self._port.read(min(now + silence, end)):
            now = self._now()
        self._reader = Reader()

    def _ask(self, command: bytes) -> Heard:
        """Return what the adapter says to a command that was given alone."""
        self._port.write(command)
        until = self._now() + _REPLY_TIME
        heard = self._reader.feed(b'')
        while not heard.done and not heard.refused and self._now() < until:
            heard = self._reader.feed(self._port.read(until))
        return heard
