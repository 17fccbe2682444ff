# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A bus with a link made of plain Python."""

from __future__ import annotations

from collections.abc import Iterator

from fake_link import FakeLink
import pytest

from nfo_sinus_driver.bus import Bus, worker as bus_module


@pytest.fixture
def link() -> FakeLink:
    return FakeLink()


@pytest.fixture
def bus(link: FakeLink, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bus]:
    monkeypatch.setattr(bus_module, 'REOPEN_PERIOD', 0.01)
    bus = Bus(link, now=link.now)
    bus.start()
    yield bus
    bus.close()
