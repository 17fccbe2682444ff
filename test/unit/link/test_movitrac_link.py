# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One transaction after the other with a MOVITRAC, on a line in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from movitrac_bench import CHAR, LONG, RESYNC, SETTINGS, TIMEOUT, UNIT, VALUE, A, B, Bench, at
from movitrac_far_end import Fate
import pytest
from support.plans import followed
from virtual_wire import run_late

from nfo_sinus_driver.link import Identification, movitrac, open_link
from nfo_sinus_driver.link.interface import (
    DamagedAnswer,
    LineSettings,
    NeverSilent,
    NoAnswer,
    PortError,
)

#: Two characters of silence between any two frames.
GAP = 2 * CHAR
LONG_VALUE = bytes.fromhex('00000001 08060a00')


# --- plain transactions ---------------------------------------------------------------------------


@pytest.mark.parametrize('lump', [False, True])
@pytest.mark.parametrize('unit', [0, 1, 63])
def test_read_and_write(lump: bool, unit: int) -> None:
    bench = Bench(*[Fate(lump=lump)] * 4)
    assert bench.read(A, unit).data == bench.answer_of(0)
    assert bench.write(A, VALUE, unit).data == b''
    assert bench.read(LONG, unit).data == bench.answer_of(2)
    assert bench.write(LONG, LONG_VALUE, unit).data == b''
    assert [request[:3] for request in bench.drive.requests] == [
        (unit, A.index, None),
        (unit, A.index, VALUE),
        (unit, LONG.index, None),
        (unit, LONG.index, LONG_VALUE),
    ]
    bench.wire.check_gaps()


def test_a_long_value_is_one_transaction() -> None:
    assert Bench().link.protocol.parts(LONG) == (LONG,)


def test_the_line_is_used_to_its_limit() -> None:
    bench = Bench()
    bench.read(A)
    start = bench.wire.now
    for unit in range(10):
        bench.read(A, unit)
        bench.write(A, VALUE, unit)
    # 5 characters there, 8 back; 9 and 2; and two of silence before each request
    assert bench.wire.now - start == pytest.approx(10 * (5 + 8 + 9 + 2) * CHAR + 20 * GAP)
    bench.wire.check_gaps()


def test_reply_says_when_its_last_byte_came() -> None:
    bench = Bench(Fate(0.5))
    assert bench.read(A).arrived == bench.wire.now == bench.wire.seen[-1][0]
    bench.wire.now += 1
    assert bench.write(A).arrived == bench.wire.now == bench.wire.seen[-1][0]


def test_write_and_read_is_two_transactions() -> None:
    bench = Bench()
    reply = bench.link.write_and_read(UNIT, A, VALUE, B)
    assert reply.data == bench.answer_of(1)
    assert bench.asked == [A.index, B.index]


@pytest.mark.parametrize('what', ['answer', 'refuse', 'drop', 'damage', 'double'])
def test_nothing_comes_between_a_read_that_does_something_and_the_write(what: str) -> None:
    bench = Bench(Fate(what=what))
    reply = bench.link.read_then_write(UNIT, A, B, VALUE)
    assert reply.data == b''
    assert [request[1:3] for request in bench.drive.requests] == [
        (A.index, None),
        (B.index, VALUE),
    ]


def test_a_write_that_fails_behind_a_read_may_be_done() -> None:
    bench = Bench(Fate(), Fate(what='refuse'))
    with pytest.raises(Exception, match='P800') as raised:
        bench.link.read_then_write(UNIT, A, B, VALUE)
    assert vars(raised.value)['maybe_done']


def test_no_drive_is_asked_for_its_identity() -> None:
    bench = Bench()
    assert followed(bench.link.identify(UNIT)) == Identification()
    assert bench.asked == []


@pytest.mark.parametrize(('address', 'came'), [(at(LONG.index), 8), (at(0x19, 8), 4)])
def test_a_value_of_another_size_is_not_taken(address: object, came: int) -> None:
    bench = Bench()
    assert isinstance(address, type(A))
    problem = f'index {address.index}: a value of {came} bytes came instead of {address.size}'
    with pytest.raises(DamagedAnswer, match=problem):
        bench.read(address)


# --- how long an answer may take ------------------------------------------------------------------


@pytest.mark.parametrize('response_time', [0.0, 0.01, 0.1, 0.2])
def test_any_response_time_of_the_drive_is_right(response_time: float) -> None:
    bench = Bench()
    bench.drive.response_time = response_time
    start = bench.wire.now
    for number in range(20):
        assert bench.read(A).data == bench.answer_of(2 * number)
        bench.write(B)
    assert bench.asked == [A.index, B.index] * 20
    transactions = 20 * ((5 + 8 + 9 + 2) * CHAR + 2 * GAP + 2 * response_time)
    assert bench.wire.now - start == pytest.approx(transactions, abs=GAP)


def time_out(bench: Bench) -> float:
    """Return from the end of a request to the end of its time-out."""
    start = bench.wire.now
    with pytest.raises(NoAnswer):
        bench.read(A)
    return bench.wire.now - start - 5 * CHAR


@pytest.mark.parametrize('response_time', [0.0, 0.1, 0.2])
def test_how_long_a_drive_is_waited_for_follows_its_response_time(response_time: float) -> None:
    bench = Bench(Fate(what='drop'), *[Fate()] * 5, Fate(what='drop'))
    bench.drive.response_time = response_time
    # its time is not known yet
    assert time_out(bench) == pytest.approx(0.2 + TIMEOUT, abs=0.003)
    bench.wire.now += 10
    for _ in range(5):
        bench.read(A)
    bench.wire.now += 1
    assert time_out(bench) == pytest.approx(1.25 * response_time + TIMEOUT, abs=0.003)


def test_a_response_time_that_is_changed_at_the_keypad_costs_one_answer() -> None:
    bench = Bench(settings=replace(SETTINGS, response_timeout=0.1))
    for _ in range(5):
        bench.read(A)
    bench.drive.response_time = 0.2
    with pytest.raises(NoAnswer):
        bench.read(A)
    for _ in range(5):
        assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)
    assert bench.asked == [A.index] * 6 + [RESYNC] + [A.index] * 5


def test_a_pause_within_an_answer() -> None:
    bench = Bench(Fate(what='drop'))
    frame = bytes.fromhex('C8 00 19 00 00 03 70 54')

    def far_end(_: bytes, end: float) -> None:
        # the first byte at the last moment, and then as a USB adapter hands it over
        middle = bench.wire.arrive(end + 0.2 + TIMEOUT - 2 * CHAR, frame[:1])
        bench.wire.arrive(middle + 0.025, frame[1:])

    bench.wire.far_end = far_end
    assert bench.read(A).data == VALUE


# --- damage ---------------------------------------------------------------------------------------


def test_silence() -> None:
    bench = Bench(Fate(what='drop'), Fate(what='drop'))
    for act in (lambda: bench.read(A), lambda: bench.write(A)):
        with pytest.raises(NoAnswer, match='unit 1 did not answer') as raised:
            act()
        assert raised.value.maybe_done


@pytest.mark.parametrize('act', [lambda bench: bench.read(A), lambda bench: bench.write(A)])
def test_damaged_answer(act: Callable[[Bench], object]) -> None:
    bench = Bench(Fate(what='damage'))
    with pytest.raises(DamagedAnswer, match=r'[28] bytes came that are no answer') as raised:
        act(bench)
    assert raised.value.maybe_done


@pytest.mark.parametrize('glitch', [b'\x00', b'\xff', b'\xff\x00'])
def test_a_glitch_when_a_transmitter_is_switched_costs_nothing(glitch: bytes) -> None:
    bench = Bench()
    bench.drive.before = bench.drive.after = glitch
    for _ in range(3):
        assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)
        bench.write(A)
    assert bench.asked == [A.index] * 6


@pytest.mark.parametrize('noise', [b'\x00\x00\x00', b'\xac', b'\xc8\x00\x19', b'\xd2\xd3'])
def test_noise_before_an_answer(noise: bytes) -> None:
    bench = Bench()
    bench.drive.before = noise
    assert bench.read(A).data == bench.answer_of(0)
    with pytest.raises(DamagedAnswer) as raised:
        bench.write(A)
    assert raised.value.maybe_done


def test_wrong_line_settings_are_garbage_and_no_answer() -> None:
    bench = Bench()
    bench.wire.far_end = lambda frame, end: bench.wire.arrive(end, b'\x00\x80\xf8\x00\xfe\x1c')
    with pytest.raises(DamagedAnswer, match='6 bytes came that are no answer'):
        bench.read(A)


def drown(bench: Bench, seconds: float) -> None:
    """Let bytes come without a pause."""
    for number in range(int(seconds / CHAR)):
        bench.wire.arrive(bench.wire.now + number * CHAR, b'\x55')


def test_a_line_that_is_never_silent() -> None:
    bench = Bench()
    drown(bench, 5.0)
    with pytest.raises(NeverSilent) as raised:
        bench.read(A)
    assert not raised.value.maybe_done and bench.asked == []


def test_a_write_goes_out_into_noise() -> None:
    bench = Bench()
    start = bench.wire.now
    drown(bench, 5.0)
    with pytest.raises(DamagedAnswer):
        bench.write(A)
    assert bench.asked == [A.index]
    assert bench.wire.sent[0][0] - start < 0.025


# --- a line that echoes ---------------------------------------------------------------------------


def test_an_echo_is_recognised() -> None:
    bench = Bench()
    bench.drive.echo = True
    for _ in range(3):
        assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)
        bench.write(A)
        bench.write(LONG, LONG_VALUE)
    assert bench.asked == [A.index, A.index, LONG.index] * 3


def test_an_echo_and_silence_is_silence() -> None:
    bench = Bench(*[Fate(what='drop')] * 3)
    bench.drive.echo = True
    for act in (lambda: bench.write(A), lambda: bench.read(A)):
        with pytest.raises(NoAnswer):
            act()


def test_what_comes_before_the_echo_is_not_believed() -> None:
    bench = Bench()
    bench.drive.echo = True
    bench.read(A)
    bench.drive.heal(Fate(what='drop'))
    bench.wire.now += 1
    bench.wire.arrive(bench.wire.now + GAP, b'\xd2\xd2')
    with pytest.raises((NoAnswer, DamagedAnswer)):
        bench.write(A)


def test_an_adapter_that_echoes_no_more() -> None:
    bench = Bench()
    bench.drive.echo = True
    bench.read(A)
    bench.drive.echo = False
    with pytest.raises(DamagedAnswer):
        bench.read(A)
    for _ in range(3):
        bench.wire.now += 1
        assert bench.read(A).data == bench.answer_of(len(bench.asked) - 1)


# --- what a line may be ---------------------------------------------------------------------------


def test_the_manual_knows_one_setting_of_the_line() -> None:
    # [M4 §2.2.2], [M4 §2.3.3]
    for line in (LineSettings(19200, '8N1'), LineSettings(1200, '8N1')):
        with pytest.raises(ValueError, match=f'baud_rate {line.baud_rate}: movitrac has 9600'):
            open_link('movitrac', '/dev/x', line)
    for char_format in ('8E1', '7E1', '8N2'):
        with pytest.raises(ValueError, match=f"char_format '{char_format}': movitrac has 8N1"):
            open_link('movitrac', '/dev/x', LineSettings(9600, char_format))


def test_what_to_check_where_no_drive_answers() -> None:
    check = Bench().link.protocol.check
    for word in ('X4', 'X20', 'USS 11A', 'UST 11A', 'P842', '67/68', 'P880', '9600', '8N1'):
        assert word in check


def test_a_closed_port() -> None:
    link = open_link('movitrac', '/dev/does-not-exist', SETTINGS)
    with pytest.raises(PortError, match='does not exist'):
        link.open()
    link.close()


def test_a_driver_that_did_not_run_within_answers_blames_no_adapter() -> None:
    bench = Bench()
    run_late(bench.wire)
    for number in range(6):
        assert bench.read(A).data == bench.answer_of(number)
    assert not bench.link.remarks.texts


def test_answer_whose_pieces_an_adapter_holds_back() -> None:
    bench = Bench()
    bench.read(A)
    frame = movitrac.encode(movitrac.Data(LONG.index, 2 * VALUE))

    def far_end(request: bytes, end: float) -> None:
        for number in range(4):
            piece = frame[3 * number : 3 * number + 3]
            bench.wire.arrive(end + 0.06 * number, piece, lump=True)

    bench.wire.far_end = far_end
    assert all(bench.read(LONG).data == 2 * VALUE for _ in range(3))
    (remark,) = bench.link.remarks.texts
    assert 'latency timer' in remark
