# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Of products of laws and connections those tests that run before every commit."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.chosen import axes_of, chosen
from support.examples import FULL
from support.unexpected_errors import unexpected_errors

#: These take long: each connects, enables and stops a whole drive.
_CUT = 'test/unit/drive/'


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what ``FULL=1`` runs, but nothing that is named as it is called."""
    if FULL or any('[' in argument for argument in config.args):
        return
    names = {item.nodeid for item in items if not item.nodeid.startswith(_CUT)}
    names |= chosen((item.nodeid, axes_of(item)) for item in items if item.nodeid not in names)
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid not in names])
    items[:] = [item for item in items if item.nodeid in names]


@pytest.fixture(autouse=True)
def _nothing_unexpected(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail where the driver logs an error that it did not expect, unless a test provokes it."""
    with unexpected_errors() as found:
        yield
    assert request.node.get_closest_marker('provokes') or not found, found[0]
