# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive is looked for until it has started, by a thread that is gone then."""

from __future__ import annotations

import threading

import pytest

from nfo_sinus_driver.node import autostart
from nfo_sinus_driver.node.autostart import Autostart

#: Far longer than anything here takes, s.
PATIENCE = 20.0


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(autostart, '_REST', 0.001)


class Tries:
    """What an autostart is to try; succeeds the last time."""

    def __init__(self, failures: int, error: Exception | None = None) -> None:
        self.left = failures
        self._error = error
        self.autostart = Autostart('drive', self._attempt)
        self.by_itself: list[bool] = []

    def _attempt(self) -> bool:
        self.by_itself.append(self.autostart.trying)
        if not self.left:
            return True
        self.left -= 1
        if self._error is not None:
            raise self._error
        return False


@pytest.mark.parametrize('error', [None, ValueError('oops')], ids=['fails', 'raises'])
def test_it_tries_until_it_works_and_then_no_more(error: Exception | None) -> None:
    tries = Tries(3, error)
    before = threading.active_count()
    tries.autostart.start()
    tries.autostart.join(PATIENCE)
    assert threading.active_count() == before
    assert tries.left == 0
    assert tries.autostart.over
    # another client is the operator
    assert tries.by_itself == [True] * 4
    assert not tries.autostart.trying


def test_it_gives_up_at_once_though_it_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(autostart, '_REST', 3600.0)
    monkeypatch.setattr(autostart, '_LONGEST_REST', 3600.0)
    tried = threading.Event()

    def fails() -> bool:
        tried.set()
        return False

    one = Autostart('drive', fails)
    before = threading.active_count()
    one.start()
    assert tried.wait(PATIENCE)
    one.give_up()
    one.join(PATIENCE)
    assert threading.active_count() == before


def test_one_that_was_never_started_can_be_joined() -> None:
    one = Autostart('drive', lambda: True)
    one.give_up()
    one.join(PATIENCE)
    assert one.over
