# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Another master on a line: its answers are not taken for ours."""

from __future__ import annotations

import classic_far_end
import classic_link_bench
from link_bench import Bench as RtuBench
import movitrac_bench
import movitrac_far_end
import pytest

from nfo_sinus_driver.link import classic, movitrac, rtu
from nfo_sinus_driver.link.interface import DamagedAnswer
from nfo_sinus_driver.link.modbus_link import ReportSlaveId

OTHER_VALUE = bytes.fromhex('000000aa')


def classic_bench(*fates: str) -> classic_link_bench.Bench:
    return classic_link_bench.Bench(*[classic_far_end.Fate(what=fate) for fate in fates])


def movitrac_line(*fates: str) -> movitrac_bench.Bench:
    return movitrac_bench.Bench(*[movitrac_far_end.Fate(what=fate) for fate in fates])


def test_the_ack_to_another_master_confirms_no_write_of_ours_on_classic() -> None:
    bench = classic_bench('drop')
    begun = bench.wire.arrive(bench.wire.now, classic.encode(classic.Select(1, 0xB6, 5)))
    bench.wire.arrive(begun + 0.05, classic_far_end.verdict(1, True))
    with pytest.raises(DamagedAnswer) as raised:
        bench.write(classic_link_bench.A, 5)
    assert raised.value.maybe_done
    assert bench.link.remarks.foreign_frames == 1


def test_the_ack_to_another_master_confirms_no_write_of_ours_on_a_movitrac() -> None:
    bench = movitrac_line('drop')
    request = movitrac.Select(2, 0x11C, OTHER_VALUE)
    begun = bench.wire.arrive(bench.wire.now, movitrac.encode(request))
    bench.wire.arrive(begun + 0.05, movitrac_far_end.ACK)
    with pytest.raises(DamagedAnswer) as raised:
        bench.write(movitrac_bench.A)
    assert raised.value.maybe_done
    assert bench.link.remarks.foreign_frames == 1


def test_what_another_drive_says_to_another_master_is_no_value_of_ours() -> None:
    # the same index, and the answer names no drive
    bench = movitrac_line()
    request = movitrac.Enquiry(2, movitrac_bench.A.index)
    answer = movitrac_far_end.data(movitrac_bench.A.index, OTHER_VALUE)
    # as if it had begun just after ours
    bench.read(movitrac_bench.B)
    begun = bench.wire.now + 6 * movitrac_bench.CHAR
    bench.drive.heal(movitrac_far_end.Fate(what='drop'))
    bench.wire.arrive(begun, movitrac.encode(request) + answer)
    assert bench.read(movitrac_bench.A).data == bench.answer_of(len(bench.asked) - 1) != OTHER_VALUE
    assert bench.link.remarks.foreign_frames == 1


def test_a_request_that_comes_twice_is_no_answer_to_itself() -> None:
    # function 17 is asked by the very beginning of its answer
    frame = rtu.encode(ReportSlaveId(1))
    answer = bytes((1, 17, 1, 65))
    link = RtuBench().link
    assert not link._another.was_answered_in(frame + frame)
    assert link._another.was_answered_in(frame + answer + rtu.crc(answer))
