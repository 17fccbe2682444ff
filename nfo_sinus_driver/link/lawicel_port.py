# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A CAN bus behind an adapter that speaks LAWICEL's protocol on a serial port."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import time

from nfo_sinus_driver.link import lawicel
from nfo_sinus_driver.link.can import CANNOT_SEND, Frame
from nfo_sinus_driver.link.interface import Clock, PortError
from nfo_sinus_driver.link.port import Port

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
        self._set_rate = lawicel.bit_rate(rate)
        self._reader = lawicel.Reader()
        self.trouble = ''

    def open(self) -> None:
        """
        Open the port, and take the adapter onto the bus.

        :raises PortError: the port cannot be opened, or the adapter refuses the bit rate.
        """
        self._port.open()
        self._reader = lawicel.Reader()
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
            self._port.write(lawicel.CLOSE)
        self._port.close()

    def send(self, frame: Frame) -> None:
        """Hand a frame over."""
        self._port.write(lawicel.encode(frame))

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
        self._port.write(lawicel.FLUSH)
        self._port.write(lawicel.CLOSE)
        self._hear_out(silence)
        if self._ask(self._set_rate).refused:
            return f'the adapter cannot do {self._rate} bit/s on the CAN bus'
        if self._ask(lawicel.OPEN).refused:
            return 'the adapter does not go onto the CAN bus: unplug it and try again'
        return ''

    def _hear_out(self, silence: float) -> None:
        """Wait until it says nothing more: a late answer would count for another command."""
        now = self._now()
        end = now + _LONGEST_TALK
        while now < end and self._port.read(min(now + silence, end)):
            now = self._now()
        self._reader = lawicel.Reader()

    def _ask(self, command: bytes) -> lawicel.Heard:
        """Return what the adapter says to a command that was given alone."""
        self._port.write(command)
        until = self._now() + _REPLY_TIME
        heard = self._reader.feed(b'')
        while not heard.done and not heard.refused and self._now() < until:
            heard = self._reader.feed(self._port.read(until))
        return heard
