# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Which tests of a product run before every commit; ``FULL=1`` runs all of them.

A product of a law, connections and events finds two kinds of fault: the law is broken, which any
connection shows, and a connection is special, which any law of its kind shows. So each value of
each parameter has a test, but not each with each; and each law has a connection of each kind. What
breaks one cell alone is for ``make all``. The mutants say whether that is enough: ``make mutants``
tries them with what runs here, and a cell that one needs is named in ``NEEDED``.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from zlib import crc32

#: A connection of each kind; of the others a law has one in so many.
KINDS = (
    'rtu', 'tcp', 'classic', 'canopen', 'canopen, ds402', 'movitrac', 'telegram1 g2', 'described',
)
_ONE_IN = 4
_DRIVE = 'test/unit/drive'
#: The cells that no other replaces, with the mutant that lives without them.
NEEDED = {
    f'{_DRIVE}/test_why_stopped.py::test_after_each_stop_it_is_known_why[rtu-power cycle]':
        'a drive that was away and is not in control any more has stopped for no known reason',
    f'{_DRIVE}/test_stopped_is_true.py::test_no_stop_is_a_success_while_the_measured_speed_stays'
    '[rtu-exit]':
        'an exit does not look for a run command at standstill',
}

#: A test: its name with that of its cell, and where it stands on each axis of the product.
Test = tuple[str, Mapping[str, object]]


def chosen(tests: Iterable[Test]) -> set[str]:
    """Return the names of those that run."""
    products: dict[str, list[Test]] = defaultdict(list)
    for name, params in tests:
        products[name.partition('[')[0]].append((name, params))
    return {name for law, cells in products.items() for name in _of_one(law, cells)}


def _of_one(law: str, cells: list[Test]) -> set[str]:
    others = sorted({str(params.get('connection')) for _, params in cells} - set(KINDS))
    # which of them differs from law to law
    left_out = set(others) - set(others[crc32(law.encode()) % _ONE_IN::_ONE_IN])
    wanted = [cell for cell in cells if str(cell[1].get('connection')) not in left_out]
    found: set[str] = set()
    met: set[tuple[str, str]] = set()
    # in an order of its own for each law, so that other values go together there
    for name, params in sorted(wanted or cells, key=lambda cell: crc32(cell[0].encode())):
        values = {(key, repr(value)) for key, value in params.items()}
        if not values or not values <= met:
            found.add(name)
            met |= values
    return found | NEEDED.keys() & {name for name, _ in cells}
