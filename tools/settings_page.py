# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of settings in docs/interface.md, made from the settings; ``make pages``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
import re

from nfo_sinus_driver.node.parameters.settings import BUS_SETTINGS, DRIVE_SETTINGS
from nfo_sinus_driver.setting import FIXED, Setting

PAGE = Path(__file__).resolve().parents[1] / 'docs' / 'interface.md'
#: Names, topics and values in a text, which the page shows as code.
_NAMES = '|'.join(name for name in (*BUS_SETTINGS, *DRIVE_SETTINGS) if '_' in name)
_CODE = re.compile(
    rf"(?<![`\w./])(~/\w+|serial\.\*|''|{_NAMES}|joint_states|joint_command|telegram1)(?!\w)"
)


def page() -> str:
    """Return the page with its tables of settings made anew."""
    text = PAGE.read_text(encoding='utf-8')
    for title, settings in ('meaning |', BUS_SETTINGS), ('meaning | change |', DRIVE_SETTINGS):
        begin = f'| parameter | default | range | {title}\n'
        before, found, after = text.partition(begin)
        assert found, f'{PAGE} has no table that begins with {begin}'
        rest = re.sub(r'\A(\|.*\n)+', '', after)
        text = before + begin + ''.join(_rows(settings)) + rest
    return text


def _rows(settings: Mapping[str, Setting]) -> list[str]:
    fixed = all(setting.change == FIXED for setting in settings.values())
    rows = ['|---|---|---|---|\n' if fixed else '|---|---|---|---|---|\n']
    for name, setting in settings.items():
        cells = [f'`{name}`', _default(setting.default), _range(setting)]
        cells += [_code(setting.description)]
        cells += [] if fixed else [setting.change]
        rows.append('|' + '|'.join(f' {cell} ' if cell else ' ' for cell in cells) + '|\n')
    return rows


def _default(default: object) -> str:
    if isinstance(default, bool):
        return str(default).lower()
    if isinstance(default, list):
        return f'`[{", ".join(default)}]`'
    return f"`{default or repr('')}`" if isinstance(default, str) else str(default)


def _range(setting: Setting) -> str:
    has_span = setting.low is not None
    span = f'{setting.low:g} to {setting.high:g} {setting.unit}'.strip() if has_span else ''
    choices = ', '.join(f'`{choice}`' for choice in setting.choices)
    return '; '.join(filter(None, (span, choices, _code(setting.also))))


def _code(text: str) -> str:
    return _CODE.sub(r'`\1`', text)
