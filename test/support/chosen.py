# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Which tests of a product run before every commit; ``FULL=1`` runs all of them.

A product of a law, connections and events finds two kinds of fault: the law is broken, which any
connection shows, and a connection is special, which any law of its kind shows. So each value of
each parameter has a test, but not each with each; the laws of ``test_laws.py`` have a connection of
each kind, and those of other files have every second kind in turn. What
breaks one cell alone is for ``make all``. The mutants say whether that is enough: ``make mutants``
tries them with what runs here, and a cell that one needs is named in ``NEEDED``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from zlib import crc32

import pytest

#: A connection of each kind.
KINDS = (
    'rtu', 'tcp', 'classic', 'canopen', 'canopen, ds402', 'movitrac', 'telegram1 g2', 'described',
)
#: Of the others a law has one in so many, if nothing else is said.
_ONE_IN = 6
#: Its laws have all of them, and one in so many of the others; those of other files have one kind
#: in so many.
_EACH_KIND = 'test_laws.py'
_ONE_IN_OF_LAWS = 4
_ONE_KIND_IN = 2
#: The cells that no other replaces, by file and name, with the mutant that lives without them.
NEEDED = {
    'test_why_stopped.py::test_after_each_stop_it_is_known_why[rtu-power cycle]':
        'a drive that was away and is not in control any more has stopped for no known reason',
    'test_stopped_is_true.py::test_no_stop_is_a_success_while_the_measured_speed_stays'
    '[rtu-exit]':
        'an exit does not look for a run command at standstill',
    'test_driver_stands_still.py::'
    'test_a_stop_is_on_the_wire_at_once_while_a_drive_is_known_as_slow[rtu]':
        'a stop waits for a link that only listens',
    'test_driver_stands_still.py::test_all_is_read_as_often_after_that[rtu]':
        'a pause of the driver is the time that an answer takes',
    'test_lines.py::test_whatever_happens_to_a_line[movitrac 4-all answers lost]':
        'what is read before a stop keeps it back from a drive that hears and is not heard',
    'test_lines.py::test_a_stop_that_is_called_for_again_and_again_keeps_no_other_back'
    '[rtu-quick_stop]':
        'each call of a quick stop makes one, and all of them fill the line',
    'test_two_answers.py::'
    'test_on_a_line_of_eight_no_stop_waits_for_a_second_answer[optimal, control word-0.03]':
        'where answers come twice a stop is read before',
    'test_stopped_is_true.py::test_the_end_waits_for_the_ramp[canopen, ds402 alone]':
        'a motor on its ramp is let go of where its drive is shown as ready',
}

#: A test: its name with that of its cell, and where it stands on each axis of the product.
Test = tuple[str, Mapping[str, object]]


def chosen(tests: Iterable[Test], one_in: int = _ONE_IN) -> set[str]:
    """Return the names of those that run; of what is no kind each law has one in so many."""
    products: dict[str, list[Test]] = defaultdict(list)
    for name, params in tests:
        products[name.partition('[')[0]].append((name, params))
    return {name for law, cells in products.items() for name in _of_one(law, cells, one_in)}


def axes_of(item: pytest.Item) -> dict[str, object]:
    """Return where a test stands on each axis of its product: rows written by hand are one axis."""
    params = dict(item.callspec.params) if isinstance(item, pytest.Function) and hasattr(
        item, 'callspec') else {}
    axes: dict[str, object] = {}
    for mark in item.iter_markers('parametrize'):
        names = mark.args[0] if isinstance(mark.args[0], str) else ','.join(mark.args[0])
        if 'connection' not in names.split(','):
            axes[names] = [params.pop(name.strip(), None) for name in names.split(',')]
    return axes | params


def _without_folder(name: str) -> str:
    """Return the name of a test without the folder of its file: what is chosen stays as it is."""
    file, colons, test = name.partition('::')
    return file.rpartition('/')[2] + colons + test


def _of_one(law: str, cells: list[Test], one_in: int) -> set[str]:
    connections = {str(params.get('connection')) for _, params in cells}
    # which of them differs from law to law
    turn = crc32(_without_folder(law).encode())
    kinds = [kind for kind in KINDS if kind in connections]
    if _without_folder(law).startswith(_EACH_KIND):
        one_in = _ONE_IN_OF_LAWS
    else:
        kinds = kinds[turn % _ONE_KIND_IN::_ONE_KIND_IN]
    others = sorted(connections - set(KINDS))[turn % one_in::one_in]
    left_out = connections - {*kinds, *others}
    wanted = [cell for cell in cells if str(cell[1].get('connection')) not in left_out]
    found: set[str] = set()
    met: set[tuple[str, str]] = set()
    # in an order of its own for each law, so that other values go together there
    in_turn = sorted(wanted or cells, key=lambda cell: crc32(_without_folder(cell[0]).encode()))
    for name, params in in_turn:
        values = {(key, repr(value)) for key, value in params.items()}
        if not values or not values <= met:
            found.add(name)
            met |= values
    return found | {name for name, _ in cells if _without_folder(name) in NEEDED}
