# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Reading the tables of a family; whatever is wrong in one is named by its file and line."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import csv
from fractions import Fraction
import functools
from pathlib import Path
import sys
from typing import TypeVar

_T = TypeVar('_T')
Row = dict[str, str]


class CatalogError(Exception):
    """A table contradicts itself; the message names the file and the line."""


def read(
    path: Path,
    parse: Callable[[Row], _T],
    unique: Callable[[_T], Iterable[str]],
    only: str = '',
) -> list[_T]:
    """
    Read a table.

    :param parse: makes something of a row; ``KeyError`` and ``ValueError`` say what is wrong.
    :param unique: names what no two rows may share.
    :param only: the key of the one parameter whose rows are wanted; ``''``: all rows are.
    :raises CatalogError: there is no such file, or a row is wrong, or says what another one has.
    """
    found: list[_T] = []
    lines: dict[str, int] = {}
    try:
        text = path.read_text(encoding='utf-8')
    except (OSError, UnicodeError) as error:
        raise CatalogError(f'{_name(path)}: {error}') from error
    rows = csv.DictReader(text.splitlines(), strict=True)
    try:
        for row in rows:
            if None in row or None in row.values():
                raise ValueError('too many or too few columns')
            if only and row['parameter'] != only:
                continue
            # what stands in many rows is kept once
            made = parse({name: sys.intern(cell) for name, cell in row.items()})
            for name in unique(made):
                if name in lines:
                    raise ValueError(f'{name} stands in line {lines[name]} already')
                lines[name] = rows.reader.line_num
            found.append(made)
    except (KeyError, ValueError, ZeroDivisionError, csv.Error) as error:
        said = f'no {error}' if isinstance(error, KeyError) else error
        # the dictionary reader's own count lags behind in a row that has no end
        raise CatalogError(f'{_name(path)}, line {rows.reader.line_num}: {said}') from error
    return found


@functools.lru_cache
def ratio(text: str) -> Fraction:
    """Return a number of a table; the same one for the same text."""
    return Fraction(text)


def fraction(text: str) -> Fraction | None:
    """Return a number of a table; ``None`` for an empty cell."""
    return ratio(text) if text else None


def number(text: str) -> int | None:
    """Return a whole number, decimal or ``0x`` hexadecimal; ``None`` for an empty cell."""
    return int(text, 0) if text else None


def _name(path: Path) -> str:
    return f'{path.parent.name}/{path.name}'
