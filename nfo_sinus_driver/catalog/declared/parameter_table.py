# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Reads the parameters of a description from a CSV beside it, with the columns of shipped families.

Those are ``parameter``, ``name``, ``scale``, ``unit``, ``minimum``, ``maximum``, ``labels``,
``access``, ``when``, ``description`` and ``source``; what else a parameter has in a description is
a column of that name, such as ``register``. Each row becomes what would stand in the YAML file.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
import csv
from dataclasses import replace
import difflib
import io
from pathlib import Path

from nfo_sinus_driver.catalog.declared import schema
from nfo_sinus_driver.catalog.declared.yaml_file import Node, Problems, scalar_of

_KEY = 'parameter'
#: What other keys are called in the tables of shipped families.
_COLUMNS = {'scaled_by': 'scale', 'choices': 'labels', 'while_running': 'when'}
_WHEN = {'init': False, 'run': True}
_FORM = 'write 0=Keypad|1=Bus'


def with_parameters(root: Node, problems: Problems) -> Node:
    """Return a description with the rows of a CSV in place of the name of that file."""
    node = root.get('parameters')
    if not isinstance(node.scalar, str):
        return root
    path = problems.path.parent / node.scalar
    text = _text_of(path, node, problems)
    with problems.of(path):
        rows = Node(dict(_Table(text, problems).rows()), 1, 'parameters', path)
        schema.check_parameters(rows, problems)
    return replace(root, content={**root.mapping, 'parameters': rows})


def _text_of(path: Path, node: Node, problems: Problems) -> str:
    try:
        # a spreadsheet begins it with a mark
        return path.read_text(encoding='utf-8-sig')
    except OSError as error:
        why = f'{path}: {error.strerror or error}: write it there, or the parameters here'
    except UnicodeError:
        why = f'{path} is no text in UTF-8: save it as such'
    except ValueError:
        why = f'{node.scalar!r} is no name of a file'
    problems.add(node.line, why)
    return _KEY


class _Table:
    """The rows of one text."""

    def __init__(self, text: str, problems: Problems) -> None:
        self._reader = csv.reader(io.StringIO(text, newline=''), strict=True)
        self._problems = problems
        known = schema.schema()['$defs']['parameter']['properties']
        self._keys = {_COLUMNS.get(key, key): key for key in known}

    def rows(self) -> Iterator[tuple[str, Node]]:
        """Yield the parameters, by key; what is wrong goes to the problems."""
        try:
            header = [column.strip() for column in next(self._reader, [])]
            if self._is_header(header):
                yield from self._below(header)
        except csv.Error as error:
            self._problems.add(self._reader.line_num, f'is no CSV: {error}')

    def _is_header(self, header: Sequence[str]) -> bool:
        before = len(self._problems.found)
        known = (_KEY, *self._keys)
        for column in header:
            if column not in known:
                self._problems.add(1, _unknown(column, known))
            elif header.count(column) > 1:
                self._problems.add(1, f'the column {column!r} stands twice: remove one of both')
        if _KEY not in header:
            self._problems.add(1, f'needs the column {_KEY!r}: group.name, such as ramp.accel')
        return len(self._problems.found) == before

    def _below(self, header: Sequence[str]) -> Iterator[tuple[str, Node]]:
        lines: dict[str, int] = {}
        for row in filter(None, self._reader):
            line = self._reader.line_num
            if len(row) != len(header):
                self._problems.add(line, f'has {len(row)} cells for {len(header)} columns')
                continue
            cells = {name: cell.strip() for name, cell in zip(header, row, strict=True)}
            key = cells.pop(_KEY)
            if lines.setdefault(key, line) != line:
                self._problems.add(
                    line, f'{key!r} stands in line {lines[key]} already: remove one of both'
                )
            yield key, Node(dict(self._cells(cells, line)), line, key)

    def _cells(self, cells: Mapping[str, str], line: int) -> Iterator[tuple[str, Node]]:
        for column, text in cells.items():
            if text:
                key = self._keys[column]
                yield key, self._cell(key, text, line)

    def _cell(self, key: str, text: str, line: int) -> Node:
        if key == 'choices':
            return Node(dict(self._labels(text, line)), line, key)
        if key == 'bits':
            ends = [scalar_of(end, line, self._problems) for end in text.split('-')]
            return Node([Node(end, line) for end in ends], line, key)
        if key == 'while_running':
            if text not in _WHEN:
                self._problems.add(line, f'when is {text!r}: choose one of {", ".join(_WHEN)}')
            return Node(_WHEN.get(text), line, key)
        is_text = schema.schema()['$defs']['parameter']['properties'][key].get('type') == 'string'
        scalar = text if is_text else scalar_of(text, line, self._problems)
        return Node(scalar, line, key, written=text)

    def _labels(self, text: str, line: int) -> Iterator[tuple[str, Node]]:
        pairs = [pair.partition('=') for pair in text.split('|')]
        codes = [code for code, _, _ in pairs]
        for code, equals, label in pairs:
            if not equals:
                self._problems.add(line, f'labels: {code!r} is no number and its text: {_FORM}')
            elif codes.count(code) > 1:
                self._problems.add(line, f'labels: {code} stands twice: {_FORM}')
            else:
                yield code, Node(label, line, code)


def _unknown(column: str, known: Sequence[str]) -> str:
    if ';' in column:
        return f'{column!r} is no column: separate them by commas'
    near = difflib.get_close_matches(column, known, 1)
    hint = f'{near[0]!r} may be meant' if near else f'there are {", ".join(known)}'
    return f'{column!r} is no column: {hint}'
