# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters in a CSV beside the file of a drive: what they mean, and what is wrong in one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import re
import textwrap

from hypothesis import given, settings, strategies as st
import pytest

from nfo_sinus_driver import families
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.catalog.declared import Description, DescriptionError, read

HEAD = """
vfd: 1
title: Made up
source: made up
control:
  requires: [{parameter: source.command, value: Bus}]
  run: [{register: 10, value: 1}]
  stop: [{register: 10, value: 0}]
setpoint: {register: 11, type: int16, factor: 0.1, unit: Hz, most: 60, signed: true}
status: {register: 20, running: {bit: 0}, fault: {bit: 3}}
timeout: {parameter: serial.timeout}
simulated: {accel: ramp.accel}
"""
INLINE = """
parameters:
  ramp.accel: {register: 30, name: P30, factor: 0.1, unit: s, minimum: 0.1, maximum: 60, default: 5}
  source.command: {register: 0x1F, choices: {0: Keypad, 1: Bus}, while_running: false, default: Bus}
  serial.timeout: {register: 32, factor: 1/10, unit: s, source: 'chapter 7, table 1'}
  motor.poles: {register: 33, bits: [4, 7], access: r, role: pole_pairs}
  motor.speed: {register: 34, scaled_by: motor.poles, description: '"n"'}
  motor.fan: {coil: 3, choices: {0: 'Off', 1: 'On'}}
"""
TABLE = """\
parameter,register,coil,bits,name,factor,scale,unit,minimum,maximum,default,labels,access,when,role,source,description
ramp.accel,30,,,P30,0.1,,s,0.1,60,5,,,,,,
source.command,0x1F,,,,,,,,,Bus,0=Keypad|1=Bus,,init,,,
serial.timeout,32,,,,1/10,,s,,,,,,,,"chapter 7, table 1",

motor.poles,33,,4-7,,,,,,,,,r,run,pole_pairs,,
motor.speed,34,,,,,motor.poles,,,,,,,,,,\"""n\"""
motor.fan, ,3,,,,,,,,,0=Off|1=On,,,,,
"""


def _read(folder: Path, table: str | bytes, name: str = 'mine.csv') -> Description:
    content = table if isinstance(table, bytes) else table.encode()
    (folder / 'mine.csv').write_bytes(content)
    file = folder / 'mine.vfd.yaml'
    file.write_text(f'{HEAD}parameters: {name}\n', encoding='utf-8')
    return read(file)


def _complaints(folder: Path, table: str | bytes, name: str = 'mine.csv') -> list[str]:
    with pytest.raises(DescriptionError) as error:
        _read(folder, table, name)
    return list(error.value.problems)


def test_a_table_says_what_could_stand_in_the_file(tmp_path: Path) -> None:
    inline = tmp_path / 'inline.vfd.yaml'
    inline.write_text(HEAD + INLINE, encoding='utf-8')
    # as a person writes it, and as spreadsheets save it
    for table in (TABLE, b'\xef\xbb\xbf' + TABLE.replace('\n', '\r\n').encode()):
        said = replace(_read(tmp_path, table), name='inline', path=str(inline))
        assert said == read(inline)


def test_it_is_found_beside_the_file_wherever_the_driver_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir('/')
    (tmp_path / 'tables').mkdir()
    (tmp_path / 'tables' / 'theirs.csv').write_text(TABLE, encoding='utf-8')
    _read(tmp_path, '', 'tables/theirs.csv')
    family = load_family(str(tmp_path / 'mine.vfd.yaml'))
    assert family['ramp.accel'].name == 'P30'


def test_the_table_of_the_page_is_right(tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / 'docs' / 'your_own_drive.md').read_text(encoding='utf-8')
    table = re.search(r'(?m)(^    parameter,register,.*\n(?:    .*\n)+)', page)
    assert table is not None
    (tmp_path / 'mine.csv').write_text(textwrap.dedent(table[1]), encoding='utf-8')
    file = tmp_path / 'mine.vfd.yaml'
    file.write_text(
        HEAD.replace('Bus', 'RS-485').replace('timeout: {parameter: serial.timeout}\n', '')
        + 'parameters: mine.csv\n',
        encoding='utf-8',
    )
    assert read(file).parameters['source.command'].stopped


def test_it_has_the_columns_of_the_shipped_families(tmp_path: Path) -> None:
    root = Path(next(iter(families.__path__)))
    shipped = [path.read_text(encoding='utf-8') for path in root.glob('*/parameters.csv')]
    for column in TABLE.partition('\n')[0].split(','):
        if column not in ('register', 'coil', 'bits', 'factor', 'default', 'role'):
            assert all(column in text.partition('\n')[0].split(',') for text in shipped), column


#: What is replaced by what, in which line that is wrong, and what is said of it.
BAD = {
    'no such column': ('parameter,register', 'parameter,regsiter', 1, "'register' may be meant"),
    'semicolons': ('parameter,register,', 'parameter;register,', 1, 'separate them by commas'),
    'a column twice': ('coil,bits', 'bits,bits', 1, 'stands twice'),
    'no name of the parameter': ('parameter,register', 'name,register', 1, "column 'parameter'"),
    'nothing': (TABLE, '', 1, "needs the column 'parameter'"),
    'a cell too many': ('0.1,60,5', '0.1,60,5,', 2, 'has 18 cells for 17 columns'),
    'a cell too few': ('source.command,0x1F,', 'source.command,0x1F', 3, '16 cells'),
    'a quote without end': ('motor.fan', '"motor.fan', 8, 'is no CSV'),
    'a quote within': ('"chapter 7, table 1"', '"chapter" 7', 4, 'is no CSV'),
    'the same parameter twice': ('motor.speed,34', 'ramp.accel,34', 7, 'stands in line 2'),
    'a name that is none': ('motor.fan', 'Fan', 8, 'group.name in small letters'),
    'no name': ('motor.fan', '', 8, 'group.name in small letters'),
    'a text for a number': ('ramp.accel,30', 'ramp.accel,thirty', 2, 'a whole number'),
    'zeros in front': ('ramp.accel,30', 'ramp.accel,0030', 2, 'begins with 0'),
    'a number of 5000 digits': ('ramp.accel,30', f'ramp.accel,{"9" * 5000}', 2, 'whole number'),
    'register out of range': ('ramp.accel,30', 'ramp.accel,70000', 2, 'cannot be sent'),
    'nowhere': ('ramp.accel,30', 'ramp.accel,', 2, 'add register or coil'),
    'factor 0': ('P30,0.1', 'P30,0', 2, 'more than 0'),
    'a range that is none': ('0.1,60', '60,0.1', 2, 'not below'),
    'a default out of range': ('0.1,60,5', '0.1,60,500', 2, 'out of range'),
    'access that is none': (',,r,run', ',,ro,run', 6, 'choose one of rw, r, w'),
    'when it is': (',,init', ',,always', 3, 'choose one of init, run'),
    'a label without a number': ('0=Keypad|1=Bus', 'Keypad|1=Bus', 3, 'write 0=Keypad|1=Bus'),
    'a label of no number': ('0=Keypad|1=Bus', 'a=Keypad|1=Bus', 3, 'cannot be a key'),
    'a number twice': ('0=Keypad|1=Bus', '0=Keypad|0=Bus', 3, '0 stands twice'),
    'a label twice': ('0=Keypad|1=Bus', '0=Bus|1=Bus', 3, 'stands twice'),
    'a scale that is none': ('34,,,,,motor.poles', '34,,,,,motor.pole', 7, 'none of the param'),
    'bits that are none': ('33,,4-7', '33,,4', 6, 'needs 2'),
    'a role that is none': ('pole_pairs', 'poles', 6, 'choose one of nominal_power'),
    'two in one register': ('motor.speed,34', 'motor.speed,30', 7, 'in the same register'),
    'a group that is taken': ('motor.fan', 'line.fan', 8, 'are taken'),
}


@pytest.mark.parametrize('name', BAD)
def test_a_bad_table_is_refused_with_its_line_and_a_sentence(tmp_path: Path, name: str) -> None:
    old, new, line, said = BAD[name]
    assert old in TABLE
    found = _complaints(tmp_path, TABLE.replace(old, new, 1))
    place = f'{tmp_path / "mine.csv"}, line {line}: '
    assert any(complaint.startswith(place) and said in complaint for complaint in found), found


def test_all_that_is_wrong_in_the_cells_is_reported_at_once(tmp_path: Path) -> None:
    table = TABLE.replace('ramp.accel,30', 'ramp.accel,x').replace('pole_pairs', 'poles')
    assert len(_complaints(tmp_path, table)) == 2


def test_what_uses_a_parameter_is_named_in_the_file_itself(tmp_path: Path) -> None:
    (text,) = _complaints(tmp_path, TABLE.replace('1=Bus', '1=Line').replace(',Bus,', ',Line,'))
    assert text.startswith(f'{tmp_path / "mine.vfd.yaml"}, line 6: ') and 'none of Keypad' in text


def test_a_table_that_is_none(tmp_path: Path) -> None:
    for name, said in (
        ('others.csv', 'No such file'), ('"a\\0b.csv"', 'no name of a file'),
        ('others.txt', 'NAME.csv'), ('7', 'a mapping'),
    ):
        (text,) = _complaints(tmp_path, TABLE, name)
        assert text.startswith(f'{tmp_path / "mine.vfd.yaml"}, line 13: ') and said in text, text
    (tmp_path / 'folder.csv').mkdir()
    assert 'directory' in _complaints(tmp_path, TABLE, 'folder.csv')[0]
    assert 'UTF-8' in _complaints(tmp_path, b'\xff\xfe\x00')[0]


# --- fuzz ---

_CELLS = st.one_of(
    st.sampled_from(['', '0', '1', '-1', '70000', '0x', '1/0', '1e9', 'nan', '.inf', 'true', '"']),
    st.sampled_from(['ramp.accel', 'int16', 'uint32', 'input', 'low_first', 'w', 'r', '0=A|1=']),
    st.sampled_from(['4-7', '7-4', '4-', '4-99', '||', '=', 'init', 'firmware']),
    st.text(max_size=6),
)
_EXTRA = st.sampled_from(['type', 'order', 'table', 'none', 'x', 'when'])


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_whatever_is_in_a_table_nothing_but_a_sentence_comes(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    rows = [line.split(',') for line in TABLE.replace('7, table', '7').splitlines()]
    for _ in range(data.draw(st.integers(1, 4))):
        row = rows[data.draw(st.integers(0, len(rows) - 1))]
        row[data.draw(st.integers(0, len(row) - 1))] = data.draw(_CELLS)
    if data.draw(st.booleans()):
        rows = [[*row, data.draw(_CELLS if number else _EXTRA)] for number, row in enumerate(rows)]
    text = '\n'.join(map(','.join, rows))
    _is_read_or_refused(tmp_path_factory.mktemp('fuzz'), text.encode(errors='replace'))


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=60), st.booleans())
def test_whatever_bytes_a_table_is_nothing_but_a_sentence_comes(
    tmp_path_factory: pytest.TempPathFactory, text: bytes, begun: bool
) -> None:
    text = b'parameter,register\n' + text if begun else text
    _is_read_or_refused(tmp_path_factory.mktemp('bytes'), text)


def _is_read_or_refused(folder: Path, table: bytes) -> None:
    try:
        _read(folder, table)
    except DescriptionError as error:
        said = r'mine\.(csv|vfd\.yaml), line \d+: \S'
        assert all(re.search(said, problem) for problem in error.problems), error.problems
