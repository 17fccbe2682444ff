# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The made-up family, where a test connects to it: its two folders are all there is of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from nfo_sinus_driver import families, simulator


@pytest.fixture(autouse=True)
def _made_up_family(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    callspec = getattr(request.node, 'callspec', None)
    if callspec is None or callspec.params.get('connection') != 'made up':
        return
    here = Path(__file__).parent
    for package, room in ((families, here), (simulator, here.parent / 'simulator')):
        monkeypatch.setattr(package, '__path__', [*package.__path__, str(room / 'made_up')])
