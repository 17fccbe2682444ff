# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
WRREC and RDREC of a PLC: records to a drive and from it, beside the telegrams.

Each takes its time after the edge of REQ. A drive carries out a request when its record arrives,
and keeps the response until it is fetched.
"""

from __future__ import annotations

from typing import Any

from nfo_sinus_driver.simulator.parameter_channel import ParameterChannel

#: Bytes of a record.
_RECORD = 16


class Records:
    """
    The two blocks for one drive, with the program that asks by them.

    :param program: ``FB_RosParameter``.
    :param seconds: how long each takes (s).
    """

    def __init__(self, program: Any, seconds: float = 0.02) -> None:
        self._program = program
        self._seconds = seconds
        #: Which of the two is under way, and until when.
        self._busy = ''
        self._until = 0.0
        #: What the drive has answered.
        self._response: bytes | None = None

    def run(self, now: float, mailbox: Any, drive: ParameterChannel | None) -> None:
        """
        Run once.

        :param mailbox: ``FB_RosMailbox``, which wants an access, and is given its result.
        :param drive: what answers there, ``None`` while it is not reached.
        """
        program = self._program
        ended = self._ended(now)
        written, read, reached = ended == 'write', ended == 'read', drive is not None
        if written and drive is not None:
            self._response = drive.answer(bytes(program.record[: program.length]))
        program.request, program.command = mailbox.request, mailbox.command
        program.pnu, program.sub_index = mailbox.pnu, mailbox.sub_index
        program.value_high, program.value_low = mailbox.value_high, mailbox.value_low
        program.written, program.write_failed = written and reached, written and not reached
        there = self._response is not None
        program.came, program.not_yet = read and reached and there, read and reached and not there
        program.read_failed = read and not reached
        program.response = [*(self._response or b''), *[0] * _RECORD][:_RECORD]
        program()
        mailbox.done, mailbox.done_result = program.done, program.result
        mailbox.done_high, mailbox.done_low = program.high, program.low

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
