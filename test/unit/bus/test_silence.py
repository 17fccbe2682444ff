# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How long who said nothing, without a line and without a clock."""

from __future__ import annotations

import math

import pytest

from nfo_sinus_driver.bus.silences import Silences
from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, PortError, Refused


def test_a_unit_without_requests_is_not_silent() -> None:
    silences = Silences()
    silences.note_request(1, 5.0, None)
    assert silences.lasts(1, 1000.0) == silences.lasts(2, 1000.0) == 0.0
    assert not silences.is_silent(1)
    assert silences.last_frame_at(1) == 5.0
    assert silences.last_frame_at(2) == -math.inf


@pytest.mark.parametrize('error', [NoAnswer(), DamagedAnswer(), LinkError()])
def test_silence_lasts_from_the_first_answer_that_is_missing(error: LinkError) -> None:
    silences = Silences()
    silences.note_request(1, 5.0, None)
    silences.note_request(2, 5.0, None)
    for now in (10.0, 10.2, 10.4):
        silences.note_request(1, now, error)
    assert silences.is_silent(1)
    assert silences.lasts(1, 11.0) == 1.0
    assert silences.last_frame_at(1) == 5.0
    assert not silences.is_silent(2)


@pytest.mark.parametrize('answer', [None, Refused(Refused.BUSY)])
def test_any_valid_frame_ends_it_a_refusal_too(answer: LinkError | None) -> None:
    silences = Silences()
    silences.note_request(1, 10.0, NoAnswer())
    silences.note_request(1, 10.9, answer)
    assert not silences.is_silent(1)
    assert silences.lasts(1, 11.0) == 0.0
    assert silences.last_frame_at(1) == 10.9
    silences.note_request(1, 12.0, NoAnswer())
    assert silences.lasts(1, 12.5) == 0.5


def test_a_port_that_is_gone_says_nothing_of_who_is_behind_it() -> None:
    silences = Silences()
    silences.note_request(1, 10.0, PortError())
    assert not silences.is_silent(1)


def test_where_the_whole_line_was_silent_the_others_are_asked_at_once_when_one_answers() -> None:
    silences = Silences()
    for unit in (1, 2):
        silences.note_request(unit, 10.0, None)
    for tenths in range(102, 142, 4):
        for unit in (1, 2):
            silences.note_request(unit, tenths / 10, NoAnswer(), 0.2)
    assert silences.is_missing(1, 14.2) and silences.is_missing(2, 14.2)
    silences.note_request(2, 14.2, None)
    # the line was cut: the stop of the other one need not wait, nor one more that a bounce loses
    silences.note_request(1, 14.4, NoAnswer(), 0.2)
    assert not silences.is_missing(1, 16.1)
    # it is missing for itself
    silences.note_request(2, 16.1, None)
    silences.note_request(1, 16.2, NoAnswer(), 0.2)
    assert silences.is_missing(1, 16.2) and silences.missing_from > 18.0


def test_a_missing_unit_gets_few_requests_as_long_as_others_answer() -> None:
    silences = Silences()
    for unit in (1, 2, 3):
        silences.note_request(unit, 10.0, None)
    silences.note_request(1, 11.0, NoAnswer(), 0.2)
    assert not silences.is_missing(1, 12.8)
    assert silences.is_missing(1, 12.9)
    # one lost answer, or one after a short silence, costs no pause
    assert silences.missing_from <= 11.0
    for now in (11.9, 13.0):
        silences.note_request(2, now, None)
    silences.note_request(1, 13.2, NoAnswer(), 0.2)
    assert silences.is_missing(1, 13.2)
    # the others keep nine tenths of the time at least
    assert silences.missing_from >= 13.2 + 9 * 0.2
    # and where no unit answers there is none to spare
    silences.note_request(2, 13.4, NoAnswer(), 0.2)
    silences.note_request(3, 13.6, NoAnswer(), 0.2)
    assert silences.missing_from <= 15.0
    silences.note_request(1, 16.0, None)
    assert not silences.is_missing(1, 16.0)


def test_a_unit_may_be_exchanged_while_the_worker_does_not_run() -> None:
    silences = Silences()
    for unit in (1, 2):
        silences.note_request(unit, 10.0, None)
    silences.note_request(1, 10.2, NoAnswer(), 0.2)
    for now in (12.2, 13.4):
        silences.paused(1.2)
        silences.note_request(2, now, None)
    # it was not asked in that time, so it is not lost
    assert silences.lasts(1, 13.4) == pytest.approx(0.9)
    assert silences.there_since(1, 13.4) == math.inf
    assert silences.there_since(2, 13.4) < 13.4
    silences.note_request(1, 13.5, None)
    assert silences.there_since(1, 13.6) == 13.5
