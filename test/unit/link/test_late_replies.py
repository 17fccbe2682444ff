# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What to believe while replies may still come, without any line."""

from __future__ import annotations

from typing import NamedTuple

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.catalog import Access, load_family
from nfo_sinus_driver.link import NotReady
from nfo_sinus_driver.link.late_replies import LATEST_REPLY, SUSPECT_FOR, Doubt, LateReplies

TIMEOUT = 0.2
UNIT = 1
#: When all of this happens.
NOW = 1000.0


class Ask(NamedTuple):
    """A request whose answers are of a kind, or a refusal of that kind."""

    kind: str
    unit: int = UNIT


def kinds(request: Ask) -> tuple[str, str]:
    return request.kind, f'no {request.kind}'


def make() -> LateReplies[Ask, str]:
    return LateReplies(TIMEOUT, kinds)


def waits(count: int, lost: list[float]) -> list[float]:
    """
    Ask questions that have so many kinds of replies, and lose each.

    :param lost: how long each transaction takes beyond its time-out, s.
    :returns: how long one had to wait before each.
    """
    late: LateReplies[Ask, int] = LateReplies(TIMEOUT, lambda request: ())
    now, waited = NOW, []
    for more in lost:
        began = now
        questions = [(kind, (kind,)) for kind in range(count)]
        try:
            question = late.first_certain(UNIT, questions, now)
        except NotReady as error:
            now = error.until
            question = late.first_certain(UNIT, questions, now)
        waited.append(now - began)
        assert question not in late.quarantined(UNIT, now)
        now += TIMEOUT + more
        late.quarantine(UNIT, (question,), now)
    return waited


LOST = st.lists(st.floats(0.001, 0.3), max_size=30)


@given(LOST)
def test_of_four_questions_one_is_always_certain(lost: list[float]) -> None:
    assert waits(4, lost) == [0.0] * len(lost)


@given(LOST)
def test_of_three_questions_one_is_certain_after_a_time_out(lost: list[float]) -> None:
    assert all(wait <= TIMEOUT for wait in waits(3, lost))


def test_of_two_questions_none_is_for_two_time_outs() -> None:
    # that is why two parameters to resync with are too few
    assert max(waits(2, [0.001] * 5)) == pytest.approx(2 * TIMEOUT, abs=0.01)


def test_a_quarantine_lasts_until_the_latest_reply_or_any_certain_one() -> None:
    late = make()
    late.expect(Ask('a'), NOW)
    late.quarantine(2, ('c',), NOW)
    assert late.quarantined(UNIT, NOW) == {'a', 'no a'}
    nearly = NOW + (LATEST_REPLY - 1) * TIMEOUT - 0.001
    assert late.quarantined(UNIT, nearly) == {'a', 'no a'}
    late.quarantine(UNIT, ('no a',), nearly)
    assert late.quarantined(UNIT, nearly + 0.002) == {'no a'}
    assert late.quarantined(2, nearly + 0.002) == set()
    late.release(UNIT)
    assert late.quarantined(UNIT, nearly + 0.002) == set()


def test_a_reply_that_names_no_unit_may_be_of_another() -> None:
    late = make()
    late.expect(Ask('A', 2), NOW)
    assert late.may_be_of_another(1, 'A', NOW) and late.may_be_of_another(1, 'no A', NOW)
    assert not late.may_be_of_another(1, 'B', NOW)
    assert not late.may_be_of_another(2, 'A', NOW), 'that is what it was asked itself'
    # what the one asked replies says nothing of the other
    late.release(1)
    assert late.may_be_of_another(1, 'A', NOW)
    assert not late.may_be_of_another(1, 'A', NOW + LATEST_REPLY * TIMEOUT)
    late.release(2)
    assert not late.may_be_of_another(1, 'A', NOW)


def test_a_question_is_certain_when_each_of_its_replies_is() -> None:
    late = make()
    late.quarantine(UNIT, ('a',), NOW)
    late.quarantine(UNIT, ('no a',), NOW + 0.1)
    with pytest.raises(NotReady) as raised:
        late.first_certain(UNIT, [('question', kinds(Ask('a')))], NOW + 0.1)
    assert raised.value.until == pytest.approx(NOW + 0.1 + 3 * TIMEOUT)


# --- received twice -------------------------------------------------------------------------------


def take(late: LateReplies[Ask, str], request: Ask, reply: bytes, now: float) -> None:
    """One transaction: a request goes out and is answered."""
    late.sent(request)
    late.note_reply(request, reply, now, 0.0)


@pytest.mark.parametrize(
    ('second', 'reply', 'later', 'trusted', 'untrusted'),
    [
        (Ask('b'), b'1', 0.1, Doubt.LISTEN, Doubt.RESYNC),
        (Ask('a'), b'1', 0.1, Doubt.NONE, Doubt.ONCE_MORE),
        # other bytes, or the same after a time-out, or those of another unit, are no repetition
        (Ask('b'), b'2', 0.1, Doubt.NONE, Doubt.NONE),
        (Ask('b'), b'1', 0.3, Doubt.NONE, Doubt.NONE),
        (Ask('b', 2), b'1', 0.1, Doubt.NONE, Doubt.NONE),
    ],
)
def test_doubt_about_the_same_bytes(
    second: Ask, reply: bytes, later: float, trusted: Doubt, untrusted: Doubt
) -> None:
    for unrequested, doubt in ((False, trusted), (True, untrusted)):
        late = make()
        if unrequested:
            late.note_unrequested(NOW)
        take(late, Ask('a'), b'1', NOW)
        take(late, second, reply, NOW + later)
        assert late.doubt_about(second, NOW + later) is doubt
        # what names what it is about is right, received once or twice
        assert late.doubt_about(second, NOW + later, names_it=True) in (Doubt.NONE, Doubt.ONCE_MORE)


def test_a_line_is_trusted_again_after_a_while() -> None:
    late = make()
    late.note_unrequested(NOW)
    over = NOW + SUSPECT_FOR
    for now, doubt in ((over - 1, Doubt.RESYNC), (over + 1, Doubt.LISTEN)):
        take(late, Ask('a'), b'1', now)
        take(late, Ask('b'), b'1', now + 0.1)
        assert late.doubt_about(Ask('b'), now + 0.1) is doubt
    late.sent(Ask('c'))
    assert late.doubt_about(Ask('c'), NOW) is Doubt.NONE, 'that is about the one before'


def test_what_comes_unrequested_may_come_once_more() -> None:
    late = make()
    late.note_unrequested(NOW)
    assert late.quarantined(UNIT, NOW) == set(), 'nothing was asked yet'
    late.sent(Ask('a'))
    late.note_unrequested(NOW)
    assert late.quarantined(UNIT, NOW) == {'a', 'no a'}
    late.clear()
    late.note_unrequested(NOW)
    assert late.quarantined(UNIT, NOW) == set(), 'that was on another connection'


@given(st.lists(st.floats(0, 10), min_size=1, max_size=60))
def test_a_slow_reply_is_remembered_and_forgotten(seconds: list[float]) -> None:
    late = make()
    for took in seconds:
        late.took(UNIT, took)
    # no reply that counts takes longer than the time-out
    assert late.longest(UNIT) >= min(1.25 * seconds[-1], TIMEOUT)
    assert late.longest(UNIT) <= min(1.25 * max(seconds), TIMEOUT)
    for _ in range(200):
        late.took(UNIT, 0.0)
    assert late.longest(UNIT) < 0.001
    assert late.longest(2) == 0.0


# --- what is asked meanwhile ----------------------------------------------------------------------


def test_what_is_asked_over_classic_is_in_the_table_of_every_firmware_and_does_nothing() -> None:
    model = load_family('sinus_g2')
    for key in model.profile.resync_reads['classic']:
        parameter = model[key]
        assert len(parameter.at('classic').numbers) == 1
        assert parameter.since is None
        assert parameter.access in (Access.READ, Access.READ_WRITE)


def test_what_is_asked_of_a_movitrac_is_in_its_table_and_does_nothing() -> None:
    model = load_family('movitrac31')
    for key in model.profile.resync_reads['movitrac']:
        parameter = model[key]
        assert parameter.option == '', 'every drive has it'
        assert parameter.access in (Access.READ, Access.READ_WRITE)
