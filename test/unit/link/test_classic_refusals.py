# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Why a drive refuses over Classic, and what is asked to find that out."""

from __future__ import annotations

import classic_far_end as far
from classic_far_end import INV_ST, SIO_ERR, Fate
from classic_link_bench import A, Bench
import pytest
from support.addresses import classic_id

from nfo_sinus_driver.link.interface import Refused

# --- refusals -------------------------------------------------------------------------------------


def test_enquiry_refused() -> None:
    bench = Bench(Fate(what='refuse'))
    with pytest.raises(Refused, match='no parameter E001E') as raised:
        bench.read(A)
    assert raised.value.code == Refused.ILLEGAL_ADDRESS
    assert bench.asked == [0x1E]


def refusal_bench(inv_st: int, sio_err: int = 0) -> Bench:
    """A drive that refuses what is written, and gives this as its reason."""
    bench = Bench(Fate(what='refuse'))
    bench.drive.values = {INV_ST: inv_st, SIO_ERR: sio_err}
    return bench


def test_refused_without_a_fault() -> None:
    bench = refusal_bench(37)
    error = bench.refused(Refused.ILLEGAL_VALUE, 'does not accept this value', 'InvSt 37')
    assert not error.maybe_done
    assert bench.asked == [0x1E, INV_ST]


@pytest.mark.parametrize('code', [1, 12, 15, 23])
def test_refused_because_a_fault_stands(code: int) -> None:
    bench = refusal_bench(code, 1 << 10)
    bench.refused(Refused.DEVICE_FAILURE, 'a fault is active', f'InvSt {code}')
    assert bench.asked == [0x1E, INV_ST]


def test_a_serial_fault_that_may_have_stood_before_is_not_acknowledged() -> None:
    bench = refusal_bench(14, 1 << 10)
    bench.refused(Refused.DEVICE_FAILURE, 'Sio Fail')
    assert SIO_ERR not in bench.asked
    assert far.INV_ST_ACK not in bench.asked


def own_fault_bench(before: int, pause: float, sio_err: int) -> Bench:
    """A drive that refuses, with a serial fault; what it said before, and how long ago."""
    bench = refusal_bench(14, sio_err)
    bench.drive.values[INV_ST] = before
    bench.drive.heal(Fate(), Fate(what='refuse'))
    bench.read(classic_id(INV_ST))
    bench.wire.now += pause
    bench.drive.values[INV_ST] = 14
    return bench


@pytest.mark.parametrize(
    ('flags', 'code', 'words'),
    [
        (1 << 10, Refused.ILLEGAL_VALUE, ['out of range']),
        (1 << 6, Refused.DEVICE_FAILURE, ['not permitted in the current mode']),
        (1 << 7, Refused.ILLEGAL_ADDRESS, ['unknown parameter']),
        (1 << 9, Refused.ILLEGAL_ADDRESS, ['cannot be written']),
        (1 << 2, Refused.DEVICE_FAILURE, ['wrong check sum']),
        (1 << 1 | 1 << 14, Refused.DEVICE_FAILURE, ['wrong parity', 'overrun']),
        (0, Refused.DEVICE_FAILURE, ['does not say why']),
        (1 << 13, Refused.DEVICE_FAILURE, ['flag 13']),
    ],
)
def test_a_serial_fault_by_this_very_write_is_read_and_cleared(
    flags: int, code: int, words: list[str]
) -> None:
    bench = own_fault_bench(38, 0.5, flags)
    bench.refused(code, *words, 'Sio Fail')
    assert bench.asked == [INV_ST, 0x1E, INV_ST, SIO_ERR]


@pytest.mark.parametrize(('before', 'pause'), [(14, 0.1), (38, 1.5)])
def test_a_serial_fault_that_is_old_or_may_be_is_left(before: int, pause: float) -> None:
    bench = own_fault_bench(before, pause, 1 << 10)
    bench.refused(Refused.DEVICE_FAILURE, 'Sio Fail')
    assert SIO_ERR not in bench.asked


def test_what_was_known_of_a_drive_ends_with_the_connection() -> None:
    bench = own_fault_bench(38, 0.1, 1 << 10)
    bench.link.close()
    bench.link.open()
    bench.refused(Refused.DEVICE_FAILURE, 'Sio Fail')
    assert SIO_ERR not in bench.asked


def test_a_reason_that_is_not_known() -> None:
    bench = Bench(Fate(what='refuse'), Fate(what='drop'))
    bench.refused(Refused.DEVICE_FAILURE, 'why is not known')
