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

"""A bus with a link made of plain Python."""

from __future__ import annotations

from collections.abc import Iterator

from fake_link import FakeLink
import pytest

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import worker as bus_module


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
