# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""docs/manuals.md: what each manual offers and what serves it; ``make pages``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
import csv
from pathlib import Path
import re

DOCS = Path(__file__).resolve().parents[1] / 'docs'
TABLE = DOCS / 'manuals.csv'
COLUMNS = ['manual', 'place', 'what', 'status', 'served_by', 'why', 'shown_by']
STATUSES = ('served', 'in part', 'not')
#: Title and page of each manual.
MANUALS = {
    'M0': ('NFO Sinus G2, communication supplement V2.03', 'sinus_g2'),
    'M1': ('NFO Sinus Optimal, Modbus and Profinet quick guide', 'sinus_optimal'),
    'M2': ('NFO Sinus G2, serial interface manual V5.0', 'sinus_g2_older'),
    'M3': ('Santerno Sinus H, PROFINET module', 'sinus_h'),
    'M4': ('SEW MOVITRAC 31, communications interfaces', 'movitrac31'),
}

_INTRODUCTION = """\
<!-- Made from docs/manuals.csv by `make pages`: change that. -->

# The manuals

What each manual offers to the owner of a drive, where the driver serves it, or why it does not.
`docs/manuals.csv` names the test that shows each row. Of those that are served, {skipped} rows rest
on tests alone that are skipped where the text of the manuals is not beside the clone;
{documented} rows are sentences of these pages, and rest on no test.

"""
#: The tests that read the text of the manuals.
NEEDS_MANUALS = frozenset(
    {
        'unit/catalog/test_manuals.py::test_the_tables_say_what_the_manual_prints',
        'unit/drive/settings/test_ends_on_classic.py'
        '::test_the_ends_of_every_setting_go_there_and_back_and_nothing_beyond',
        'unit/drive/settings/test_every_setting.py'
        '::test_every_setting_is_written_to_where_the_manual_has_it_and_read_from_there',
        'unit/drive/families/test_movitrac_manual.py'
        '::test_both_ends_of_every_setting_are_written_and_read_as_the_manual_has_them',
        'unit/drive/families/test_movitrac_manual.py::test_no_row_of_the_list_is_left_out',
        'unit/drive/families/test_older_firmware.py'
        '::test_every_setting_that_its_manual_lists_is_written_and_read_back',
    }
)
_HEAD = '| place | what | status | where, or why not |\n|---|---|---|---|\n'

Row = Mapping[str, str]


def rows() -> list[Row]:
    """Return the rows of the table."""
    with TABLE.open(encoding='utf-8', newline='') as stream:
        return list(csv.DictReader(stream))


def page() -> str:
    """Return the whole page in Markdown."""
    table = rows()
    sections = ''.join(_section(name, table) for name in MANUALS)
    return _introduction(table) + _counts(table) + sections


def _introduction(table: Sequence[Row]) -> str:
    tests = [set(shown_by(row)) for row in table if row['status'] != 'not']
    skipped = sum(bool(named) and named <= NEEDS_MANUALS for named in tests)
    return _INTRODUCTION.format(skipped=skipped, documented=sum(not named for named in tests))


def _counts(table: Sequence[Row]) -> str:
    lines = [f'| manual | {" | ".join(STATUSES)} |', '|---|---|---|---|']
    for name, (title, _) in MANUALS.items():
        lines.append(f'| [{title}](#{_anchor(title)}) | {_numbers(_of(name, table))} |')
    return '\n'.join([*lines, f'| all | {_numbers(table)} |', ''])


def _numbers(table: Sequence[Row]) -> str:
    counted = Counter(row['status'] for row in table)
    return ' | '.join(str(counted[status]) for status in STATUSES)


def _section(name: str, table: Sequence[Row]) -> str:
    title, drive = MANUALS[name]
    shown = f'\n## {title}\n\n[How to connect and run it](drives/{drive}.md). Cited as {name}.\n\n'
    return shown + _HEAD + ''.join(_line(row) for row in _of(name, table))


def _of(name: str, table: Sequence[Row]) -> list[Row]:
    return [row for row in table if row['manual'] == name]


def _line(row: Row) -> str:
    answer = '; '.join(filter(None, (', '.join(_served(row)), row['why'])))
    return f'| {row["place"]} | {row["what"]} | {row["status"]} | {answer} |\n'


def _served(row: Row) -> Iterator[str]:
    for place in served_by(row):
        file, _, anchor = place.partition('#')
        yield f'[{_title(file, anchor)}]({place})' if file.endswith('.md') else f'`{place}`'


def served_by(row: Row) -> list[str]:
    """Return each thing by which a row is served: a name that is typed, or a place in the docs."""
    return [part.strip() for part in row['served_by'].split(';') if part.strip()]


def shown_by(row: Row) -> list[str]:
    """Return each test that shows a row: ``unit/link/test_frames.py::test_a_frame``."""
    return [part.strip() for part in row['shown_by'].split(';') if part.strip()]


def _title(file: str, anchor: str) -> str:
    """Return the title that an anchor of a page leads to."""
    titles = re.findall(r'^#+ (.+)$', (DOCS / file).read_text(encoding='utf-8'), re.MULTILINE)
    return next(title for title in titles if _anchor(title) == anchor)


def _anchor(title: str) -> str:
    return re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-')
