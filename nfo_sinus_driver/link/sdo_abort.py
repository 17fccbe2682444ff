# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Why a server of CANopen ended a transfer: the abort codes, and what each means (CiA 301)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from nfo_sinus_driver.link.interface import Refused

#: What a client says that has waited in vain.
TIMED_OUT = 0x0504_0000
#: The object has no such sub-index.
NO_SUB_INDEX = 0x0609_0011
#: The value has another length there: any other, a shorter one, a longer one.
WRONG_LENGTH, TOO_LONG, TOO_SHORT = 0x0607_0010, 0x0607_0012, 0x0607_0013


class Aborted(Refused):
    """
    The node has ended the transfer.

    :ivar abort: with which of :data:`ABORT_CODES`.
    """

    def __init__(self, abort: int, kind: int, reason: str) -> None:
        super().__init__(kind, reason)
        self.abort = abort


class AbortCode(NamedTuple):
    """
    What an abort code says.

    :ivar kind: the code of :class:`Refused` that means the same.
    """

    kind: int
    meaning: str


_FUNCTION = Refused.ILLEGAL_FUNCTION
_NO_SUCH = Refused.ILLEGAL_ADDRESS
_VALUE = Refused.ILLEGAL_VALUE
_STATE = Refused.DEVICE_FAILURE

ABORT_CODES: Mapping[int, AbortCode] = {
    0x0503_0000: AbortCode(_STATE, 'the toggle bit did not alternate'),
    TIMED_OUT: AbortCode(_STATE, 'the drive waited in vain for the next segment'),
    0x0504_0001: AbortCode(_FUNCTION, 'the drive does not know this command'),
    0x0504_0002: AbortCode(_FUNCTION, 'invalid block size'),
    0x0504_0003: AbortCode(_FUNCTION, 'invalid sequence number'),
    0x0504_0004: AbortCode(_STATE, 'a check sum was wrong'),
    0x0504_0005: AbortCode(_STATE, 'the drive is out of memory'),
    0x0601_0000: AbortCode(_NO_SUCH, 'the object does not support this access'),
    0x0601_0001: AbortCode(_NO_SUCH, 'the object can only be written'),
    0x0601_0002: AbortCode(_NO_SUCH, 'the object can only be read'),
    0x0602_0000: AbortCode(_NO_SUCH, 'the drive has no such object'),
    0x0604_0041: AbortCode(_STATE, 'the object cannot be mapped to the process data'),
    0x0604_0042: AbortCode(_STATE, 'the process data would be too long'),
    0x0604_0043: AbortCode(_STATE, 'the parameters do not fit together'),
    0x0604_0047: AbortCode(_STATE, 'the drive is not compatible within itself'),
    0x0606_0000: AbortCode(_STATE, 'a hardware error of the drive'),
    WRONG_LENGTH: AbortCode(_VALUE, 'the value has the wrong length'),
    TOO_LONG: AbortCode(_VALUE, 'the value is too long'),
    TOO_SHORT: AbortCode(_VALUE, 'the value is too short'),
    NO_SUB_INDEX: AbortCode(_NO_SUCH, 'the object has no such sub-index'),
    0x0609_0030: AbortCode(_VALUE, 'the drive does not accept this value'),
    0x0609_0031: AbortCode(_VALUE, 'the value is too large'),
    0x0609_0032: AbortCode(_VALUE, 'the value is too small'),
    0x0609_0036: AbortCode(_VALUE, 'the maximum is less than the minimum'),
    0x060A_0023: AbortCode(_STATE, 'what it takes is not available'),
    0x0800_0000: AbortCode(_STATE, 'the drive refused'),
    0x0800_0020: AbortCode(_STATE, 'the drive cannot transfer or store the value'),
    0x0800_0021: AbortCode(_STATE, 'the drive cannot do this: it is under local control'),
    0x0800_0022: AbortCode(_STATE, 'the drive cannot do this in its present state'),
    0x0800_0023: AbortCode(_STATE, 'the drive has no list of its objects'),
    0x0800_0024: AbortCode(_STATE, 'there is no value'),
}
_UNKNOWN = AbortCode(_STATE, 'the drive refused')


def refusal(code: int) -> Aborted:
    """Return what an abort says."""
    kind, meaning = ABORT_CODES.get(code, _UNKNOWN)
    return Aborted(code, kind, f'{meaning} (SDO abort {code:08X}h)')
