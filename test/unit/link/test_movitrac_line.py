# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
MOVITRACs on a line: no answer names its drive, and each may be set to answer late (P843).

And their 34 return codes: each with its meaning and what to do about it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from hypothesis import example, given, settings as hypothesis_settings, strategies as st
from line_bench import Movitrac, at
import pytest
from virtual_wire import DROP, REFUSE, Fate

from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.link.interface import (
    DamagedAnswer,
    LineSettings,
    NoAnswer,
    NotReady,
    PortError,
    Refused,
)
from nfo_sinus_driver.link.pairs.movitrac import DONE, REFUSALS, refusal

A, B, LONG, VALUE = Movitrac.A, Movitrac.B, Movitrac.LONG, Movitrac.VALUE
SETTINGS = Movitrac.settings
TIMEOUT = SETTINGS.response_timeout
CHAR = SETTINGS.char_time
#: Two characters of silence between any two frames.
GAP = 2 * CHAR


@pytest.mark.parametrize('unit', [0, 1, 63])
def test_a_long_value_is_one_transaction(unit: int) -> None:
    bench = Movitrac()
    assert bench.link.protocol.parts(LONG) == (LONG,)
    assert bench.read(LONG, unit).data == bench.answer_of()
    bench.write(LONG, 2 * VALUE, unit)
    assert bench.drive.requests[1][:4] == (unit, LONG.index, 8, 2 * VALUE)
    assert bench.wire.gap == GAP


@pytest.mark.parametrize(('address', 'came'), [(at(LONG.index), 8), (at(0x19, 8), 4)])
def test_a_value_of_another_size_is_not_taken(address: object, came: int) -> None:
    bench = Movitrac()
    assert isinstance(address, type(A))
    problem = f'index {address.index}: a value of {came} bytes came instead of {address.size}'
    with pytest.raises(DamagedAnswer, match=problem):
        bench.read(address)


# --- how long an answer may take ------------------------------------------------------------------


@pytest.mark.parametrize('response_time', [0.0, 0.01, 0.1, 0.2])
def test_any_response_time_of_the_drive_is_right(response_time: float) -> None:
    bench = Movitrac()
    bench.drive.response_time = response_time
    start = bench.wire.now
    for number in range(20):
        assert bench.read(A).data == bench.answer_of(2 * number)
        bench.write(B)
    assert bench.asked == [A.index, B.index] * 20
    transactions = 20 * ((5 + 8 + 9 + 2) * CHAR + 2 * GAP + 2 * response_time)
    assert bench.wire.now - start == pytest.approx(transactions, abs=GAP)


def time_out(bench: Movitrac) -> float:
    """Return from the end of a request to the end of its time-out."""
    start = bench.wire.now
    bench.expect(NoAnswer, lambda: bench.read(A))
    return bench.wire.now - start - 5 * CHAR


@pytest.mark.parametrize('response_time', [0.0, 0.1, 0.2])
def test_how_long_a_drive_is_waited_for_follows_its_response_time(response_time: float) -> None:
    bench = Movitrac(DROP, *[Fate()] * 5, DROP)
    bench.drive.response_time = response_time
    # its time is not known yet
    assert time_out(bench) == pytest.approx(0.2 + TIMEOUT, abs=0.003)
    bench.wire.now += 10
    for _ in range(5):
        bench.read(A)
    bench.wire.now += 1
    assert time_out(bench) == pytest.approx(1.25 * response_time + TIMEOUT, abs=0.003)


def test_a_response_time_that_is_changed_at_the_keypad_costs_one_answer() -> None:
    bench = Movitrac(settings=replace(SETTINGS, response_timeout=0.1))
    for _ in range(5):
        bench.read(A)
    bench.drive.response_time = 0.2
    bench.expect(NoAnswer, lambda: bench.read(A))
    for _ in range(5):
        assert bench.read(A).data == bench.answer_of()
    assert bench.asked == [A.index] * 6 + [206] + [A.index] * 5


def test_a_pause_within_an_answer() -> None:
    bench = Movitrac()
    frame = bytes.fromhex('C8 00 19 00 00 03 70 54')

    def far_end(_: bytes, end: float) -> None:
        # the first byte at the last moment, and then as a USB adapter hands it over
        middle = bench.wire.arrive(end + 0.2 + TIMEOUT - 2 * CHAR, frame[:1])
        bench.wire.arrive(middle + 0.025, frame[1:])

    bench.wire.far_end = far_end
    assert bench.read(A).data == VALUE


# --- noise ----------------------------------------------------------------------------------------


@pytest.mark.parametrize('glitch', [b'\x00', b'\xff', b'\xff\x00'])
def test_a_glitch_when_a_transmitter_is_switched_costs_nothing(glitch: bytes) -> None:
    bench = Movitrac()
    bench.drive.before = bench.drive.after = glitch
    for _ in range(3):
        for _ in range(2):
            assert bench.read(A).data == bench.answer_of()
        bench.write(A)
    assert bench.asked == [A.index] * 9


@pytest.mark.parametrize('noise', [b'\x00\x00\x00', b'\xac', b'\xc8\x00\x19', b'\xd2\xd3'])
def test_noise_before_an_answer(noise: bytes) -> None:
    bench = Movitrac()
    bench.drive.before = noise
    assert bench.read(A).data == bench.answer_of(0)
    assert bench.expect(DamagedAnswer, lambda: bench.write(A)).maybe_done


# --- other drives on the line ---------------------------------------------------------------------


def test_a_dead_drive_costs_its_neighbours_no_time() -> None:
    bench = Movitrac()
    for unit in (1, 2):
        bench.read(A, unit)
    bench.drive.heal(DROP)
    bench.expect(NoAnswer, lambda: bench.read(A))
    began = bench.wire.now
    assert bench.read(A, unit=2).data == bench.answer_of()
    bench.write(A, unit=2)
    assert bench.wire.now - began < (5 + 8 + 9 + 2 + 4 + 3) * CHAR


def test_what_every_drive_has_is_enough_for_one_question_to_be_certain() -> None:
    # however long it is waited for: then a lost one is in doubt for as long as three more take
    bench = Movitrac(*[DROP] * 30, settings=replace(Movitrac.settings, response_timeout=2.0))
    for address in (A, at(207), at(206)) * 10:
        bench.expect(NoAnswer, lambda address=address: bench.read(address))


@pytest.mark.parametrize('written', [False, True])
def test_late_answer_of_another_drive_is_not_taken(written: bool) -> None:
    bench = Movitrac()
    bench.drive.response_time = 0.03
    for unit in (1, 2):
        bench.read(A, unit)
    # it comes while the other one is asked for the same
    bench.drive.heal(Fate(1.1))
    act = bench.write if written else bench.read
    bench.expect(NoAnswer, lambda: act(A, unit=1))
    error = bench.expect(DamagedAnswer, lambda: act(A, unit=2))
    assert error.maybe_done and 'two answers came, one of them is late' in str(error)
    for _ in range(2):
        bench.wire.now += 1
        assert bench.read(A, unit=2).data == bench.answer_of()
        bench.write(A, unit=2)
    # to another question it does not matter
    bench.drive.heal(Fate(1.1))
    bench.expect(NoAnswer, lambda: bench.read(A, unit=1))
    assert bench.read(B, unit=2).data == bench.answer_of()


def test_value_sent_again_before_it_can_be_the_answer() -> None:
    bench = Movitrac()
    bench.read(A)
    again = bytes.fromhex('C8 00 19') + bench.answer_of(0)
    again += bytes((sum(again) % 256,))
    bench.drive.response_time = 0.03
    # behind the gap, while the next request is on its way
    bench.wire.arrive(bench.wire.now + 2.5 * CHAR, again)
    bench.wire.now += 2.2 * CHAR
    error = bench.expect(DamagedAnswer, lambda: bench.read(A, unit=2))
    assert 'two answers came' in str(error)


@hypothesis_settings(max_examples=400)
@given(
    st.lists(st.builds(Fate, st.floats(0, 3)), max_size=5),
    st.lists(st.tuples(st.sampled_from([1, 2, 3]), st.sampled_from([A, B])), max_size=20),
    st.sampled_from([0.01, 0.2]),
)
@example([Fate(2.1)], [(1, A), (2, A), (1, A), (2, A)], 0.03)
def test_no_value_is_that_of_another_drive(
    late: list[Fate], steps: list[tuple[int, object]], response_time: float
) -> None:
    bench = Movitrac()
    bench.drive.response_time = response_time

    def one_at_a_time() -> Iterator[Fate]:
        # however late: of two that are, neither names the drive that it comes from
        there = 0.0
        for fate in late:
            while bench.wire.now < there:
                yield Fate()
            there = bench.wire.now + (fate.delay + 1) * TIMEOUT + response_time
            yield fate

    bench.drive.meet(one_at_a_time())
    for unit, address in steps:
        assert isinstance(address, type(A))
        try:
            reply = bench.read(address, unit).data
        except (NoAnswer, DamagedAnswer, NotReady):
            bench.wire.now += 0.1 * TIMEOUT
            continue
        assert bench.drive.requests[-1][:2] == (unit, address.index)
        assert reply == bench.answer_of()


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
    check = Movitrac().link.protocol.check
    for word in ('X4', 'X20', 'USS 11A', 'UST 11A', 'P842', '67/68', 'P880', '9600', '8N1'):
        assert word in check


def test_a_closed_port() -> None:
    link = open_link('movitrac', '/dev/does-not-exist', SETTINGS)
    with pytest.raises(PortError, match='does not exist'):
        link.open()
    link.close()


# --- return codes ---------------------------------------------------------------------------------

#: Words of the manual's table [M4 §2.1.2], and what a program makes of each code.
MANUAL = {
    0x10: ('illegal index', 'no parameter'),
    0x11: ('not implemented', 'no parameter'),
    0x12: ('read access only', 'no parameter'),
    0x13: ('parameter lock (P800) active', 'settings'),
    0x14: ('factory setting (P830) running', 'busy'),
    0x15: ('too large', 'value'),
    0x16: ('too small', 'value'),
    0x17: ('option pcb', 'no parameter'),
    0x18: ('fault in system software', 'state'),
    0x19: ('via this serial interface', 'state'),
    0x1A: ('speed control (P770) active', 'settings'),
    0x1B: ('unauthorized access', 'state'),
    0x1C: ('output stage is not inhibited', 'release'),
    0x1D: ('invalid parameter value', 'value'),
    0x22: ('4Q operation 1 (P890) required', 'settings'),
    0x23: ('4Q operation 2 (P891) required', 'settings'),
    0x24: ('DC braking 1 (P730) active', 'settings'),
    0x25: ('DC braking 2 (P733) active', 'settings'),
    0x26: ('hoist function set 1 (P710) active', 'settings'),
    0x27: ('hoist function set 2 (P712) active', 'settings'),
    0x29: ('via this serial interface', 'state'),
    0x2A: ('speed control (P770) inactive', 'settings'),
    0x2B: ('controller inhibit required', 'release'),
    0x2C: ('motor size-up 1 (P328) and rapid start 1 (P720)', 'settings'),
    0x2D: ('motor size-up 2 (P348) and rapid start 2 (P723)', 'settings'),
    0x2E: ('option pcb', 'no parameter'),
    0x2F: ('4Q operation 1 (P890) and DC braking 1 (P730)', 'settings'),
    0x30: ('4Q operation 2 (P891) and DC braking 2 (P733)', 'settings'),
    0x31: ('controller inhibit active', 'state'),
    0x32: ('synchronous operation control (P760) inactive', 'settings'),
    0x33: ('slave of the synchronous operation control (P761)', 'settings'),
    0x34: ('illegal message type', 'no function'),
}
KINDS = {
    'no parameter': Refused.ILLEGAL_ADDRESS,
    'value': Refused.ILLEGAL_VALUE,
    'state': Refused.DEVICE_FAILURE,
    'settings': Refused.SETTINGS_CONFLICT,
    'release': Refused.RELEASE_NEEDED,
    'busy': Refused.BUSY,
    'no function': Refused.ILLEGAL_FUNCTION,
}


def test_every_code_of_the_manual_is_known() -> None:
    # the other two inform
    assert REFUSALS.keys() == MANUAL.keys() and DONE.keys() == {0x1E, 0x28}
    assert len(REFUSALS) + len(DONE) == 34


@pytest.mark.parametrize('code', MANUAL)
def test_a_refusal_says_what_it_means_and_what_to_do(code: int) -> None:
    bench = Movitrac(REFUSE)
    bench.drive.code = code
    with pytest.raises(Refused) as raised:
        bench.write(A)
    meaning, kind = MANUAL[code]
    assert raised.value.code == KINDS[kind]
    assert meaning in str(raised.value)
    text, _, remedy = str(raised.value).partition(': ')
    assert text and remedy.removesuffix(f' (return code {code:02X})') == REFUSALS[code].remedy
    assert str(raised.value) == raised.value.behind.removeprefix(': ')
    assert bench.asked == [A.index]


@pytest.mark.parametrize('code', DONE)
def test_what_only_informs_is_done(code: int) -> None:
    bench = Movitrac(REFUSE, REFUSE)
    bench.drive.code = code
    assert bench.write(A).data == b''
    # nothing was asked for that could be done
    with pytest.raises(Refused, match=f'return code {code:02X}'):
        bench.read(A)


@pytest.mark.parametrize('code', [0, 0x0F, 0x1F, 0x21, 0x35, 0xFF])
def test_a_code_that_no_manual_lists(code: int) -> None:
    bench = Movitrac(REFUSE)
    bench.drive.code = code
    with pytest.raises(Refused, match=f'no manual lists why .return code {code:02X}.') as raised:
        bench.read(A)
    assert raised.value.code == Refused.DEVICE_FAILURE
    assert str(raised.value) == str(refusal(code))


@pytest.mark.parametrize('code', [0x1C, 0x2B])
def test_a_remedy_for_inhibit_names_what_an_operator_has(code: int) -> None:
    # the name of the command is added where that is known
    assert 'quick stop' in REFUSALS[code].remedy
    assert '/Controller inhibit' in REFUSALS[code].remedy
