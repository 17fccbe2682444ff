# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Another client asks the same SDO server: nothing of its transfers is taken for ours."""

from __future__ import annotations

from canopen_bench import TEXT, UNIT, A, B, Bench, Frame
from canopen_far_end import WRONG_LENGTH
import pytest

from nfo_sinus_driver.link.interface import DamagedAnswer, Read, Refused

REQUESTS = 0x600 + UNIT
CANNOT = 0x08000022
#: What the other client sends; the node refuses two bytes to 2013h in four, and 2099h at all.
FOREIGN = {
    'reads the same': '4013200001000000',
    'writes the same': '2B13200009090000',
    'writes the same and is refused': '2313200009090909',
    'reads another': '4022200001000000',
    'reads another text': '400A100000000000',
    'reads the same text': '4008100001000000',
    'asks for a segment': '6000000000000000',
    'asks for the other segment': '7000000000000000',
    'sends a segment': '0001020304050607',
    'reads blocks': 'A00A10007F000000',
    'writes blocks': 'C213200002000000',
    'ends its transfer': '8013200000000405',
}


class SharedBench(Bench):
    """
    A node that another client asks, too.

    :param request: what that sends, just before or just behind our message with this number.
    :param refuses: the node refuses what we write, and nothing else.
    """

    def __init__(
        self, request: bytes, number: int, *, before: bool, refuses: bool = False
    ) -> None:
        super().__init__()
        self._server = self.bus.servers[UNIT]
        self._server.objects |= {
            (A.index, 0): b'\xee\xee',
            (TEXT.index, 0): b'it was another text before this',
            (0x100A, 0): b'the version of the software of another',
        }
        send = self.bus.send

        def shared(frame: Frame) -> None:
            ours = frame.identifier == REQUESTS
            now = ours and len(self.bus.sent) == number
            if now and before:
                self._another(request)
            if refuses and ours and frame.data[0] >> 5 == 1:
                self._server.refuses[A.index, 0] = CANNOT
            send(frame)
            self._server.refuses.clear()
            if now and not before:
                self._another(request)

        self.bus.send = shared  # type: ignore[method-assign]

    def _another(self, request: bytes) -> None:
        bus = self.bus
        bus.arrive(bus.now, Frame(REQUESTS, request))
        if request[0] == 0x23:
            self._server.refuses[A.index, 0] = WRONG_LENGTH
        reply = self._server.answer(request)
        self._server.refuses.clear()
        if reply is not None:
            bus.answer(UNIT, reply)


@pytest.mark.parametrize('before', [True, False], ids=['before', 'behind'])
@pytest.mark.parametrize('number', range(6))
@pytest.mark.parametrize('foreign', FOREIGN)
def test_what_is_read_is_the_answer_to_us(foreign: str, number: int, before: bool) -> None:
    bench = SharedBench(bytes.fromhex(FOREIGN[foreign]), number, before=before)
    for address in (A, TEXT, A, B):
        reply = bench.read(address).data
        asked = max(k for k, index in enumerate(bench.asked) if index == address.index)
        assert reply == bench.answer_of(asked)
    assert bench.link.remarks.foreign_frames == 1


def test_what_acknowledges_is_sent_once() -> None:
    doubted = 0
    for foreign in FOREIGN.values():
        bench = SharedBench(bytes.fromhex(foreign), 1, before=False)
        bench.read(B)
        try:
            Read(A, once=True).carry_out(bench.link, UNIT)
        except (DamagedAnswer, Refused):
            doubted += 1
        assert bench.asked.count(A.index) == 1
    assert doubted


@pytest.mark.parametrize('before', [True, False], ids=['before', 'behind'])
@pytest.mark.parametrize('number', range(3))
@pytest.mark.parametrize('foreign', FOREIGN)
@pytest.mark.parametrize('refuses', [True, False])
def test_no_answer_to_another_write_is_taken_for_ours(
    foreign: str, number: int, before: bool, refuses: bool
) -> None:
    request = bytes.fromhex(FOREIGN[foreign])
    bench = SharedBench(request, number, before=before, refuses=refuses)
    bench.read(B)
    for _ in range(3):
        try:
            bench.write(A, b'\1\2')
        except Refused as error:
            assert refuses and '08000022' in str(error)
            return
        except DamagedAnswer:
            continue
        assert not refuses
        return
    raise AssertionError('never certain')


def test_another_client_is_reported_once_with_what_to_do() -> None:
    bench = Bench()
    bench.read(A)
    for number in range(4):
        bench.bus.arrive(bench.bus.now, Frame(REQUESTS, bytes.fromhex('4013200001000000')))
        # another client may use a node that gets no requests here
        bench.bus.arrive(bench.bus.now, Frame(0x601, bytes.fromhex('4013200001000000')))
        bench.read(B)
        assert bench.link.remarks.foreign_frames == number + 1
    (remark,) = bench.link.remarks.texts
    assert 'another SDO client asks node 5' in remark and 'disconnect it' in remark


def test_an_adapter_that_returns_what_it_sends_is_no_other_client() -> None:
    bench = Bench()
    send = bench.bus.send

    def returned(frame: Frame) -> None:
        bench.bus.arrive(bench.bus.now, frame)
        send(frame)

    bench.bus.send = returned  # type: ignore[method-assign]
    for number, address in enumerate((A, TEXT, B, A, TEXT)):
        assert bench.read(address).data == bench.answer_of(number)
    bench.write(A)
    assert bench.link.remarks.foreign_frames == 0
