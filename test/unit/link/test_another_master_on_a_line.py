# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Another master on a line: its answers are not taken for ours."""

from __future__ import annotations

import contextlib
from typing import Any

import classic_far_end
from line_bench import UNIT, Ascii, Classic, Movitrac, Rtu
import movitrac_far_end
import pytest
from support.addresses import packed
from virtual_wire import DROP, Fate

from nfo_sinus_driver.link import interface
from nfo_sinus_driver.link.interface import Address, DamagedAnswer
from nfo_sinus_driver.link.modbus import ascii, rtu
from nfo_sinus_driver.link.modbus.link import ReportSlaveId
from nfo_sinus_driver.link.modbus.pdu import Read, Write
from nfo_sinus_driver.link.pairs import classic, movitrac

A, B, C = Rtu.A, Rtu.B, Rtu.C
OTHER_VALUE = bytes.fromhex('000000aa')
#: A register that the unit does not have.
NOWHERE = 0xEEE0
#: A unit takes some time to answer.
SLOW = Fate(delay=0.3)


@pytest.mark.parametrize(
    ('way', 'request_', 'ack'),
    [
        (Classic, classic.encode(classic.Select(1, 0xB6, 5)), classic_far_end.verdict(1, True)),
        (Movitrac, movitrac.encode(movitrac.Select(2, 0x11C, OTHER_VALUE)), movitrac_far_end.ACK),
    ],
    ids=['classic', 'movitrac'],
)
def test_the_ack_to_another_master_confirms_no_write_of_ours(
    way: type[Classic | Movitrac], request_: bytes, ack: bytes
) -> None:
    bench = way(DROP)
    begun = bench.wire.arrive(bench.wire.now, request_)
    bench.wire.arrive(begun + 0.05, ack)
    with pytest.raises(DamagedAnswer) as raised:
        bench.write(way.A)
    assert raised.value.maybe_done
    assert bench.link.remarks.foreign_frames == 1


def test_what_another_drive_says_to_another_master_is_no_value_of_ours() -> None:
    # the same index, and the answer names no drive
    bench = Movitrac()
    request = movitrac.Enquiry(2, Movitrac.A.index)
    answer = movitrac_far_end.data(Movitrac.A.index, OTHER_VALUE)
    # as if it had begun just after ours
    bench.read(Movitrac.B)
    begun = bench.wire.now + 6 * bench.line.char_time
    bench.drive.heal(DROP)
    bench.wire.arrive(begun, movitrac.encode(request) + answer)
    assert bench.read(Movitrac.A).data == bench.answer_of() != OTHER_VALUE
    assert bench.link.remarks.foreign_frames == 1


def test_a_request_that_comes_twice_is_no_answer_to_itself() -> None:
    # function 17 is asked by the very beginning of its answer
    frame = rtu.encode(ReportSlaveId(1))
    answer = bytes((1, 17, 1, 65))
    link = Rtu().link
    assert not link._another.was_answered_in(frame + frame)
    assert link._another.was_answered_in(frame + answer + rtu.crc(answer))


#: What another master sends to the unit that we ask, too.
FOREIGN = {
    'reads as many registers': Read(UNIT, 0x3F8, 1),
    'reads what we read before': Read(UNIT, A.index, 1),
    'reads what is not there': Read(UNIT, NOWHERE, 1),
    'writes what is not there': Write(UNIT, NOWHERE, b'\0\1'),
    'writes several that are not there': Write(UNIT, NOWHERE, b'\0\1\0\2'),
}
LINKS = {'rtu': (Rtu, rtu.encode), 'ascii': (Ascii, ascii.encode)}


class SharedLine:
    """
    A unit that another master asks, too, which was heard before.

    :ivar number: of our next request at which that sends, ``times`` requests in a row, just
        ``before`` it or behind it.
    """

    def __init__(self, protocol: str, foreign: str, *, before: bool, times: int = 1) -> None:
        way, self._encode = LINKS[protocol]
        self.bench = bench = way(trusted=True)
        self.number = -1
        self._request, self._before, self._times = FOREIGN[foreign], before, times
        self._write = bench.wire.write
        bench.drive.heal(*[SLOW] * 1000)
        bench.wire.write = self._send  # type: ignore[method-assign]
        for _ in range(2):
            self._another(Read(UNIT, 0x111, 1), bench.wire.now)
            bench.wire.now += 0.2
            bench.read(B)

    def _send(self, frame: bytes) -> None:
        wire = self.bench.wire
        self.number -= 1
        now = self.number == 0
        end = wire.now + len(frame) * wire.settings.char_time
        if now and self._before:
            end = self._another(self._request, wire.now)
        self._write(frame)
        for _ in range(self._times if now and not self._before else 0):
            end = self._another(self._request, end)

    def _another(self, request: Any, at: float) -> float:
        """Let another master send a request from a moment on; return when it has been sent."""
        bench = self.bench
        end = bench.wire.arrive(at, self._encode(request))
        refused = request.register == NOWHERE
        bench.drive.heal(Fate(delay=0.3, what='refuse' if refused else 'answer'), *[SLOW] * 1000)
        bench.wire.far_end(rtu.encode(request), end)
        return end

    def answers_of(self, address: Address) -> list[bytes]:
        """Return what the unit said to the requests for this address, ours and others."""
        asked = [number for number, index in enumerate(self.bench.asked) if index == address.index]
        return [self.bench.answer_of(number) for number in asked]


@pytest.mark.parametrize('times', [1, 2])
@pytest.mark.parametrize('before', [True, False], ids=['before', 'behind'])
@pytest.mark.parametrize('number', range(1, 6))
@pytest.mark.parametrize('foreign', FOREIGN)
@pytest.mark.parametrize('protocol', LINKS)
def test_what_is_read_or_refused_is_the_answer_to_us(
    protocol: str, foreign: str, number: int, before: bool, times: int
) -> None:
    line = SharedLine(protocol, foreign, before=before, times=times)
    line.number = number
    for address in (A, B, C, A, B):
        assert line.bench.read(address).data in line.answers_of(address)


@pytest.mark.parametrize('protocol', LINKS)
def test_what_acknowledges_is_sent_once(protocol: str) -> None:
    doubted = 0
    for foreign in FOREIGN:
        line = SharedLine(protocol, foreign, before=False)
        line.number = 1
        sent = len(line.bench.wire.sent)
        try:
            interface.Read(A, once=True).carry_out(line.bench.link, UNIT)
        except DamagedAnswer:
            doubted += 1
        assert len(line.bench.wire.sent) == sent + 1
    assert doubted


@pytest.mark.parametrize('once', [True, False])
def test_what_acknowledges_is_sent_once_over_classic(once: bool) -> None:
    bench = Classic(DROP)
    begun = bench.wire.arrive(bench.wire.now, classic.encode(classic.Select(1, 0xB6, 5)))
    bench.wire.arrive(begun + 0.05, classic_far_end.verdict(1, True))
    doubted = pytest.raises(DamagedAnswer) if once else contextlib.nullcontext()
    with doubted:
        interface.Read(Classic.A, once).carry_out(bench.link, UNIT)
    assert (len(bench.wire.sent) == 1) == once


@pytest.mark.parametrize('before', [True, False], ids=['before', 'behind'])
@pytest.mark.parametrize('words', [(5,), (5, 6)])
@pytest.mark.parametrize('protocol', LINKS)
def test_the_refusal_of_another_master_s_write_refuses_no_write_of_ours(
    protocol: str, words: tuple[int, ...], before: bool
) -> None:
    foreign = 'writes several that are not there' if words[1:] else 'writes what is not there'
    line = SharedLine(protocol, foreign, before=before)
    line.number = 1
    address = A._replace(size=2 * len(words))
    for _ in range(3):
        try:
            line.bench.write(address, packed(*words))
        except DamagedAnswer as error:
            assert error.maybe_done
        else:
            return
    raise AssertionError('never certain')
