# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Half-duplex adapters that hand our own requests back, and answers that come twice, late."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from dataclasses import replace
import os
import select
import threading
from typing import Any

from hypothesis import example, given, settings as hypothesis_settings, strategies as st
from link_bench import TIMEOUT, UNIT, A, B, Bench, C, D
import pymodbus_opinion as opinion
import pytest
from support.addresses import packed
from test_link_ports import PATIENCE, Pty
from test_rtu_link import NAMES, STEPS
from virtual_wire import AsciiWire, Fate, Slave, Wire

from nfo_sinus_driver.link import BusSettings
from nfo_sinus_driver.link.interface import Address, DamagedAnswer, LinkError, NoAnswer, Refused
from nfo_sinus_driver.link.modbus_ascii import AsciiLink
from nfo_sinus_driver.link.request_link import Echo
from nfo_sinus_driver.link.rtu import RtuLink

KINDS = {'rtu': (RtuLink, Wire), 'ascii': (AsciiLink, AsciiWire)}


@pytest.fixture(params=KINDS, autouse=True, scope='module')
def kind(request: pytest.FixtureRequest) -> Iterator[str]:
    link_class, wire_class = KINDS[request.param]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Bench, 'link_class', link_class)
        patch.setattr(Bench, 'wire_class', wire_class)
        yield request.param


# --- the echo by itself ---------------------------------------------------------------------------


def test_nothing_is_stripped_before_an_echo_came() -> None:
    echo = Echo()
    echo.sent(b'abc')
    assert echo.strip(b'abcd') == b'abcd'
    assert echo.bytes_needed == 0


@given(st.data(), st.binary(min_size=1, max_size=8), st.binary(max_size=20))
def test_echo_is_stripped_in_any_pieces(data: st.DataObject, frame: bytes, answer: bytes) -> None:
    echo = Echo()
    echo.present = True
    echo.sent(frame)
    stream = frame + answer
    cut = data.draw(st.integers(0, len(stream)))
    assert echo.strip(stream[:cut]) + echo.strip(stream[cut:]) == answer
    assert echo.bytes_needed == 0
    assert echo.before == b''


def test_what_comes_before_the_echo_is_kept_apart() -> None:
    echo = Echo()
    echo.present = True
    echo.sent(b'abc')
    assert echo.strip(b'xxab') == b''
    assert echo.strip(b'cyy') == b'yy'
    assert echo.before == b'xx'


# --- a line that echoes ---------------------------------------------------------------------------


class EchoingBench(Bench):
    """
    A line that hands over every request before anything else.

    :ivar echo: what it makes of a request.
    """

    def __init__(self, fates: list[Fate] | None = None, **more: Any) -> None:
        super().__init__(fates, **more)
        self.echo = lambda frame: frame
        slave = self.wire.far_end

        def far_end(request: bytes, end: float) -> None:
            sent = self.wire.sent[-1]
            self.wire.arrive(sent[0], self.echo(sent[1]))
            slave(request, end + self.wire.settings.char_time)

        self.wire.far_end = far_end


def test_reads_and_writes_with_an_echo() -> None:
    bench = EchoingBench()
    for _ in range(2):
        assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)
        assert bench.read(C).data == bench.answer_of(len(bench.asked) - 1)
        assert bench.write(A, 5).data == b''
        assert bench.write(C, 5, 6).data == b''
    # nothing had to be resynchronised
    assert bench.asked == [0x400, 0x3EC, 0x400, 0x3EC] * 2
    bench.wire.check_gaps()


def test_echo_of_function_06_is_not_its_answer() -> None:
    bench = EchoingBench([Fate(), Fate(what='drop')])
    bench.read(A)
    error = bench.expect(NoAnswer, lambda: bench.write(A, 5))
    assert error.maybe_done
    assert bench.write(A, 5).data == b''


def test_echo_is_learnt_even_from_a_drive_that_is_silent() -> None:
    bench = EchoingBench([Fate(what='drop'), Fate(what='drop')])
    bench.expect(NoAnswer, lambda: bench.read(A))
    bench.expect(NoAnswer, lambda: bench.write(A, 5))


def test_echo_is_learnt_behind_noise() -> None:
    bench = EchoingBench([Fate(), Fate(what='drop')])
    bench.echo = lambda frame: b'\x00\xff' + frame
    assert bench.read(A).data == bench.answer_of(0)
    bench.expect(NoAnswer, lambda: bench.write(A, 5))


def test_refusals_with_an_echo() -> None:
    bench = EchoingBench([Fate(), Fate(what='refuse'), Fate(what='refuse')])
    bench.read(A)
    bench.expect(Refused, lambda: bench.read(B))
    bench.expect(Refused, lambda: bench.write(B, 5))


def test_damaged_answer_behind_an_echo() -> None:
    bench = EchoingBench([Fate(what='damage')] * 2)
    bench.expect(DamagedAnswer, lambda: bench.read(A))
    bench.expect(DamagedAnswer, lambda: bench.write(A, 5))


@pytest.mark.parametrize('what', ['cut', 'spoilt', 'nothing'])
def test_damaged_echo(what: str) -> None:
    bench = EchoingBench()
    bench.read(A)
    bench.echo = {
        'cut': lambda frame: frame[1:],
        'spoilt': lambda frame: frame[:3] + b'\x7f' + frame[4:],
        'nothing': lambda frame: b'',
    }[what]
    # what came may be the echo or the answer: it is not believed
    bench.expect(NoAnswer, lambda: bench.write(A, 5))
    if what != 'nothing':
        bench.echo = lambda frame: frame
    # the next read tells whether there is an echo at all
    assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)
    assert bench.write(B, 5).data == b''


def test_late_answer_behind_an_echo() -> None:
    bench = EchoingBench([Fate(), Fate(1.5)])
    bench.read(D)
    bench.expect(NoAnswer, lambda: bench.read(A))
    assert bench.read(B).data == bench.answer_of(3)
    assert bench.asked == [0x2A8, 0x400, 0x258, 0x264]


def test_opening_again_forgets_the_echo() -> None:
    bench = EchoingBench()
    bench.read(A)
    bench.link.close()
    bench.link.open()
    bench.echo = lambda frame: b''
    before = bench.wire.now
    assert bench.write(A, 5).data == b''
    assert bench.wire.now - before < TIMEOUT


# --- answers that come twice ----------------------------------------------------------------------


class SameWords(Slave):
    """Says the same whatever it is asked, so that answers cannot be distinguished."""

    @staticmethod
    def words(register: int, count: int, number: int) -> tuple[int, ...]:
        return (0,) * count


def numbers_of(bench: Bench, address: Address, since: int) -> list[int]:
    """
    Which requests asked for a parameter since there had been so many.

    The same question asked twice may be answered with the first answer: it is about that.
    """
    return [
        number
        for number in range(max(0, since - 1), len(bench.asked))
        if bench.asked[number] == address.index
    ]


def answers(bench: Bench, address: Address, since: int) -> list[bytes]:
    """What the drive said about a parameter."""
    return [bench.answer_of(number) for number in numbers_of(bench, address, since)]


@pytest.mark.parametrize('again', [0.05, 0.1, 0.2, 0.5, 0.9])
@pytest.mark.parametrize('lump', [False, True])
@pytest.mark.parametrize('echoes', [False, True])
def test_second_answer_is_not_taken_for_the_next_one(
    again: float, lump: bool, echoes: bool
) -> None:
    bench = (EchoingBench if echoes else Bench)([Fate(what='double', again=again, lump=lump)])
    assert bench.read(A).data == bench.answer_of(0)
    for address in (B, A, B):
        before = len(bench.asked)
        with contextlib.suppress(DamagedAnswer):
            reply = bench.read(address).data
            assert reply in answers(bench, address, before)


def test_second_answer_is_said() -> None:
    bench = Bench([Fate(what='double', again=0.2)])
    bench.read(A)
    error = bench.expect(DamagedAnswer, lambda: bench.read(B))
    assert 'came twice' in str(error)
    # that is over now
    assert bench.read(B).data == bench.answer_of(len(bench.asked) - 1)
    assert bench.asked == [0x400, 0x264, 0x258, 0x264]


def test_same_words_twice_are_believed_after_a_resync_read() -> None:
    bench = Bench()
    bench.slave = SameWords(bench.wire)
    for address in (A, B, C, D, A):
        assert bench.read(address).data == bytes(address.size)
    assert bench.asked == [0x400, 0x264, 0x258, 0x3EC, 0x2A5, 0x2A8, 0x400]
    bench.wire.check_gaps()


def test_same_question_twice_is_believed_at_once() -> None:
    bench = Bench()
    bench.slave = SameWords(bench.wire)
    for address in (A, A, C, A):
        bench.read(address)
    assert bench.asked == [0x400, 0x400, 0x3EC, 0x400]
    # but one more may come, and that would look like an answer to B
    bench.read(A)
    bench.read(B)
    assert bench.asked[4:] == [0x400, 0x258, 0x264]


def test_same_words_after_a_while_are_believed_at_once() -> None:
    bench = Bench()
    bench.slave = SameWords(bench.wire)
    bench.read(A)
    bench.wire.now += 1.1 * TIMEOUT
    bench.read(B)
    assert bench.asked == [0x400, 0x264]


def test_same_answer_to_a_write_needs_no_resync_read() -> None:
    # it names what was written
    bench = Bench()
    bench.write(A, 5)
    bench.write(A, 5)
    assert bench.asked == [0x400, 0x400]


def test_second_refusal_is_not_taken_for_that_of_the_next_request() -> None:
    bench = Bench([Fate(what='refuse twice', again=0.2)])
    bench.expect(Refused, lambda: bench.read(A))
    bench.expect(DamagedAnswer, lambda: bench.read(B))
    assert bench.read(B).data == bench.answer_of(len(bench.asked) - 1)


class SameRefusal(Slave):
    """Refuses everything with the same code, as a drive of another family."""

    @staticmethod
    def code(number: int) -> int:
        return Refused.ILLEGAL_ADDRESS


def test_same_refusals_are_believed_even_where_resync_reads_are_refused() -> None:
    bench = Bench()
    bench.slave = SameRefusal(bench.wire, iter([Fate(what='refuse')] * 9))
    for address in (A, B, C):
        bench.expect(Refused, lambda address=address: bench.read(address))


def test_refusal_behind_the_same_question_twice_is_believed() -> None:
    bench = Bench([Fate(), Fate(), Fate(what='refuse')])
    bench.slave.words = SameWords.words  # type: ignore[method-assign]
    bench.read(A)
    bench.read(A)
    bench.expect(Refused, lambda: bench.read(C))


def test_second_refusal_is_noticed_even_where_resync_reads_are_refused() -> None:
    bench = Bench()
    fates = [Fate(what='refuse twice', again=0.2), Fate(), *[Fate(what='refuse')] * 9]
    bench.slave = SameRefusal(bench.wire, iter(fates))
    bench.expect(Refused, lambda: bench.read(A))
    bench.expect(DamagedAnswer, lambda: bench.read(B))


def test_same_words_without_resync_reads_are_believed_after_an_identification() -> None:
    bench = Bench(resync=())
    bench.slave = SameWords(bench.wire)
    for address in (A, B, A):
        bench.read(address)
    assert [function for _, function, _, _ in bench.slave.requests] == [3, 3, 17, 3]


AGAIN = st.lists(
    st.builds(
        Fate,
        st.one_of(st.just(0.0), st.floats(0, 3)),
        st.sampled_from(['answer', 'answer', 'drop', 'refuse', 'double', 'refuse twice']),
        st.booleans(),
        st.one_of(st.floats(0.02, 0.9)),
    ),
    max_size=25,
)


def one_thing_at_a_time(fates: list[Fate]) -> Iterator[Fate]:
    """Answer the request behind one that is answered twice: who counts would be misled."""
    twice = False
    for fate in fates:
        yield replace(fate, what='answer') if twice else fate
        twice = not twice and fate.what in ('double', 'refuse twice')


@hypothesis_settings(max_examples=300)
@given(AGAIN, STEPS, st.booleans())
@example([Fate(what='double', again=0.1)], [('A', 0.0), ('B', 0.0), ('A', 0.0)], False)
@example(
    [Fate(), Fate(what='double', again=0.5), Fate(2.0), Fate(lump=True)],
    [('write A', 0.0), ('write A', 0.0), ('A', 0.0), ('write A', 0.0), ('A', 0.0)],
    False,
)
def test_every_answer_belongs_to_its_request(
    fates: list[Fate], steps: list[tuple[str, float]], echoes: bool
) -> None:
    bench = (EchoingBench if echoes else Bench)(list(one_thing_at_a_time(fates)))
    with contextlib.suppress(LinkError):
        # the first read tells whether there is an echo
        bench.link.read(UNIT, D)
    for what, pause in steps:
        bench.wire.now += pause * TIMEOUT
        address = NAMES[what[-1]]
        before = len(bench.asked)
        try:
            if what.startswith('write'):
                bench.write(address, *(7,) * (address.size // 2))
            else:
                reply = bench.read(address).data
                assert reply in answers(bench, address, before)
        except Refused as refusal:
            numbers = numbers_of(bench, address, before)
            assert refusal.code in [bench.slave.code(number) for number in numbers]
        except LinkError:
            pass
    bench.wire.check_gaps()


# --- a real port ----------------------------------------------------------------------------------


class EchoingLine:
    """The far end of a pseudo-terminal: echoes what comes, then answers, or not."""

    def __init__(self, pty: Pty, kind: str) -> None:
        self._far = pty.far
        self._ascii = kind == 'ascii'
        self.silent = False
        self.stop = False
        self.thread = threading.Thread(target=self._work, daemon=True)
        self.thread.start()

    def _work(self) -> None:
        data = b''
        while not self.stop:
            if not select.select([self._far], [], [], 0.02)[0]:
                continue
            data += os.read(self._far, 100)
            if data.endswith(b'\r\n') if self._ascii else len(data) == 8:
                os.write(self._far, data)
                if not self.silent:
                    os.write(self._far, self._answer(data))
                data = b''

    def _answer(self, data: bytes) -> bytes:
        message = bytes.fromhex(data[1:-4].decode()) if self._ascii else data[:-2]
        if message[1] == 3:
            message = message[:2] + b'\x02\x00\x25'
        return opinion.ascii_frame(message) if self._ascii else message + opinion.crc(message)


@pytest.fixture
def pty() -> Iterator[Pty]:
    pty = Pty()
    yield pty
    pty.hang_up()


def test_echo_on_a_real_port(pty: Pty, kind: str) -> None:
    protocol = f'modbus_{kind}'
    link = BusSettings(pty.path, protocol, response_timeout=1.0).open()
    line = EchoingLine(pty, kind)
    link.open()
    try:
        assert link.read(1, A).data == packed(37)
        assert link.write(1, A, packed(5)).data == b''
        line.silent = True
        with pytest.raises(NoAnswer):
            link.write(1, A, packed(5))
        line.silent = False
        assert link.write(1, A, packed(6)).data == b''
        assert link.read(1, A).data == packed(37)
    finally:
        link.close()
        line.stop = True
        line.thread.join(PATIENCE)
