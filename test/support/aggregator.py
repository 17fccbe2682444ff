# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What diagnostic_aggregator 4.0.0 makes of a file and of statuses, by the rules of its sources."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
import re
from typing import Any

import yaml

OK, WARN, ERROR, STALE = range(4)

_GROUP = 'diagnostic_aggregator/AnalyzerGroup'
_GENERIC = 'diagnostic_aggregator/GenericAnalyzer'


class Aggregator:
    """The analyzers of a file."""

    def __init__(self, file: Path) -> None:
        document = yaml.safe_load(file.read_text())
        # the name of the node that reads it
        assert list(document) == ['analyzers']
        self._top = document['analyzers']['ros__parameters']

    def refused(self) -> set[str]:
        """Return the analyzers and groups that do not load."""
        return set(_refused(self._top))

    def groups(self, status: str) -> set[str]:
        """Return the groups in which a status is shown."""
        return {path for path, leaf in _leaves(self._top) if _matches(leaf, status)}

    def expected(self) -> set[str]:
        """Return the statuses of which the absence is an error."""
        return {name for _, leaf in _leaves(self._top) for name in leaf.get('expected', ())}

    def level(self, statuses: Mapping[str, int]) -> int:
        """Return the level of ``/diagnostics_toplevel_state`` for the levels of all statuses."""
        others = [level for name, level in statuses.items() if not self.groups(name)]
        shown = [*_levels(self._top, statuses), *others]
        # an analyzer that failed is shown as STALE
        shown += [STALE for _ in self.refused()]
        if max(shown) == STALE and min(shown) < STALE:
            return ERROR
        return max(shown)


def _children(group: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for name, analyzer in group.get('analyzers', group).items():
        if isinstance(analyzer, dict):
            assert analyzer['type'] in (_GROUP, _GENERIC) and analyzer['path'], name
            # it is read as a double, and another number ends the node
            assert isinstance(analyzer.get('timeout', 5.0), float), name
            yield name, analyzer


def _loads(analyzer: dict[str, Any]) -> bool:
    """Return whether an analyzer loads: ``expected`` alone is no way to find a status (#656)."""
    if analyzer['type'] == _GROUP:
        return all(_loads(child) for _, child in _children(analyzer))
    return any(analyzer.get(way) for way in ('regex', 'startswith', 'contains'))


def _refused(group: dict[str, Any]) -> Iterator[str]:
    for name, analyzer in _children(group):
        if not _loads(analyzer):
            yield name
            if analyzer['type'] == _GROUP:
                yield from _refused(analyzer)


def _leaves(group: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for _, analyzer in _children(group):
        if not _loads(analyzer):
            continue
        if analyzer['type'] == _GROUP:
            yield from ((f'{analyzer["path"]}/{path}', leaf) for path, leaf in _leaves(analyzer))
        else:
            yield analyzer['path'], analyzer


def _matches(analyzer: dict[str, Any], status: str) -> bool:
    return (
        any(re.fullmatch(pattern, status) for pattern in analyzer.get('regex', ()))
        or any(status.startswith(text) for text in analyzer.get('startswith', ()))
        or any(text in status for text in analyzer.get('contains', ()))
    )


def _levels(group: dict[str, Any], statuses: Mapping[str, int]) -> Iterator[int]:
    """Yield the level of each analyzer; STALE beside another level is an error."""
    for _, analyzer in _leaves(group):
        # what is expected is there from the beginning, and STALE
        items = dict.fromkeys(analyzer.get('expected', ()), STALE)
        items |= {name: level for name, level in statuses.items() if _matches(analyzer, name)}
        worst = max(items.values(), default=STALE)
        yield ERROR if worst == STALE and set(items.values()) - {STALE} else worst
