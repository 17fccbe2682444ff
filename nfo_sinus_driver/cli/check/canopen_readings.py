# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a node shows of its readings over CANopen."""

from __future__ import annotations

from nfo_sinus_driver.cli.check.sight import CanopenSight
from nfo_sinus_driver.cli.check.verdict import Found, Looks, judged

LOOKS = Looks()

#: The status, of which one sub-index acknowledges: 1, or 0 where they begin at 0.
_INVERTER_STATUS, _WITHOUT_ACKNOWLEDGE = 0x2026, 2
_NO_SUB_INDEX = 0x06090011


def _object(sight: CanopenSight, index: int, sub_index: int = 0) -> str:
    data = sight.value(index, sub_index)
    code = sight.aborted_with(index, sub_index)
    came = 'no answer' if code is None else f'abort {code:08X}h'
    return f'{index:04X}h.{sub_index}: {came if data is None else data.hex(" ")}'


@LOOKS.add
def _error_log_object(sight: CanopenSight) -> Found:
    indices = 0x2F7C, 0x4F7D
    right = any(sight.value(index) is not None for index in indices)
    return judged(right, ', '.join(_object(sight, index) for index in indices))


@LOOKS.add
def _status_object(sight: CanopenSight) -> Found:
    place = _INVERTER_STATUS, _WITHOUT_ACKNOWLEDGE
    data = sight.value(*place)
    if data is None:
        return judged(sight.aborted_with(*place) == _NO_SUB_INDEX, _object(sight, *place))
    code = int.from_bytes(data, 'little')
    return judged(code in sight.model.status_codes, _object(sight, *place))


@LOOKS.add
def _drive_profile(sight: CanopenSight) -> Found:
    # StatusWord and the mode
    indices = 0x6041, 0x6061
    right = all(sight.value(index) is not None for index in indices)
    return judged(right, ', '.join(_object(sight, index) for index in indices))
