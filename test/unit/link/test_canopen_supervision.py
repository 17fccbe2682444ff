# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How nodes notice that the client is gone, and the client that a node has restarted."""

from __future__ import annotations

import itertools
import math

from canopen_bench import DROP, TIMEOUT, UNIT, A, Bench, Fate
from canopen_far_end import Server
import pytest
from support.plans import followed

from nfo_sinus_driver.link import Address, DamagedAnswer, NoAnswer, Reply
from nfo_sinus_driver.link.canopen.can import Frame
from nfo_sinus_driver.link.canopen.supervision import GUARDING_MEANS, HEARTBEAT_MEANS

BEAT = Frame(0x77F, b'\x05')
GUARD = Frame(0x705, b'\0', remote=True)
HEARTBEAT_OBJECTS = {(0x1016, 0): b'\1', (0x1016, 1): bytes(4)}
GUARDING_OBJECTS = {(0x100C, 0): bytes(2), (0x100D, 0): bytes(1)}
#: 1.5 s, of node 127.
WATCHES = bytes.fromhex('DC057F00')


class _Objects:
    """A bench on which a node has objects that keep what is written."""

    def __init__(self, objects: dict[tuple[int, int], bytes]) -> None:
        self.bench = Bench()
        self.server = self.bench.bus.servers[UNIT]
        self.server.objects.update(objects)
        self.bench.bus.kept |= objects.keys()

    def carry_out(self, seconds: float) -> str:
        link = self.bench.link
        return followed(link.supervision.watch(UNIT, seconds), link, UNIT)


def elapse(bench: Bench, seconds: float) -> list[tuple[float, Frame]]:
    """Serve for a while as the worker of a bus does; return what was sent beside requests."""
    before, until = len(bench.bus.other), bench.bus.now + seconds
    supervision = bench.link.supervision
    while (due := supervision.due) < until:
        bench.bus.now = max(due, bench.bus.now)
        supervision.serve()
    bench.bus.now = until
    return bench.bus.other[before:]


def test_a_line_without_requests_is_left_alone() -> None:
    bench = Bench()
    assert bench.link.supervision.due == math.inf
    bench.read(A)
    assert elapse(bench, 1.0) == []


def test_a_restart_is_noticed_without_requests() -> None:
    bench = Bench()
    bench.read(A)
    bench.bus.arrive(bench.bus.now + 0.5, Frame(0x705, b'\0'))
    elapse(bench, 1.0)
    assert bench.link.supervision.take_restarted() == {5}


def test_a_client_that_has_written_sends_its_heartbeat() -> None:
    bench = Bench()
    bench.write(A)
    assert len([frame for _, frame in elapse(bench, 2.0) if frame == BEAT]) >= 19
    bench.link.close()
    bench.link.open()
    assert elapse(bench, 1.0) == []


def test_a_client_that_waits_for_a_silent_node_sends_its_heartbeat() -> None:
    bench = Bench(Fate(), *[DROP] * 20)
    bench.write(A)
    for _ in range(20):
        with pytest.raises(NoAnswer):
            bench.read(A)
    beats = [when for when, frame in bench.bus.other if frame == BEAT]
    assert max(after - before for before, after in itertools.pairwise(beats)) < 0.11
    assert len(beats) >= 20 * TIMEOUT / 0.1 - 1


# --- watching -------------------------------------------------------------------------------------


def test_a_node_watches_over_the_heartbeat() -> None:
    far = _Objects(HEARTBEAT_OBJECTS | GUARDING_OBJECTS)
    assert far.carry_out(1.5) == HEARTBEAT_MEANS
    assert far.server.objects[0x1016, 1] == WATCHES
    # half of it at most is silent
    beats = [when for when, frame in elapse(far.bench, 3.0) if frame == BEAT]
    assert max(after - before for before, after in itertools.pairwise(beats)) <= 0.75
    assert GUARD not in [frame for _, frame in far.bench.bus.other]


def test_a_short_time_has_a_quick_heartbeat() -> None:
    far = _Objects(HEARTBEAT_OBJECTS)
    far.carry_out(0.1)
    beats = [when for when, frame in elapse(far.bench, 1.0) if frame == BEAT]
    assert max(after - before for before, after in itertools.pairwise(beats)) <= 0.05


def test_it_ends() -> None:
    far = _Objects(HEARTBEAT_OBJECTS)
    far.carry_out(1.5)
    assert far.carry_out(0.0) == ''
    assert far.server.objects[0x1016, 1] == bytes(4)
    # who has watched nothing is left alone
    before = len(far.bench.bus.begun)
    far.carry_out(0.0)
    assert len(far.bench.bus.begun) == before


def test_what_stands_there_already_is_not_written_again() -> None:
    far = _Objects({(0x1016, 0): b'\1', (0x1016, 1): WATCHES})
    assert far.carry_out(1.5) == HEARTBEAT_MEANS


def test_no_watch_of_another_client_is_taken_away() -> None:
    other = bytes.fromhex('E8030300')
    far = _Objects({(0x1016, 0): b'\2', (0x1016, 1): other, (0x1016, 2): bytes(4)})
    assert far.carry_out(1.5) == HEARTBEAT_MEANS
    assert (far.server.objects[0x1016, 1], far.server.objects[0x1016, 2]) == (other, WATCHES)
    full = _Objects({(0x1016, 0): b'\1', (0x1016, 1): other} | GUARDING_OBJECTS)
    assert full.carry_out(1.5) == GUARDING_MEANS
    assert full.server.objects[0x1016, 1] == other


@pytest.mark.parametrize('how', ['absent', 'refused', 'kept'])
def test_else_a_node_is_guarded(how: str) -> None:
    far = _Objects(GUARDING_OBJECTS | (HEARTBEAT_OBJECTS if how != 'absent' else {}))
    if how == 'refused':
        far.server.refuses[0x1016, 1] = 0x06010002
    elif how == 'kept':
        far.server.constant.add((0x1016, 1))
    assert far.carry_out(2.0) == GUARDING_MEANS
    period = int.from_bytes(far.server.objects[0x100C, 0], 'little') / 1000
    factor = far.server.objects[0x100D, 0][0]
    assert period * factor == pytest.approx(2.0)
    asked = [when for when, frame in elapse(far.bench, 5.0) if frame == GUARD]
    assert max(after - before for before, after in itertools.pairwise(asked)) <= 1.0
    far.carry_out(0.0)
    assert far.server.objects[0x100C, 0] == bytes(2) and far.server.objects[0x100D, 0] == b'\0'
    assert GUARD not in [frame for _, frame in elapse(far.bench, 5.0)]


def test_a_node_that_takes_another_time_is_left_with_none() -> None:
    far = _Objects(HEARTBEAT_OBJECTS)
    write = far.bench.link.write

    def rounded(unit: int, address: Address, data: bytes) -> Reply:
        return write(unit, address, bytes.fromhex('E8037F00') if data == WATCHES else data)

    far.bench.link.write = rounded  # type: ignore[method-assign]
    assert far.carry_out(1.5) == ''
    assert far.server.objects[0x1016, 1] == bytes(4)


def test_half_of_guarding_is_nothing() -> None:
    far = _Objects(GUARDING_OBJECTS)
    far.server.constant.add((0x100D, 0))
    assert far.carry_out(2.0) == ''
    assert far.server.objects[0x100C, 0] == bytes(2)
    assert GUARD not in [frame for _, frame in elapse(far.bench, 5.0)]


def test_a_node_that_has_nothing_for_it() -> None:
    far = _Objects({})
    assert far.carry_out(2.0) == ''


def test_a_step_without_an_answer_is_done_again() -> None:
    far = _Objects(HEARTBEAT_OBJECTS)
    link = far.bench.link
    plan = link.supervision.watch(UNIT, 1.5)
    step = plan.send(next(plan).carry_out(link, UNIT))
    far.bench.bus.heal(DROP)
    with pytest.raises(NoAnswer):
        step.carry_out(link, UNIT)
    with pytest.raises(StopIteration) as end:
        while True:
            try:
                step = plan.send(step.carry_out(link, UNIT))
            except (NoAnswer, DamagedAnswer):
                far.bench.bus.now += TIMEOUT
    assert end.value.value == HEARTBEAT_MEANS

def test_the_heartbeat_goes_on_when_the_adapter_is_back() -> None:
    far = _Objects(HEARTBEAT_OBJECTS)
    far.carry_out(1.5)
    far.bench.link.close()
    far.bench.link.open()
    assert BEAT in [frame for _, frame in elapse(far.bench, 1.0)]


def test_the_client_is_none_of_the_drives() -> None:
    bench = Bench()
    bench.bus.servers[127] = Server({(A.index, 0): b''})
    bench.write(A, unit=127)
    assert {frame for _, frame in elapse(bench, 1.0)} == {Frame(0x77E, b'\x05')}
