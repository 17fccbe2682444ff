# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a transaction costs the computer, in function calls: no more with many drives."""

from __future__ import annotations

import sys
from types import FrameType
from typing import Any

from support.addresses import register
from support.rig import SLICE, Rig

from nfo_sinus_driver.link import rtu
from nfo_sinus_driver.link.modbus_pdu import read_of

_TRANSACTIONS = 600


class Counter:
    """Counts what the driver calls, built-in functions too, but not what the line does."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, frame: FrameType, event: str, argument: Any) -> None:
        where = frame.f_code.co_filename
        if event in ('call', 'c_call') and 'nfo_sinus_driver' in where and 'simulator' not in where:
            self.calls += 1


def calls_per_transaction(drives: int) -> float:
    """Return what a transaction costs while drives are polled as fast as the line allows."""
    with Rig(drives=drives, poll_rate=50.0) as rig:
        rig.connect()
        rig.pass_time(0.2 * drives)
        begun, counter = len(rig.asked), Counter()
        sys.setprofile(counter)
        try:
            while len(rig.asked) < begun + _TRANSACTIONS:
                # and nothing of what the rig looks after
                rig.line.go_to(min(rig.bus.step(), rig.clock.now + SLICE))
        finally:
            sys.setprofile(None)
        return counter.calls / (len(rig.asked) - begun)


def test_a_transaction_costs_no_more_with_many_drives() -> None:
    alone = calls_per_transaction(1)
    among_many = calls_per_transaction(16)
    assert among_many <= 1.1 * alone


def test_a_request_that_comes_again_is_prepared_once() -> None:
    frame = rtu.encode(read_of(7, register(0x258, 2)))
    assert rtu.encode(read_of(7, register(0x258, 2))) is frame
    kept = rtu.encode.cache_info().maxsize
    assert kept is not None
    for unit in range(kept // 8 + 1):
        for number in range(8):
            rtu.encode(read_of(unit % 248, register(0x400 + unit // 248 * 8 + number)))
    assert rtu.encode.cache_info().currsize <= kept
