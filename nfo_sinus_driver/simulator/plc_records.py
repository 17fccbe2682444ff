# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
WRREC and RDREC of a PLC: records to a drive and from it, beside the telegrams.

Each takes its time after the edge of REQ. A drive carries out a request when its record arrives,
and keeps the response until it is fetched.
"""

from __future__ import annotations

from nfo_sinus_driver.simulator.parameter_channel import ParameterChannel
from nfo_sinus_driver.simulator.plc_mailbox import RECORD, RosMailbox, RosParameter


class Records:
    """
    The two blocks for one drive, with the program that asks by them.

    :param seconds: how long each takes (s).
    """

    def __init__(self, seconds: float = 0.02) -> None:
        self._seconds = seconds
        self._program = RosParameter()
        #: Which of the two is under way, and until when.
        self._busy = ''
        self._until = 0.0
        #: What the drive has answered.
        self._response: bytes | None = None

    @property
    def ended(self) -> tuple[bool, int, int, int]:
        """Whether an access has ended, and with what."""
        one = self._program
        return one.done, one.result, one.high, one.low

    def run(self, now: float, mailbox: RosMailbox, drive: ParameterChannel | None) -> None:
        """Run once; ``drive`` is what answers there, ``None`` while it is not reached."""
        program = self._program
        ended = self._ended(now)
        sent = fetched = failed = not_yet = False
        if ended and drive is None:
            failed = True
        elif ended == 'write':
            sent = True
            assert drive is not None
            self._response = drive.answer(bytes(program.record[: program.length]))
        elif ended == 'read':
            fetched = self._response is not None
            not_yet = not fetched
        response = [*(self._response or b''), *[0] * RECORD][:RECORD]
        write_failed, read_failed = failed and ended == 'write', failed and ended == 'read'
        program(mailbox, sent, write_failed, fetched, not_yet, read_failed, response)

    def _ended(self, now: float) -> str:
        """Return which of the two has ended just now, and begin what REQ asks for."""
        wanted = 'write' if self._program.write_record else ''
        wanted = 'read' if self._program.read_record else wanted
        if wanted != self._busy:
            self._busy, self._until = wanted, now + self._seconds
        if not wanted or now < self._until - 1e-9:
            return ''
        self._busy = ''
        return wanted
