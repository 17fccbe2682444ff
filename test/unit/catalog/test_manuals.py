# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of each family against the manuals' own text, where that lies beside the clone."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from support.manual_g2 import codes_of_g2, old_manual_of_g2, tables_of_g2
from support.manual_movitrac import (
    conversion_list_of_movitrac,
    faults_of_movitrac,
    list_of_movitrac,
)
from support.manual_optimal import bits_of_optimal, codes_of_optimal, registers_of_optimal
from support.manual_text import Fact

READERS = (
    *(tables_of_g2, old_manual_of_g2, codes_of_g2),
    *(registers_of_optimal, codes_of_optimal, bits_of_optimal),
    *(list_of_movitrac, conversion_list_of_movitrac, faults_of_movitrac),
)


@pytest.mark.parametrize('read', READERS, ids=lambda read: read.__name__)
def test_the_tables_say_what_the_manual_prints(read: Callable[[], Iterator[Fact]]) -> None:
    facts = list(read())
    assert len(facts) > 10
    assert [(where, printed, ours) for where, printed, ours in facts if printed != ours] == []
