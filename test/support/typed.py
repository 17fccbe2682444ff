# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The commands that the documentation shows, as they are typed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[2]
PAGES = (ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted((ROOT / 'docs').rglob('*.md')))

#: What may stand before a command; those that need no ROS are run without it.
_BEFORE = re.compile(r'^(\$|tools/run|ros2 run nfo_sinus_driver(?= (nfo-sinus|simulator) )) ')


@dataclass(frozen=True)
class Typed:
    """
    A command.

    :ivar place: page and line.
    :ivar text: what is typed, in one line.
    """

    place: str
    text: str

    @property
    def page(self) -> str:
        """The page that it stands on."""
        return self.place.partition(':')[0]

    def __str__(self) -> str:
        return f'{self.place} {self.text}'


def typed(program: str) -> list[Typed]:
    """Return all commands of the pages that begin with a program, in their order."""
    every = [command for page in PAGES for command in _of(page)]
    return [command for command in every if command.text.split()[0] == program]


def _of(page: Path) -> Iterator[Typed]:
    name = str(page.relative_to(ROOT))
    whole, began = '', 0
    for number, line in enumerate(page.read_text(encoding='utf-8').splitlines(), 1):
        if not (line.startswith('    ') or whole):
            continue
        text = _BEFORE.sub('', line.strip())
        if not text:
            continue
        began = began if whole else number
        whole = f'{whole} {text}' if whole else text
        if whole.endswith('\\'):
            whole = whole.rstrip('\\').rstrip()
            continue
        yield Typed(f'{name}:{began}', whole)
        whole = ''
