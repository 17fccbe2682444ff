# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A short fuzz campaign in every run; ``make fuzz`` is the long one."""

from __future__ import annotations

from fuzz import campaign, decoders, judges
from fuzz.campaign import CASE, CASES, Part
import pytest

from nfo_sinus_driver.link.canopen import lawicel, sdo
from nfo_sinus_driver.link.modbus import ascii, pdu, rtu
from nfo_sinus_driver.link.pairs import classic, movitrac

#: Fixed, so that every run goes through the same.
SEED = 11
FRAMES = 22_000


def test_no_decoder_lets_anything_but_typed_errors_out_or_takes_what_is_damaged() -> None:
    findings = campaign.run(Part(SEED, 0, FRAMES // CASE))
    assert not findings, f'--seed {SEED} --only {findings[0].frame}\n{findings[0].what}'


# --- what the judges would notice: each decoder with one mistake ----------------------------------


def _first(decoder: str, most: int = 20) -> campaign.Finding | None:
    """Return the first thing that is wrong in some cases of a decoder, if anything is."""
    count = len(CASES)
    cases = range(list(CASES).index(decoder), most * count, count)
    found = (finding for case in cases for finding in campaign.run(Part(SEED, case, case + 1)))
    return next(found, None)


def _what(decoder: str) -> str:
    finding = _first(decoder)
    assert finding is not None
    return finding.what


def test_a_check_sum_that_is_not_checked_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rtu, 'crc', lambda data: judges.seal_rtu(data)[-2:])
    assert _first('rtu', most=2) is None
    monkeypatch.setattr(rtu, 'crc', lambda data: AnyBytes())
    assert 'from a damaged frame' in _what('rtu')
    monkeypatch.setattr(ascii, 'lrc', lambda data: AnyBytes())
    finding = _first('ascii')
    assert finding is not None and 'from a damaged frame' in finding.what
    # and can be gone through again
    case = finding.frame // CASE
    assert campaign.run(Part(SEED, case, case + 1)) == [finding]


class AnyBytes:
    """Equal to everything."""

    def __eq__(self, other: object) -> bool:
        return True

    __hash__ = None  # type: ignore[assignment]


def test_a_wrong_block_check_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(classic, 'check_sum', lambda body: AnyBytes())
    assert 'not among the bytes' in _what('classic')


def test_a_wrong_sum_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(movitrac, 'check_sum', lambda body: AnyBytes())
    assert 'from a damaged frame' in _what('movitrac')


def test_an_ack_behind_remains_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(movitrac, 'is_glitch', lambda junk: True)
    assert 'was believed behind' in _what('movitrac')


def test_what_a_can_bus_says_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lawicel, '_STAMP', 0)
    assert 'instead of' in _what('lawicel')
    # a repeated segment is taken twice
    monkeypatch.setattr(sdo, '_TOGGLE', 0)
    assert 'instead of' in _what('sdo')


def test_an_answer_that_is_not_measured_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    def understand(request: pdu.Request[object], message: bytes) -> object:
        return request.decode(message) if message.startswith(request.answer_head) else None

    monkeypatch.setattr(decoders.pdu, 'understand', understand)
    assert _first('pdu')


def test_an_answer_that_is_overlooked_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    feed = classic.Reader.feed
    monkeypatch.setattr(classic.Reader, 'feed', lambda self, data: feed(self, data)[:1])
    assert 'was not found' in _what('classic')
    feed_one = movitrac.Reader.feed

    def feed_seldom(reader: movitrac.Reader, data: bytes) -> list[movitrac.Message]:
        found = feed_one(reader, data)
        return [message for message in found if not isinstance(message, movitrac.Data)]

    monkeypatch.setattr(movitrac.Reader, 'feed', feed_seldom)
    assert 'was not found' in _what('movitrac')


def test_memory_that_grows_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    kept: list[object] = []

    def case(random: object, frames: int) -> None:
        kept.extend([] for _ in range(frames))

    monkeypatch.setitem(CASES, 'pdu', case)
    assert 'memory has grown' in campaign.run(Part(SEED, 0, 20 * len(CASES)))[0].what
