# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Of products of laws and connections those tests that run before every commit."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.chosen import chosen
from support.examples import FULL

#: These take long: each connects, enables and stops a whole drive.
_CUT = 'test/unit/drive/'


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what ``FULL=1`` runs, but nothing that is named as it is called."""
    if FULL or any('[' in argument for argument in config.args):
        return
    names = {item.nodeid for item in items if not item.nodeid.startswith(_CUT)}
    names |= chosen((item.nodeid, dict(_axes(item))) for item in items if item.nodeid not in names)
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid not in names])
    items[:] = [item for item in items if item.nodeid in names]


def _axes(item: pytest.Item) -> Iterator[tuple[str, object]]:
    """Yield each axis of a product, and where on it a test stands: rows by hand are one axis."""
    params = dict(item.callspec.params) if hasattr(item, 'callspec') else {}
    for mark in item.iter_markers('parametrize'):
        names = mark.args[0] if isinstance(mark.args[0], str) else ','.join(mark.args[0])
        if 'connection' not in names.split(','):
            yield names, [params.pop(name.strip(), None) for name in names.split(',')]
    yield from params.items()
