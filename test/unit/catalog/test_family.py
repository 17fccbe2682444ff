# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Reading the tables: fast, cached, and never a table that contradicts itself or another one."""

from __future__ import annotations

from collections.abc import Callable
import csv
from pathlib import Path
import re
import shutil

import pytest
from support.places import MSG_DEFS

from nfo_sinus_driver.catalog import CatalogError, families, family, load_family

NAME = 'sinus_g2'
PARAMETERS = 'parameters.csv'
ADDRESSES = 'addresses.csv'
CODES = 'status_codes.csv'
ROLES = 'roles.csv'
ERROR_LOG = 'error_log.csv'
TABLES = (PARAMETERS, ADDRESSES, CODES, ROLES, ERROR_LOG)
load_afresh = family._read_family.__wrapped__

Row = dict[str, str]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the tables, to be spoiled."""
    shutil.copytree(Path(family.__file__).parents[1] / 'families' / NAME, tmp_path / NAME)
    monkeypatch.setattr('nfo_sinus_driver.families.__path__', [str(tmp_path)])
    return tmp_path / NAME


def rewrite(path: Path, change: Callable[[list[Row]], object]) -> None:
    """Let a function change the rows of a table."""
    with path.open(encoding='utf-8', newline='') as stream:
        rows = list(csv.DictReader(stream))
    change(rows)
    names = list(rows[0])
    with path.open('w', encoding='utf-8', newline='') as stream:
        writer = csv.DictWriter(stream, names)
        writer.writeheader()
        writer.writerows(rows)


def line_of(path: Path, *cells: str) -> int:
    """The line that begins with these cells."""
    lines = path.read_text(encoding='utf-8').splitlines()
    start = ','.join(cells) + ','
    return next(number for number, line in enumerate(lines, 1) if line.startswith(start))


def refusal() -> str:
    """What is said against the tables."""
    with pytest.raises(CatalogError) as refused:
        load_afresh(NAME)
    return str(refused.value)


def test_tables_are_read_once() -> None:
    assert load_family(NAME) is load_family(NAME)
    assert load_afresh(NAME) is not load_family(NAME)


def test_every_folder_is_a_family() -> None:
    folders = Path(family.__file__).parents[1].glob('families/*/')
    assert list(families()) == sorted(path.name for path in folders if path.name[0] != '_')
    assert [load_family(name).name for name in families()] == list(families())
    with pytest.raises(ValueError, match=r"unknown model 'sinus_x': choose one of .*sinus_g2"):
        load_family('sinus_x')


@pytest.mark.parametrize('name', families())
def test_every_control_method_has_a_constant_in_the_message(name: str) -> None:
    message = MSG_DEFS / 'msg' / 'DriveStatus.msg'
    constants = re.findall(r'uint8 (\w+)=', message.read_text(encoding='utf-8'))
    assert {method.upper() for method in load_family(name).profile.methods} <= set(constants)


def test_folder_that_would_not_be_installed(folder: Path) -> None:
    again = folder.rename(folder.with_name('sinus_bare'))
    (again / '__init__.py').unlink()
    with pytest.raises(CatalogError, match=r'sinus_bare: no __init__\.py, without which'):
        load_afresh('sinus_bare')


def test_copied_tables_are_as_good(folder: Path) -> None:
    for name in TABLES:
        rewrite(folder / name, lambda rows: None)
    again, once = load_afresh(NAME), load_family(NAME)
    for table in ('parameters', 'status_codes', 'roles', 'error_logs'):
        assert getattr(again, table) == getattr(once, table)
    (folder / ERROR_LOG).unlink()
    assert load_afresh(NAME).error_logs == {}


#: What is wrong in a row: table, first cells, what is changed, what is said.
WRONG = [
    (PARAMETERS, 'motor.u_nom', {'minimum': '1000'}, 'the minimum is not below the maximum'),
    (PARAMETERS, 'motor.u_nom', {'access': 'x'}, "'x' is not a valid Access"),
    (PARAMETERS, 'motor.u_nom', {'when': 'always'}, "no 'always'"),
    (PARAMETERS, 'motor.u_nom', {'decimals': ''}, 'invalid literal'),
    (PARAMETERS, 'motor.u_nom', {'since': 'new'}, 'Invalid literal'),
    (PARAMETERS, 'control.mode', {'labels': '0=Freque|0=Speed'}, 'stands twice'),
    (PARAMETERS, 'control.mode', {'labels': '0=Freque|1=Freque'}, 'stands twice'),
    (PARAMETERS, 'control.mode', {'labels': 'Freque|Speed'}, 'not enough values'),
    (PARAMETERS, 'motor.u_nom', {'parameter': 'motor.p_nom'}, 'stands in line 2 already'),
    (ADDRESSES, 'motor.u_nom modbus', {'index': '0x22G4'}, 'invalid literal'),
    (ADDRESSES, 'motor.u_nom modbus', {'codec': 'uint7'}, "'uint7' is no codec"),
    (ADDRESSES, 'motor.u_nom modbus', {'factor': '1/0'}, 'Fraction'),
    (ADDRESSES, 'motor.u_nom modbus', {'factor': ''}, 'Invalid literal for Fraction'),
    (ADDRESSES, 'motor.u_nom canopen', {'sub_index': 'one'}, 'invalid literal'),
    (ADDRESSES, 'motor.u_nom modbus', {'index': '0x0221'},
     'modbus register 0221h stands in line 2 already'),
    (ADDRESSES, 'motor.u_nom classic', {'index': '0x0008'},
     'classic id 0008h stands in line 3 already'),
    (ADDRESSES, 'fieldbus.inv_st profibus', {'sub_index': '0'},
     'profibus pnu 040Eh.0000h stands in line 569 already'),
    (ADDRESSES, 'motor.u_nom classic',
     {'protocol': 'modbus', 'space': 'register', 'index': '0xF000'},
     'motor.u_nom on modbus stands in line 6 already'),
    (CODES, '5', {'code': 'five'}, 'invalid literal'),
    (CODES, '5', {'code': '256'}, 'code 256 is out of range, 0 to 255'),
    (CODES, '5', {'code': '-1'}, 'code -1 is out of range, 0 to 255'),
    (CODES, '5', {'code': '4'}, 'code 4 stands in line 6 already'),
    (CODES, '5', {'kind': 'disaster'}, "'disaster' is not a valid Kind"),
    (CODES, '5', {'requires_ack': 'maybe'}, "no 'maybe'"),
    (CODES, '5', {'meanings': 'tuned lost'}, "'lost' is not a valid Meaning"),
    (CODES, '37', {'renamed': 'later'}, 'Invalid literal for Fraction'),
    (ROLES, 'actual_speed', {'role': 'speed'}, "'speed' is not a valid Role"),
    (ROLES, 'actual_speed', {'role': 'firmware'}, 'firmware stands in line 5 already'),
    (ROLES, 'actual_speed', {'parameter': 'speed'}, 'no parameter is speed'),
    (ROLES, 'actual_speed', {'parameter': 'fieldbus.sw_ver'}, 'stands in line 5 already'),
    (ERROR_LOG, 'classic', {'codec': 'string4'}, 'an entry is no string4'),
    (ERROR_LOG, 'classic', {'protocol': 'modbus'}, 'modbus stands in line 2 already'),
    (ERROR_LOG, 'classic', {'stride': ''}, 'invalid literal'),
    (ADDRESSES, 'motor.u_nom modbus', {'parameter': 'motor.volt'}, 'no parameter is motor.volt'),
]


def test_wrong_row_is_refused_with_its_line(folder: Path) -> None:
    found = []
    for file, cells, change, message in WRONG:
        whole = (folder / file).read_text(encoding='utf-8')
        line = line_of(folder / file, *cells.split())
        rewrite(folder / file, lambda rows, at=line - 2, new=change: rows[at].update(new))
        said = refusal()
        if not (said.startswith(f'{NAME}/{file}, line {line}: ') and message in said):
            found.append((file, change, said))
        (folder / file).write_text(whole, encoding='utf-8')
    assert found == []


@pytest.mark.parametrize('file', TABLES)
def test_what_is_no_table_is_refused_with_its_line(folder: Path, file: str) -> None:
    path = folder / file
    whole = path.read_text(encoding='utf-8')
    lines = whole.splitlines()
    for third in (lines[1].rsplit(',', 1)[0], f'{lines[1]},surplus'):
        path.write_text('\n'.join([lines[0], third, *lines[2:]]) + '\n', encoding='utf-8')
        assert refusal() == f'{NAME}/{file}, line 2: too many or too few columns'
    column = {PARAMETERS: 'labels', ADDRESSES: 'codec', CODES: 'kind', ROLES: 'role'}.get(file)
    if column is not None:
        path.write_text(whole.replace(column, 'column', 1), encoding='utf-8')
        assert refusal() == f"{NAME}/{file}, line 2: no '{column}'"
    path.write_text(f'{whole}99,"open', encoding='utf-8')
    assert refusal() == f'{NAME}/{file}, line {len(lines) + 1}: unexpected end of data'
    path.write_bytes(b'code,text\n5,\xff\n')
    assert refusal().startswith(f"{NAME}/{file}: 'utf-8' codec can't decode")
    path.unlink()
    if file not in (PARAMETERS, ERROR_LOG):
        assert refusal().startswith(f'{NAME}/{file}: [Errno 2] No such file')


def test_parameter_without_an_address(folder: Path) -> None:
    line = line_of(folder / PARAMETERS, 'motor.u_nom')
    lines = (folder / ADDRESSES).read_text(encoding='utf-8').splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith('motor.u_nom,')]
    (folder / ADDRESSES).write_text(''.join(kept), encoding='utf-8')
    assert refusal() == f'{NAME}/{PARAMETERS}, line {line}: no address on any bus'


@pytest.mark.parametrize(
    ('steps', 'reason'),
    [
        ('0.05', 'not all steps are counts on classic'),
        ('0.1|20.05:0.5', 'not all steps are counts on classic'),
        ('0.1:', 'Invalid literal for Fraction'),
    ],
)
def test_steps_that_the_drive_cannot_take(folder: Path, steps: str, reason: str) -> None:
    def change(rows: list[Row]) -> None:
        for row in rows:
            row['steps'] = steps if row['parameter'] == 'control.accel' else ''

    rewrite(folder / PARAMETERS, change)
    line = line_of(folder / PARAMETERS, 'control.accel')
    said = refusal()
    assert said.startswith(f'{NAME}/{PARAMETERS}, line {line}: ')
    assert reason in said


def test_the_catalog_knows_no_family() -> None:
    names = {text for name in families() for text in (name, load_family(name).profile.title)}
    # how to set a parameter is shown by one
    keys = {key for name in families() for key in load_family(name)} - {'control.accel'}
    for path in Path(family.__file__).parent.glob('*.py'):
        text = path.read_text(encoding='utf-8')
        assert {name for name in names | keys if name in text} == set(), path.name
