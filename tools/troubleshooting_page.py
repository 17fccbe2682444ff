# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""docs/troubleshooting.md: every message, with cause and remedy; ``make pages``."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
import inspect
from pathlib import Path
import re
import string
import textwrap
from types import SimpleNamespace

from nfo_sinus_driver.drive import Cause, Report
from nfo_sinus_driver.node.messages.wording import Wording

_ROOT = Path(__file__).resolve().parents[1]
_PACKAGE = _ROOT / 'nfo_sinus_driver'
#: All but the rows of causes, which take the place of a line ``{causes}`` in their section, and the
#: ends of long messages: one that begins so has ``[…]`` there.
BY_HAND = _ROOT / 'docs' / 'troubleshooting.md.in'
_MADE = (
    '<!-- Made from docs/troubleshooting.md.in, and the causes in '
    'nfo_sinus_driver/drive/known/events.py, by `make pages`: change those. -->\n\n'
)
_WORDING = Wording(SimpleNamespace(
    get_fully_qualified_name=lambda: '/nfo_sinus',
    resolve_service_name=lambda name: name.replace('~', '/nfo_sinus'),
))


class _Value:
    """Any value of a sentence, and any part of one."""

    def __getattr__(self, name: str) -> _Value:
        return self

    def __format__(self, form: str) -> str:
        return '…'


def page() -> str:
    """Return the whole page in Markdown."""
    rows: dict[str, list[str]] = {}
    for section, causes, remedy in remedies():
        if remedy:
            shown = '<br>'.join(f'`{_shown(cause)}`' for cause in causes)
            rows.setdefault(section, []).append(f'| {shown} | {remedy} |')
    lines: list[str] = []
    section = ''
    for line in by_hand().splitlines():
        section = line.lstrip('# ') if line.startswith('#') else section
        lines += rows.pop(section) if line == '{causes}' else [line]
    assert not rows, f'{BY_HAND} has no {{causes}} in {list(rows)}'
    return _MADE + '\n'.join([*lines, ''])


def by_hand() -> str:
    """Return what is written by hand, with each message whole."""
    text = BY_HAND.read_text(encoding='utf-8')
    return re.sub(r'`([^`]+)\[…\]', lambda found: f'`{_whole(found[1])}', text)


def _whole(beginning: str) -> str:
    """Return the one text of the driver that begins so."""
    found = [shown for shown in _shown_texts() if shown.startswith(beginning)]
    assert len(found) == 1, f'{BY_HAND}: {beginning} begins {len(found)} messages, not one'
    return found[0]


@cache
def _shown_texts() -> set[str]:
    """Return every text of the driver, with ``…`` for each value."""
    modules = [node for _, node in nodes() if isinstance(node, ast.Module)]
    return {'…'.join(parts) for module in modules for parts in texts(module)}


@cache
def nodes() -> list[tuple[str, ast.AST]]:
    """Return what has the texts that an operator may read; simulator and cli have own pages."""
    paths = {path.relative_to(_PACKAGE).as_posix(): path for path in _PACKAGE.rglob('*.py')}
    return [
        (name, node)
        for name, path in paths.items() if not name.startswith(('simulator/', 'cli/'))
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8')))
    ]


def texts(node: ast.AST) -> Iterator[tuple[str, ...]]:
    """Yield the fixed parts of texts and f-strings; what logging puts in is a value, too."""
    if isinstance(node, ast.JoinedStr):
        values = [part.value if isinstance(part, ast.Constant) else '%s' for part in node.values]
        yield tuple(re.split('%[sdr]', ''.join(map(str, values))))
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield tuple(re.split('%[sdr]', node.value))
    else:
        for child in ast.iter_child_nodes(node):
            yield from texts(child)


def remedies() -> Iterator[tuple[str, list[Cause], str]]:
    """Yield the causes that have one remedy, and the title of their group; ``''`` for none."""
    _, *parts = re.split(r'^    # --- (.+)$', inspect.getsource(Cause), flags=re.MULTILINE)
    for title, members in zip(parts[::2], parts[1::2], strict=True):
        causes: list[Cause] = []
        for node in ast.parse(textwrap.dedent(members)).body:
            if isinstance(node, ast.Assign):
                causes.append(Cause[node.targets[0].id])
            else:
                yield title, causes, ' '.join(node.value.value.split())
                causes = []
        if causes:
            yield title, causes, ''


def _shown(cause: Cause) -> str:
    """Return the sentence of a cause, with ``…`` for each value."""
    fields = [field for _, field, _, _ in string.Formatter().parse(cause.value) if field]
    values = {re.split(r'[.\[]', field)[0]: _Value() for field in fields}
    values.pop('call', None)
    return re.sub('…+', '…', _WORDING.say(Report(cause, **values)))
