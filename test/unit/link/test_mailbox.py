# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The mailbox of a PLC: registers by hand, numbers, losses, who else asks, what is given up."""

from __future__ import annotations

from dataclasses import dataclass, field
import struct
from typing import Any

from hypothesis import given, strategies as st
import pytest
from registers import registers_by

from nfo_sinus_driver.link import (
    Address,
    InProgress,
    LinkError,
    NoAnswer,
    NoPath,
    NotReady,
    PortError,
    Refused,
    Unconfirmed,
)
from nfo_sinus_driver.link.modbus.pdu import Read, Write, WriteAndRead
from nfo_sinus_driver.link.plc import telegram

START = 100
ACCEL = Address('pnu', 1028, 1, 4, True, START)
TELEGRAM = Address('pnu', 922, None, 2, False, START)
T_MIN = Address('pnu', 1097, None, 2, True, START)
STATUS = Address('telegram1', 0, telegram.STATUS, 4, None, START)


@dataclass
class Plc:
    """
    The registers, and the clock.

    :ivar box: +16 to +27.
    :ivar does: what the PLC does with a new number: what becomes +25, and the value.
    :ivar takes: how often its program runs until an answer is there.
    :ivar loses: what happens to each transaction from now on: an error, before or after it counts.
    :ivar done: the requests that were carried out.
    """

    layout: int = 2
    now: float = 1000.0
    box: list[int] = field(default_factory=lambda: [0] * 12)
    answer: tuple[int, int] = (0, 5)
    takes: int = 1
    refuses: tuple[int, ...] = ()
    loses: list[tuple[LinkError, bool] | None] = field(default_factory=list)
    asked: list[tuple[Any, ...]] = field(default_factory=list)
    done: list[tuple[int, ...]] = field(default_factory=list)
    _seen: int = 0
    _left: int = 0

    def ask(self, request: Any) -> tuple[bytes, float]:
        self.asked.append(fields_of(request))
        loss = self.loses.pop(0) if self.loses else None
        if loss and not loss[1]:
            raise loss[0]
        if request.function in self.refuses:
            raise Refused(Refused.ILLEGAL_FUNCTION)
        if isinstance(request, (Write, WriteAndRead)):
            at = request.register - START - 16
            words = struct.unpack(f'>{len(request.data) // 2}H', request.data)
            assert at >= 0 and at + len(words) <= 6, 'what is not its own'
            assert at or len(words) == 1, 'the number goes alone'
            self.box[at : at + len(words)] = words
        self.now += 0.005
        answer = b'' if isinstance(request, Write) else self.read(request)
        self.run()
        if loss:
            raise loss[0]
        return answer, self.now

    def read(self, request: Any) -> bytes:
        first = request.register if isinstance(request, Read) else request.source
        shown = {START: [0, 0, self._seen, 3, self.layout, 0, 0, 0], START + 16: self.box}
        return struct.pack(f'>{request.count}H', *shown[first][: request.count])

    def run(self) -> None:
        if self.box[0] != self._seen:
            self._seen, self._left = self.box[0], self.takes
            self.done.append(tuple(self.box[1:6]))
            self.box[9] = 3
        self._left -= 1
        if not self._left:
            result, value = self.answer
            self.box[8:12] = self._seen, result, value >> 16, value & 0xFFFF


def fields_of(request: Any) -> tuple[Any, ...]:
    """Return a request as the tests name it: function, registers from +16 on, words."""
    at = request.register - START
    data = b'' if isinstance(request, Read) else request.data
    return request.function, at, data.hex(' ', 2)


@pytest.fixture
def plc() -> Plc:
    return Plc()


@pytest.fixture
def block(plc: Plc) -> telegram.Block:
    return telegram.Block(registers_by(plc.ask), lambda: plc.now, 7, START)


def access(block: telegram.Block, plc: Plc, address: Address, data: bytes | None = None) -> bytes:
    """Ask as the worker does; a request without an answer is repeated twice."""
    left = 3
    while True:
        try:
            return (block.read(address) if data is None else block.write(address, data)).data
        except NotReady as error:
            plc.now = max(plc.now, error.until)
        except NoAnswer:
            left -= 1
            if not left:
                raise


def test_a_parameter_is_read_in_transactions_of_few_registers(
    plc: Plc, block: telegram.Block
) -> None:
    plc.answer = 0, 0x0001_86A0
    assert access(block, plc, ACCEL) == bytes.fromhex('000186A0')
    assert plc.asked == [
        # whether there is a mailbox
        (3, 0, ''),
        (23, 17, '0001 0404 0001 0000 0000'),
        (23, 16, '0001'),
        (3, 16, ''),
    ]
    plc.asked.clear()
    assert access(block, plc, TELEGRAM) == bytes.fromhex('86A0')
    assert plc.asked == [(23, 17, '0001 039a 0000 0000 0000'), (23, 16, '0002'), (3, 16, '')]


def test_a_value_is_written_with_its_sign_the_high_word_first(
    plc: Plc, block: telegram.Block
) -> None:
    assert access(block, plc, T_MIN, b'\xff\xf6') == b''
    assert access(block, plc, ACCEL, bytes.fromhex('000186A0')) == b''
    assert plc.done == [(2, 1097, 0, 0xFFFF, 0xFFF6), (2, 1028, 1, 0x0001, 0x86A0)]


def test_without_function_23_it_goes_by_16_and_03(plc: Plc, block: telegram.Block) -> None:
    plc.refuses = (23, 6)
    assert access(block, plc, TELEGRAM) == b'\0\5'
    plc.asked.clear()
    assert access(block, plc, TELEGRAM) == b'\0\5'
    assert plc.asked == [
        (16, 17, '0001 039a 0000 0000 0000'), (3, 16, ''), (16, 16, '0002'), (3, 16, ''),
    ]


def test_its_number_is_none_that_stands_there(plc: Plc, block: telegram.Block) -> None:
    for before, answered, number in ((0xFFFF, 0xFFFF, 1), (7, 8, 9), (0xFFFF, 1, 2), (0, 0, 1)):
        plc.box[0] = plc._seen = before
        plc.box[8] = answered
        access(block, plc, TELEGRAM)
        assert plc.box[0] == number


@pytest.mark.parametrize(
    ('result', 'error', 'code', 'text'),
    [
        (1, 2, Refused.ILLEGAL_VALUE, r'refused PNU 1028.1 \(PROFIdrive error 02h\)'),
        (1, 0x11, Refused.DEVICE_FAILURE, 'error 11h'),
        (1, 0x65, Refused.DEVICE_FAILURE, 'error 65h'),
        (2, 0, Refused.ILLEGAL_ADDRESS, 'the drive has no PNU 1028.1'),
        (3, 0, Refused.BUSY, 'busy'),
    ],
)
def test_refusals(
    plc: Plc, block: telegram.Block, result: int, error: int, code: int, text: str
) -> None:
    plc.answer = result, error
    with pytest.raises(Refused, match=text) as raised:
        access(block, plc, ACCEL, b'\0\0\0\1')
    assert raised.value.code == code
    # and the next one is another request
    plc.answer = 0, 5
    assert access(block, plc, TELEGRAM) == b'\0\5'


def test_a_plc_without_access_says_what_to_check(plc: Plc, block: telegram.Block) -> None:
    plc.answer = 4, 0
    with pytest.raises(NoPath, match=r'does not reach PNU 922 .*FB_RosParameter'):
        access(block, plc, TELEGRAM)


def test_layout_1_has_no_mailbox_and_nothing_is_asked(plc: Plc, block: telegram.Block) -> None:
    plc.layout = 1
    for _ in range(2):
        with pytest.raises(Refused, match='layout 1, which has no mailbox'):
            access(block, plc, TELEGRAM)
    assert plc.asked == [(3, 0, '')]


@pytest.mark.parametrize('writes', [False, True])
def test_it_is_given_up_after_a_second_and_a_write_is_not_repeated(
    plc: Plc, block: telegram.Block, writes: bool
) -> None:
    plc.takes = 10**6
    began = plc.now
    with pytest.raises(Unconfirmed if writes else NoAnswer, match='within 1 s'):
        access(block, plc, ACCEL, b'\0\0\0\1' if writes else None)
    assert 1.0 <= (plc.now - began) / (1 if writes else 3) <= 1.2
    assert len(plc.done) == (1 if writes else 3)


@pytest.mark.parametrize('arrives', [False, True])
@pytest.mark.parametrize('at', range(4))
def test_a_lost_transaction_is_looked_for_before_anything_is_done_again(
    plc: Plc, block: telegram.Block, at: int, arrives: bool
) -> None:
    block.read(STATUS)
    plc.loses = [None] * at + [(NoAnswer('lost'), arrives)]
    assert access(block, plc, ACCEL, b'\0\0\0\1') == b''
    assert plc.done == [(2, 1028, 1, 0, 1)], 'once'


@pytest.mark.parametrize('at', range(3))
def test_a_lost_connection_ends_the_request_and_says_if_it_may_have_been_done(
    plc: Plc, block: telegram.Block, at: int
) -> None:
    block.read(STATUS)
    plc.loses = [None] * at + [(PortError('gone'), False)]
    with pytest.raises(PortError) as raised:
        access(block, plc, ACCEL, b'\0\0\0\1')
    assert raised.value.maybe_done == (at > 0)
    block.forget()
    assert access(block, plc, TELEGRAM) == b'\0\5'


def test_the_answer_to_another_client_is_not_believed(plc: Plc, block: telegram.Block) -> None:
    plc.takes = 3
    for _ in range(3):
        with pytest.raises(InProgress):
            block.read(TELEGRAM)
    plc.box[1:6] = 1, 1005, 0, 0, 0
    plc.box[0] += 1
    plc.answer = 0, 77
    with pytest.raises(NoAnswer, match='another client'):
        for _ in range(9):
            with pytest.raises(InProgress):
                block.read(TELEGRAM)
            plc.run()


def test_two_requests_of_this_driver_wait_for_each_other(plc: Plc, block: telegram.Block) -> None:
    block.read(STATUS)
    with pytest.raises(InProgress):
        block.read(TELEGRAM)
    with pytest.raises(NotReady) as waits:
        block.write(ACCEL, b'\0\0\0\1')
    assert type(waits.value) is NotReady and waits.value.until > plc.now
    assert access(block, plc, TELEGRAM) == b'\0\5'
    assert access(block, plc, ACCEL, b'\0\0\0\1') == b''
    assert len(plc.done) == 2


def test_a_request_that_is_not_wanted_any_more_makes_room(plc: Plc, block: telegram.Block) -> None:
    block.read(STATUS)
    plc.takes = 10**6
    for _ in range(3):
        with pytest.raises(InProgress):
            block.write(ACCEL, b'\0\0\0\1')
    plc.takes = 1
    assert access(block, plc, TELEGRAM) == b'\0\5'
    # its caller may come back yet: it is not informed that this was done
    with pytest.raises(Unconfirmed):
        block.write(ACCEL, b'\0\0\0\1')
    # who wants it later wants another one
    plc.now += 3.0
    assert access(block, plc, ACCEL, b'\0\0\0\1') == b''
    assert [done[0] for done in plc.done] == [2, 1, 2]


def test_a_plc_without_these_registers_says_what_to_check(plc: Plc, block: telegram.Block) -> None:
    block.read(STATUS)
    plc.loses = [(Refused(Refused.ILLEGAL_ADDRESS), False)]
    with pytest.raises(NoPath, match='unit 7 has no registers 116 to 127'):
        access(block, plc, TELEGRAM)


def test_no_control_word_goes_with_it_and_the_words_stand(plc: Plc, block: telegram.Block) -> None:
    access(block, plc, TELEGRAM)
    assert all(function == 3 or at >= 16 for function, at, _ in plc.asked)


LOSSES = st.lists(
    st.none() | st.tuples(st.sampled_from(['lost', 'gone']), st.booleans()), max_size=12
)


@given(LOSSES, st.integers(1, 300), st.booleans())
def test_whatever_is_lost_a_write_is_done_once_at_most(
    losses: list[tuple[str, bool] | None], takes: int, apart: bool
) -> None:
    errors = {'lost': NoAnswer, 'gone': PortError}
    plc = Plc(takes=takes, refuses=(23,) if apart else ())
    block = telegram.Block(registers_by(plc.ask), lambda: plc.now, 7, START)
    plc.loses = [loss and (errors[loss[0]](loss[0]), loss[1]) for loss in losses]
    try:
        access(block, plc, ACCEL, b'\0\0\0\1')
        done = True
    except LinkError as error:
        done = False
        assert error.maybe_done or not plc.done
    assert len(plc.done) <= 1
    assert plc.done or not done
