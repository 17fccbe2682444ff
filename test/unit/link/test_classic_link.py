# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""One Classic transaction after the other on a line in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import itertools
from typing import Any
from typing import TypeVar

import classic_far_end as far
from classic_far_end import INV_ST
from classic_far_end import SIO_ERR
from classic_far_end import FarEnd
from classic_far_end import Fate
from hypothesis import example
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
import pytest
from support.addresses import classic_id
from support.addresses import packed
from virtual_wire import Wire

from nfo_sinus_driver.link.classic_link import CHAR_FORMATS
from nfo_sinus_driver.link.classic_link import ClassicLink
from nfo_sinus_driver.link.errors import DamagedAnswer
from nfo_sinus_driver.link.errors import LinkError
from nfo_sinus_driver.link.errors import NoAnswer
from nfo_sinus_driver.link.errors import NotReady
from nfo_sinus_driver.link.errors import PortError
from nfo_sinus_driver.link.errors import Refused
from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import Identification
from nfo_sinus_driver.link.interface import Reply
from nfo_sinus_driver.link.settings import BAUD_RATES
from nfo_sinus_driver.link.settings import LineSettings

TIMEOUT = 0.1
SETTINGS = LineSettings(baud_rate=9600, char_format='7E1', response_timeout=TIMEOUT)
UNIT = 1
MODE = 0x29
A = classic_id(0x1E)
B = classic_id(0xB6)
#: OpTime, as the manual prints it: the low word first.
LONG = classic_id(0x27, 0x127)

_T = TypeVar('_T')


class Bench:
    """A link on a virtual line; everything done with it happens in virtual time."""

    def __init__(self, *fates: Fate, settings: LineSettings = SETTINGS, unit: int = UNIT) -> None:
        self.wire = Wire(settings)
        self.drive = FarEnd(self.wire, iter(fates))
        self.link = ClassicLink(self.wire, settings)
        self.unit = unit
        self.do(self.link.open)

    def do(self, action: Callable[[], _T]) -> _T:
        with self.wire.time():
            return action()

    def read(self, address: Address, unit: int | None = None) -> Reply:
        return self.do(lambda: self.link.read(self.unit if unit is None else unit, address))

    def write(self, address: Address, *words: int, unit: int | None = None) -> Reply:
        unit = self.unit if unit is None else unit
        return self.do(lambda: self.link.write(unit, address, packed(*words)))

    def refused(self, code: int, *words: str) -> Refused:
        with pytest.raises(Refused) as raised:
            self.write(A, 5)
        assert raised.value.code == code
        for word in words:
            assert word in str(raised.value)
        return raised.value

    @property
    def asked(self) -> list[int]:
        """The parameters of all requests so far."""
        return [number for _, number, _, _ in self.drive.requests]

    def answer_of(self, index: int) -> bytes:
        """What the drive says to the request with this index."""
        return packed(self.drive.word(self.asked[index], index))


# --- plain transactions ---------------------------------------------------------------------------


@pytest.mark.parametrize('lump', [False, True])
@pytest.mark.parametrize('unit', [0, 1, 94])
def test_read_and_write(lump: bool, unit: int) -> None:
    bench = Bench(*[Fate(lump=lump)] * 2, unit=unit)
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.write(A, 0xFF9C).data == b''
    assert bench.drive.requests == [(unit, 0x1E, None, 'answer'), (unit, 0x1E, 0xFF9C, 'answer')]


@pytest.mark.parametrize('char_format', CHAR_FORMATS)
@pytest.mark.parametrize('baud', BAUD_RATES)
def test_every_rate_and_format_at_the_limit_of_the_wire(baud: int, char_format: str) -> None:
    line = LineSettings(baud, char_format, TIMEOUT)
    bench = Bench(settings=line)
    start = bench.wire.now
    for _ in range(10):
        bench.read(A)
        bench.read(A)
    # 8 characters there, 14 back, and nothing between two transactions
    assert bench.wire.now - start == pytest.approx(20 * 22 * line.char_time)


def test_the_same_question_to_one_drive_after_the_other_costs_nothing_more() -> None:
    bench = Bench()
    start = bench.wire.now
    for _ in range(10):
        bench.read(A, unit=1)
        bench.read(A, unit=2)
        bench.write(A, 1, unit=1)
        bench.write(A, 1, unit=2)
    assert bench.wire.now - start == pytest.approx(20 * (22 + 17) * SETTINGS.char_time)


@pytest.mark.parametrize('char_format', ['7N1', '7E2', '8E2'])
def test_a_format_that_no_firmware_has(char_format: str) -> None:
    with pytest.raises(ValueError, match='classic has 7E1, 7O1, 7N2, 8E1, 8O1, 8N2, 8N1'):
        Bench(settings=LineSettings(9600, char_format))


def test_reply_says_when_its_last_byte_came() -> None:
    bench = Bench(Fate(0.5))
    assert bench.read(A).arrived == bench.wire.now == bench.wire.seen[-1][0]
    bench.wire.now += 1
    assert bench.write(A, 1).arrived == bench.wire.now == bench.wire.seen[-1][0]


def test_lower_case_answers_are_read() -> None:
    bench = Bench()
    bench.drive.lower = True
    bench.drive.values[0xB6] = 0xABCD
    assert bench.read(B).data == packed(0xABCD)


@pytest.mark.parametrize('address', [0, 1, 17, 94])
def test_point_to_point_either_address_answers(address: int) -> None:
    bench = Bench(unit=0)
    bench.drive.address = address
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.write(B, 1).data == b''
    assert {unit for unit, *_ in bench.drive.requests} == {0}


def test_another_address_does_not_answer() -> None:
    bench = Bench()
    bench.drive.address = 2
    for act in (lambda: bench.read(A), lambda: bench.write(A, 1)):
        with pytest.raises(DamagedAnswer):
            act()


def test_time_out_counts_from_the_end_of_the_request() -> None:
    bench = Bench(*[Fate(what='drop')] * 2)
    for address, chars in ((A, 8), (B, 8)):
        start = bench.wire.now
        with pytest.raises(NoAnswer):
            bench.read(address)
        assert bench.wire.now - start == pytest.approx(chars * SETTINGS.char_time + TIMEOUT)


def test_answer_just_in_time_is_taken_whole() -> None:
    bench = Bench(Fate(0.95))
    assert bench.read(A).data == bench.answer_of(0)


def test_babbling_line_is_no_reason_to_hang() -> None:
    bench = Bench()
    bench.wire.far_end = lambda frame, end: None
    for number in range(2000):
        bench.wire.arrive(bench.wire.now + number * 0.001, b'!')
    start = bench.wire.now
    for act in (lambda: bench.read(A), lambda: bench.write(A, 1)):
        with pytest.raises(DamagedAnswer):
            act()
    assert bench.wire.now - start < 8 * TIMEOUT


def test_lost_port_is_passed_on() -> None:
    for calls in range(4):
        bench = Bench(Fate(what='refuse'))
        real = bench.wire.read
        outcomes = itertools.chain([real] * calls, itertools.repeat(None))

        def read(until: float, outcomes: Iterator[Any] = outcomes) -> bytes:
            outcome = next(outcomes)
            if outcome is None:
                raise PortError('unplugged')
            data: bytes = outcome(until)
            return data

        bench.wire.read = read  # type: ignore[method-assign]
        with pytest.raises(PortError):
            bench.write(A, 1)


def test_there_is_nothing_to_ask() -> None:
    bench = Bench()
    inquiry = bench.link.identify(UNIT)
    assert inquiry.done
    assert inquiry.found == Identification()
    assert bench.drive.requests == []
    with pytest.raises(IndexError):
        inquiry.ask()


def test_write_and_read_takes_two_transactions() -> None:
    bench = Bench()
    reply = bench.do(lambda: bench.link.write_and_read(UNIT, A, packed(7), B))
    assert reply.data == bench.answer_of(1)
    assert bench.drive.requests == [(1, 0x1E, 7, 'answer'), (1, 0xB6, None, 'answer')]


# --- broadcast ------------------------------------------------------------------------------------


def test_broadcast_awaits_no_answer() -> None:
    bench = Bench()
    start = bench.wire.now
    assert bench.write(classic_id(MODE), 1, unit=95).data == b''
    assert bench.wire.sent[0][1].startswith(b'\x04\x7f\x02E0029=0001')
    assert bench.read(A).data == bench.answer_of(1)
    # the drives have had time to obey
    assert bench.wire.sent[1][0] - start > 15 * SETTINGS.char_time + 0.09


def test_drives_that_answer_fast_need_little_time_for_a_broadcast() -> None:
    bench = Bench()
    for number in range(300):
        bench.read(A if number % 2 else B)
    start = bench.wire.now
    bench.write(classic_id(MODE), 1, unit=95)
    bench.read(A)
    assert bench.wire.sent[-1][0] - start < 15 * SETTINGS.char_time + 0.01
    # one that took long lately needs it, but none needs longer than all drives may
    for delay in (0.2, 0.95):
        bench = Bench(*[Fate()] * 300, Fate(delay))
        for number in range(301):
            bench.read(A if number % 2 else B)
        start = bench.wire.now
        bench.write(classic_id(MODE), 1, unit=95)
        pause = bench.wire.now - start - 15 * SETTINGS.char_time
        assert min(2 * delay * TIMEOUT, 0.1) - 0.001 <= pause <= 0.101


def test_nobody_reads_a_broadcast() -> None:
    bench = Bench()
    with pytest.raises(ValueError, match='broadcast'):
        bench.read(A, unit=95)
    with pytest.raises(ValueError, match='0 to 95'):
        bench.write(A, 1, unit=96)
    assert bench.wire.sent == []


# --- values of two words --------------------------------------------------------------------------


def test_two_words_are_read_high_low_high() -> None:
    bench = Bench()
    bench.drive.values = {0x27: 0xFFFF, 0x127: 3}
    assert bench.read(LONG).data == packed(0xFFFF, 3)
    assert bench.asked == [0x127, 0x27, 0x127]


def test_two_words_that_change_meanwhile_are_read_again() -> None:
    bench = Bench()
    # 3FFFFh becomes 40000h between high and low
    high = iter([3, 4, 4])
    low = iter([0, 1])
    bench.drive.values = {0x127: lambda: next(high), 0x27: lambda: next(low)}
    assert bench.read(LONG).data == packed(1, 4)
    assert bench.asked == [0x127, 0x27, 0x127, 0x27, 0x127]


def test_two_words_that_never_stand_still() -> None:
    bench = Bench()
    with pytest.raises(DamagedAnswer, match='stood still'):
        bench.read(LONG)
    assert len(bench.asked) == 11


def test_two_words_are_written_low_first() -> None:
    bench = Bench()
    bench.write(LONG, 1, 2)
    assert [request[1:3] for request in bench.drive.requests] == [(0x27, 1), (0x127, 2)]


@pytest.mark.parametrize(('fates', 'maybe'), [((), False), ((Fate(),), True)])
def test_half_written(fates: tuple[Fate, ...], maybe: bool) -> None:
    bench = Bench(*fates, Fate(what='refuse'))
    with pytest.raises(Refused) as raised:
        bench.write(LONG, 1, 2)
    assert raised.value.maybe_done is maybe
    assert not Refused.maybe_done


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
    assert (error.inv_st, error.maybe_done) == (37, False)
    assert bench.asked == [0x1E, INV_ST]


@pytest.mark.parametrize('code', [1, 12, 15, 23])
def test_refused_because_a_fault_stands(code: int) -> None:
    bench = refusal_bench(code, 1 << 10)
    bench.refused(Refused.DEVICE_FAILURE, 'a fault stands', f'InvSt {code}')
    assert bench.asked == [0x1E, INV_ST]


def test_a_serial_fault_that_may_have_stood_before_is_not_acknowledged() -> None:
    bench = refusal_bench(14, 1 << 10)
    error = bench.refused(Refused.DEVICE_FAILURE, 'Sio Fail')
    assert error.inv_st == 14
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
    error = bench.refused(code, *words, 'Sio Fail')
    assert error.inv_st == 14
    assert bench.asked == [INV_ST, 0x1E, INV_ST, SIO_ERR]


@pytest.mark.parametrize(('before', 'pause'), [(14, 0.1), (38, 1.5)])
def test_a_serial_fault_that_is_old_or_may_be_is_left(before: int, pause: float) -> None:
    bench = own_fault_bench(before, pause, 1 << 10)
    bench.refused(Refused.DEVICE_FAILURE, 'Sio Fail')
    assert SIO_ERR not in bench.asked


def test_what_was_known_of_a_drive_ends_with_the_connection() -> None:
    bench = own_fault_bench(38, 0.1, 1 << 10)
    bench.do(bench.link.close)
    bench.do(bench.link.open)
    bench.refused(Refused.DEVICE_FAILURE, 'Sio Fail')
    assert SIO_ERR not in bench.asked


def test_a_reason_that_nobody_tells() -> None:
    bench = Bench(Fate(what='refuse'), Fate(what='drop'))
    error = bench.refused(Refused.DEVICE_FAILURE, 'why is not known')
    assert error.inv_st is None


# --- doubt ----------------------------------------------------------------------------------------


@pytest.mark.parametrize('late', [1.2, 2.0, 3.0])
def test_late_reply_is_not_taken_for_the_answer_to_the_same_question(late: float) -> None:
    bench = Bench(Fate(late))
    with pytest.raises(NoAnswer):
        bench.read(A)
    for _ in range(50):
        try:
            told = bench.read(A).data
        except (NoAnswer, DamagedAnswer, NotReady):
            bench.wire.now += 0.1 * TIMEOUT
            continue
        assert bench.asked[-1] == 0x1E
        assert told == bench.answer_of(len(bench.asked) - 1)
        return
    raise AssertionError('never answered')


@pytest.mark.parametrize('late', [1.05, 1.2, 2.0, 3.0])
def test_late_reply_is_not_taken_for_the_answer_to_another_question(late: float) -> None:
    bench = Bench(Fate(late))
    with pytest.raises(NoAnswer):
        bench.read(A)
    try:
        told = bench.read(B).data
    except (NoAnswer, DamagedAnswer):
        return
    assert told == bench.answer_of(1)
    # and what answered has cleared the line
    assert bench.read(A).data == bench.answer_of(2)
    assert bench.asked == [0x1E, 0xB6, 0x1E]


@pytest.mark.parametrize('late', [1.05, 1.2, 2.0, 3.0])
def test_late_ack_is_not_taken_for_the_answer_to_another_write(late: float) -> None:
    bench = Bench(Fate(late), Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.write(A, 1)
    # the second is lost on the way: were the late ACK believed, it would count as done
    with pytest.raises((NoAnswer, DamagedAnswer)) as raised:
        bench.write(B, 2)
    assert raised.value.maybe_done


def test_a_write_in_doubt_goes_out_at_once_and_clears_the_line() -> None:
    bench = Bench(Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.write(A, 1)
    start = bench.wire.now
    with pytest.raises(DamagedAnswer, match='an earlier request'):
        bench.write(A, 1)
    assert bench.wire.sent[1][0] == start
    assert bench.asked == [0x1E, 0x1E, INV_ST]
    bench.write(A, 1)
    assert len(bench.asked) == 4


def test_a_write_after_a_silent_read_is_believed() -> None:
    bench = Bench(Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    bench.write(A, 1)
    assert bench.asked == [0x1E, 0x1E]


def test_late_nak_is_not_taken_for_the_answer_to_another_question() -> None:
    bench = Bench(Fate(1.2, 'refuse'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    assert bench.read(B).data == bench.answer_of(1)
    bench = Bench(Fate(1.2, 'refuse'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    with pytest.raises(DamagedAnswer):
        bench.write(B, 1)


def test_probes_are_those_that_every_firmware_has() -> None:
    # whatever is named: to ask for what a drive does not have makes it stop
    bench = Bench(*[Fate(what='drop')] * 5)
    bench.link.use_probes(UNIT, [classic_id(0x7D)])
    for _ in range(5):
        with pytest.raises(NoAnswer):
            bench.read(A)
    assert bench.asked == [0x1E, INV_ST, MODE, 0x30, 0x1E]
    assert bench.read(B).data == bench.answer_of(5)


def test_doubt_of_one_unit_is_not_that_of_another() -> None:
    bench = Bench(Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    assert bench.read(A, unit=2).data == bench.answer_of(1)
    assert bench.asked == [0x1E, 0x1E]


def test_closing_forgets_all_doubts() -> None:
    bench = Bench(Fate(what='drop'))
    with pytest.raises(NoAnswer):
        bench.read(A)
    bench.do(bench.link.close)
    bench.do(bench.link.open)
    bench.read(A)
    assert bench.asked == [0x1E, 0x1E]


@pytest.mark.parametrize('lump', [False, True])
@pytest.mark.parametrize('address', [A, classic_id(INV_ST)])
def test_doubled_reply(lump: bool, address: Address) -> None:
    bench = Bench(Fate(what='double', lump=lump))
    number = address.index
    probe = MODE if number == INV_ST else INV_ST
    bench.read(address)
    # in a lump it is seen at once, else when it comes before it can
    assert bench.read(address).data == bench.answer_of(len(bench.asked) - 1)
    assert bench.asked == ([number, probe, number] if lump else [number, number, probe, number])


def test_the_same_question_on_a_line_without_speed() -> None:
    bench = Bench(settings=LineSettings(1200, '7E1', TIMEOUT))
    bench.drive.pace = 0.0
    for _ in range(5):
        assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)
        bench.write(A, 1)
        bench.write(B, 1)


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_reply_before_another_question(lump: bool) -> None:
    bench = Bench(Fate(what='double', lump=lump))
    bench.read(A)
    assert bench.read(B).data == bench.answer_of(1)
    assert bench.asked == [0x1E, 0xB6]


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_ack(lump: bool) -> None:
    bench = Bench(Fate(what='double', lump=lump), Fate(what='drop'))
    bench.write(A, 1)
    with pytest.raises((NoAnswer, DamagedAnswer)):
        bench.write(B, 1)


@pytest.mark.parametrize('lump', [False, True])
def test_doubled_nak(lump: bool) -> None:
    bench = Bench(Fate(what='refuse twice', lump=lump))
    with pytest.raises(Refused):
        bench.read(A)
    assert bench.read(B).data == bench.answer_of(1)


@pytest.mark.parametrize('noise', [b'\x00', b'\x7f\x7f', b'\x02', b'!', b'!\x02E0', b'\x1b[0m'])
def test_noise_before_an_answer(noise: bytes) -> None:
    bench = Bench()
    bench.drive.before = noise
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.write(A, 1).data == b''


def test_damaged_answer() -> None:
    bench = Bench(Fate(what='damage'))
    with pytest.raises(DamagedAnswer, match='14 bytes'):
        bench.read(A)


def test_bytes_that_nobody_asked_for_raise_doubt() -> None:
    bench = Bench()
    bench.read(A)
    bench.wire.now += 1
    bench.wire.arrive(bench.wire.now - 0.1, b'!')
    assert bench.read(A).data == bench.answer_of(2)
    assert bench.asked == [0x1E, INV_ST, 0x1E]


# --- echo -----------------------------------------------------------------------------------------


@pytest.mark.parametrize('lump', [False, True])
def test_echo_of_our_own_requests_is_stripped(lump: bool) -> None:
    bench = Bench(*[Fate(lump=lump)] * 4)
    bench.drive.echo = True
    assert bench.read(A).data == bench.answer_of(0)
    bench.write(A, 0x1234)
    # the echo of a SELECT has the form of a REPLY behind its EOT
    assert bench.read(A).data == bench.answer_of(2)
    bench.write(classic_id(MODE), 1, unit=95)
    assert bench.read(B).data == bench.answer_of(4)
    assert len(bench.asked) == 5


def test_silence_behind_an_echo_is_silence() -> None:
    bench = Bench(Fate(), Fate(what='drop'), Fate(what='drop'))
    bench.drive.echo = True
    bench.read(A)
    for act in (lambda: bench.read(B), lambda: bench.write(A, 1)):
        with pytest.raises(NoAnswer):
            act()


def test_what_comes_before_the_echo_is_no_answer() -> None:
    bench = Bench()
    bench.drive.echo = True
    bench.read(A)
    take = bench.drive.take

    def stale_first(frame: bytes, end: float) -> None:
        bench.wire.arrive(bench.wire.now - 1, far.reply(1, 0xB6, 0xDEAD), lump=True)
        take(frame, end)

    bench.wire.far_end = stale_first
    assert bench.read(B).data == bench.answer_of(1)


def test_an_adapter_that_echoes_no_more() -> None:
    bench = Bench()
    bench.drive.echo = True
    bench.read(A)
    bench.drive.echo = False
    with pytest.raises(DamagedAnswer):
        bench.read(B)
    assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)


# --- whatever the drive does ----------------------------------------------------------------------

WHAT = ['answer', 'answer', 'answer', 'drop', 'refuse', 'damage', 'double', 'refuse twice']
FATES = st.lists(
    st.builds(
        Fate,
        st.one_of(st.just(0.0), st.floats(0, 3)),
        st.sampled_from(WHAT),
        st.booleans(),
    ),
    max_size=25,
)
#: Something to do, and how long to wait before it, in time-outs.
STEPS = st.lists(
    st.tuples(
        st.sampled_from(['A', 'B', 'InvSt', 'write A', 'write B']),
        st.one_of(st.just(0.0), st.just(0.0), st.floats(0, 4)),
    ),
    max_size=25,
)
NAMES = {'A': A, 'B': B, 'InvSt': classic_id(INV_ST)}


@hypothesis_settings(max_examples=400)
@given(FATES, STEPS, st.booleans())
@example([Fate(1.2), Fate(what='drop')], [('write A', 0.0), ('write B', 0.0)], False)
@example([Fate(1.5), Fate(1.5), Fate(1.5)], [('A', 0.0), ('B', 0.0), ('B', 0.0)], False)
@example([Fate(what='refuse twice')], [('A', 0.0), ('B', 0.0)], False)
def test_every_answer_belongs_to_its_request(
    fates: list[Fate], steps: list[tuple[str, float]], echo: bool
) -> None:
    bench = Bench(*fates)
    bench.drive.echo = echo
    requests = bench.drive.requests
    for what, pause in steps:
        bench.wire.now += pause * TIMEOUT
        address = NAMES[what.split()[-1]]
        before = len(requests)
        try:
            if what.startswith('write'):
                assert bench.write(address, 7).data == b''
                # one transaction, and this very one was confirmed
                assert len(requests) == before + 1
                assert requests[before][3] in ('answer', 'double')
            else:
                told = bench.read(address).data
                assert requests[-1][1] == address.index
                assert told == bench.answer_of(len(requests) - 1)
        except Refused:
            refused = before if what.startswith('write') else len(requests) - 1
            assert requests[refused][1] == address.index
            assert requests[refused][3].startswith('refuse')
        except NotReady as refusal:
            assert not what.startswith('write')
            assert len(requests) == before
            assert refusal.until > bench.wire.now
        except (NoAnswer, DamagedAnswer) as error:
            assert isinstance(error, LinkError) and error.maybe_done
        assert len(requests) - before <= (3 if what.startswith('write') else 5)
        if what.startswith('write'):
            assert requests[before][1:3] == (address.index, 7)
