# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The parameter mailbox of the PLC, the same as ``config/telegram1/ros_mailbox.st`` has it.

As with :mod:`plc_program`, a test runs this and the Structured Text over the same cycles. Two
function blocks: the mailbox of one drive, and how a parameter is read and written by the records of
PROFIdrive, which the PLC's WRREC sends and RDREC fetches.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
import struct

_LAYOUT = struct.Struct('>6H4x4H')
#: Registers of a mailbox, where the first stands in the block, and how many the driver writes.
REGISTERS, FIRST, WRITTEN = 12, 16, 6

#: Bytes of a record.
RECORD = 16


@dataclass
class Mailbox:
    """
    The registers of a mailbox, +16 to +27 of a block of layout 2.

    :ivar number: +16, of the request; the driver changes it last.
    :ivar command: +17, 1 read, 2 write.
    :ivar pnu: +18.
    :ivar sub_index: +19.
    :ivar value_high: +20, to be written.
    :ivar value_low: +21.
    :ivar answered: +24, number of the request that is answered; the PLC writes it last.
    :ivar result: +25, as the interface says.
    :ivar read_high: +26, what was read.
    :ivar read_low: +27, or the drive's error number.
    """

    number: int = 0
    command: int = 0
    pnu: int = 0
    sub_index: int = 0
    value_high: int = 0
    value_low: int = 0
    answered: int = 0
    result: int = 0
    read_high: int = 0
    read_low: int = 0

    def registers(self) -> tuple[int, ...]:
        """Return the mailbox as it stands in holding registers."""
        data = _LAYOUT.pack(*(getattr(self, one.name) for one in fields(self)))
        return struct.unpack(f'>{REGISTERS}H', data)

    def put(self, offset: int, words: tuple[int, ...]) -> None:
        """Set registers that are the driver's, from ``offset`` of it on."""
        for one, word in zip(fields(self)[offset:WRITTEN], words, strict=False):
            setattr(self, one.name, word)


class RosMailbox:
    """
    The function block ``FB_RosMailbox``: one access at a time, for one drive.

    :ivar request: an access is wanted, with what follows, until it has ended.
    """

    def __init__(self) -> None:
        # VAR_OUTPUT
        self.request = False
        self.command = 0
        self.pnu = 0
        self.sub_index = 0
        self.value_high = 0
        self.value_low = 0
        # VAR
        self.started = False
        self.seen_number = 0
        self.given_up = False

    def __call__(
        self, mailbox: Mailbox, access: bool, done: bool, result: int, high: int, low: int
    ) -> None:
        """
        Run once.

        :param mailbox: the registers.
        :param access: the PLC can reach parameters of the drive.
        :param done: the access that was wanted has ended since, with the rest.
        :param result: as +25 says it.
        :param high: what was read.
        :param low: likewise, or the drive's error number.
        """
        if not self.started:
            self.started = True
            self.seen_number = mailbox.number
        elif self.request and done:
            self.request = False
            if not self.given_up:
                mailbox.read_high = high
                mailbox.read_low = low
                mailbox.result = result
                mailbox.answered = self.seen_number
        elif mailbox.number != self.seen_number:
            self.seen_number = mailbox.number
            if mailbox.number == 0:
                self.given_up = True
            elif self.request:
                self.given_up = True
                mailbox.result = 3
                mailbox.answered = mailbox.number
            elif not access or mailbox.command < 1 or mailbox.command > 2:
                mailbox.result = 4
                mailbox.answered = mailbox.number
            else:
                self.command = mailbox.command
                self.pnu = mailbox.pnu
                self.sub_index = mailbox.sub_index
                self.value_high = mailbox.value_high
                self.value_low = mailbox.value_low
                self.given_up = False
                self.request = True
                mailbox.result = 3


class RosParameter:
    """
    The function block ``FB_RosParameter``: a parameter by the records of PROFIdrive.

    A request goes out by WRREC, its response is fetched by RDREC. A write has to name the format of
    the parameter, so it is read first.

    :param axis: the drive object in the request.

    :ivar write_record: WRREC shall send :attr:`record`, so many bytes as :attr:`length`.
    :ivar read_record: RDREC shall fetch the response.
    :ivar done: the access has ended, with :attr:`result`, :attr:`high` and :attr:`low`.
    """

    def __init__(self, axis: int = 0) -> None:
        # VAR_INPUT with an initial value
        self.axis = axis
        # VAR_OUTPUT
        self.write_record = False
        self.read_record = False
        self.record = [0] * RECORD
        self.length = 0
        self.done = False
        self.result = 0
        self.high = 0
        self.low = 0
        # VAR
        self.step = 0
        self.format = 0

    def __call__(
        self,
        mailbox: RosMailbox,
        written: bool,
        write_failed: bool,
        came: bool,
        not_yet: bool,
        read_failed: bool,
        response: list[int],
    ) -> None:
        """
        Run once.

        :param mailbox: what is wanted.
        :param written: WRREC has sent the record (DONE).
        :param write_failed: it could not (ERROR).
        :param came: RDREC has fetched the response (VALID).
        :param not_yet: the drive has none yet (ERROR, state conflict): it is fetched again.
        :param read_failed: it could not for another reason (ERROR).
        :param response: what RDREC has fetched.
        """
        if not mailbox.request:
            self.step = 0
        elif self.step == 0:
            if self.record[0] == 255:
                self.record[0] = 1
            else:
                self.record[0] = self.record[0] + 1
            self.record[1] = 1
            self.record[2] = self.axis
            self.record[3] = 1
            self.record[4] = 16
            self.record[5] = 1
            self.record[6] = mailbox.pnu >> 8
            self.record[7] = mailbox.pnu & 0xFF
            self.record[8] = mailbox.sub_index >> 8
            self.record[9] = mailbox.sub_index & 0xFF
            self.length = 10
            self.step = 1
        elif self.step == 1:
            if write_failed:
                self.result = 4
                self.step = 4
            elif written:
                self.step = 2
        elif self.step == 3:
            # RDREC begins anew by an edge
            self.step = 2
        elif self.step == 2:
            if read_failed:
                self.result = 4
                self.step = 4
            elif not_yet:
                self.step = 3
            elif came:
                self.high = 0
                self.low = 0
                self.step = 4
                if response[0] != self.record[0]:
                    self.result = 4
                elif response[1] >= 128:
                    self.low = response[6] << 8 | response[7]
                    self.result = 1
                    if self.low == 0 or self.low == 3:
                        self.result = 2
                elif response[1] == 2:
                    self.result = 0
                else:
                    self.format = response[4]
                    self.result = 0
                    if mailbox.command == 2:
                        self._change(mailbox)
                    elif self.format == 67 or self.format == 4 or self.format == 7:
                        self.high = response[6] << 8 | response[7]
                        self.low = response[8] << 8 | response[9]
                    elif self.format == 65 or self.format == 2 or self.format == 5:
                        self.low = response[6]
                    else:
                        self.low = response[6] << 8 | response[7]
        self.write_record = self.step == 1
        self.read_record = self.step == 2
        self.done = self.step == 4

    def _change(self, mailbox: RosMailbox) -> None:
        """Make the record by which the parameter is changed, in the format that it has."""
        self.record[0] = self.record[0] % 255 + 1
        self.record[1] = 2
        self.record[10] = self.format
        self.record[11] = 1
        words = mailbox.value_high, mailbox.value_low
        data = struct.pack('>HH', *words)
        if self.format in (67, 4, 7):
            self.record[12:16] = data
            self.length = 16
        elif self.format in (65, 2, 5):
            self.record[12:14] = [data[3], 0]
            self.length = 14
        else:
            self.record[12:14] = data[2:]
            self.length = 14
        self.step = 1
