# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""Reading the tables: fast, cached, and never a table that contradicts itself or another one."""

from __future__ import annotations

from collections.abc import Callable
import csv
from pathlib import Path
import re
import shutil
import time

import pytest

from nfo_sinus_driver.catalog import CatalogError, Role, families, family, load_family

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


def spoil(path: Path, number: int, change: Row) -> None:
    """Change the row that stands in a line."""
    rewrite(path, lambda rows: rows[number - 2].update(change))


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


def test_tables_are_loaded_in_no_time() -> None:
    # a disaster is what this looks for; the machine may be slow, so the best of three counts
    times = []
    for _ in range(3):
        start = time.perf_counter()
        loaded = load_afresh(NAME)
        times.append(time.perf_counter() - start)
    assert len(loaded) == 155
    assert min(times) < 1.0


def test_tables_are_read_once() -> None:
    assert load_family(NAME) is load_family(NAME)
    assert load_afresh(NAME) is not load_family(NAME)


def test_every_folder_is_a_family() -> None:
    folders = Path(family.__file__).parents[1].glob('families/*/')
    assert list(families()) == sorted(path.name for path in folders if path.name[0] != '_')
    assert [load_family(name).name for name in families()] == list(families())


@pytest.mark.parametrize('name', families())
def test_every_control_method_has_a_constant_in_the_message(name: str) -> None:
    message = Path(__file__).parents[3] / 'msg_defs' / 'msg' / 'DriveStatus.msg'
    constants = re.findall(r'uint8 (\w+)=', message.read_text(encoding='utf-8'))
    assert {method.upper() for method in load_family(name).profile.methods} <= set(constants)


def test_unknown_family() -> None:
    with pytest.raises(ValueError, match=r"unknown model 'sinus_x': choose one of .*sinus_g2"):
        load_family('sinus_x')


def test_folder_that_would_not_be_installed(folder: Path) -> None:
    again = folder.rename(folder.with_name('sinus_bare'))
    (again / '__init__.py').unlink()
    with pytest.raises(CatalogError, match=r'sinus_bare: no __init__\.py, without which'):
        load_afresh('sinus_bare')


def test_copied_tables_are_as_good(folder: Path) -> None:
    for name in TABLES:
        rewrite(folder / name, lambda rows: None)
    again, once = load_afresh(NAME), load_family(NAME)
    assert again.parameters == once.parameters
    assert again.status_codes == once.status_codes
    assert again.roles == once.roles
    assert again.error_logs == once.error_logs


@pytest.mark.parametrize(
    ('file', 'cells', 'change', 'message'),
    [
        (PARAMETERS, ['motor.u_nom'], {'minimum': '1000'}, 'the minimum is not below the maximum'),
        (PARAMETERS, ['motor.u_nom'], {'minimum': '2000'}, 'the minimum is not below the maximum'),
        (PARAMETERS, ['motor.u_nom'], {'access': 'x'}, "'x' is not a valid Access"),
        (PARAMETERS, ['motor.u_nom'], {'when': 'always'}, "no 'always'"),
        (PARAMETERS, ['motor.u_nom'], {'decimals': ''}, 'invalid literal'),
        (PARAMETERS, ['motor.u_nom'], {'since': 'new'}, 'Invalid literal'),
        (PARAMETERS, ['control.mode'], {'labels': '0=Freque|0=Speed'}, 'stands twice'),
        (PARAMETERS, ['control.mode'], {'labels': '0=Freque|1=Freque'}, 'stands twice'),
        (PARAMETERS, ['control.mode'], {'labels': 'Freque|Speed'}, 'not enough values'),
        (PARAMETERS, ['control.mode'], {'labels': 'x=Freque'}, 'invalid literal'),
        (PARAMETERS, ['motor.u_nom'], {'parameter': 'motor.p_nom'}, 'stands in line 2 already'),
        (ADDRESSES, ['motor.u_nom', 'modbus'], {'index': '0x22G4'}, 'invalid literal'),
        (ADDRESSES, ['motor.u_nom', 'modbus'], {'codec': 'uint7'}, "'uint7' is no codec"),
        (ADDRESSES, ['motor.u_nom', 'modbus'], {'factor': 'one'}, 'Invalid literal for Fraction'),
        (ADDRESSES, ['motor.u_nom', 'modbus'], {'factor': '1/0'}, 'Fraction'),
        (ADDRESSES, ['motor.u_nom', 'modbus'], {'factor': ''}, 'Invalid literal for Fraction'),
        (ADDRESSES, ['motor.u_nom', 'canopen'], {'sub_index': 'one'}, 'invalid literal'),
        (
            ADDRESSES,
            ['motor.u_nom', 'modbus'],
            {'index': '0x0221'},  # the second register of P-Nom
            'modbus register 0221h stands in line 2 already',
        ),
        (
            ADDRESSES,
            ['motor.u_nom', 'classic'],
            {'index': '0x0008'},
            'classic id 0008h stands in line 3 already',
        ),
        (
            ADDRESSES,
            ['fieldbus.inv_st', 'profibus'],
            {'sub_index': '0'},
            'profibus pnu 040Eh.0000h stands in line 569 already',
        ),
        (
            ADDRESSES,
            ['motor.u_nom', 'classic'],
            {'protocol': 'modbus', 'space': 'register', 'index': '0xF000'},
            'motor.u_nom on modbus stands in line 6 already',
        ),
        (CODES, ['5'], {'code': 'five'}, 'invalid literal'),
        (CODES, ['5'], {'code': '256'}, 'code 256 is out of range, 0 to 255'),
        (CODES, ['5'], {'code': '-1'}, 'code -1 is out of range, 0 to 255'),
        (CODES, ['5'], {'code': '4'}, 'code 4 stands in line 6 already'),
        (CODES, ['5'], {'kind': 'disaster'}, "'disaster' is not a valid Kind"),
        (CODES, ['5'], {'requires_ack': 'maybe'}, "no 'maybe'"),
        (CODES, ['5'], {'meanings': 'tuned lost'}, "'lost' is not a valid Meaning"),
        (CODES, ['37'], {'renamed': 'later'}, 'Invalid literal for Fraction'),
        (ROLES, ['actual_speed'], {'role': 'speed'}, "'speed' is not a valid Role"),
        (ROLES, ['actual_speed'], {'role': 'firmware'}, 'firmware stands in line 5 already'),
        (ROLES, ['actual_speed'], {'parameter': 'speed'}, 'no parameter is speed'),
        (ROLES, ['actual_speed'], {'parameter': 'fieldbus.sw_ver'}, 'stands in line 5 already'),
        (ERROR_LOG, ['classic'], {'codec': 'string4'}, 'an entry is no string4'),
        (ERROR_LOG, ['classic'], {'protocol': 'modbus'}, 'modbus stands in line 2 already'),
        (ERROR_LOG, ['classic'], {'stride': ''}, 'invalid literal'),
    ],
)
def test_wrong_row_is_refused_with_its_line(
    folder: Path, file: str, cells: list[str], change: Row, message: str
) -> None:
    line = line_of(folder / file, *cells)
    spoil(folder / file, line, change)
    said = refusal()
    assert said.startswith(f'{NAME}/{file}, line {line}: ')
    assert message in said


def test_address_of_no_parameter(folder: Path) -> None:
    path = folder / ADDRESSES
    line = line_of(path, 'motor.u_nom', 'modbus')
    spoil(path, line, {'parameter': 'motor.volt'})
    assert refusal() == f'{NAME}/{ADDRESSES}, line {line}: no parameter is motor.volt'


def test_parameter_without_an_address(folder: Path) -> None:
    line = line_of(folder / PARAMETERS, 'motor.u_nom')
    lines = (folder / ADDRESSES).read_text(encoding='utf-8').splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith('motor.u_nom,')]
    (folder / ADDRESSES).write_text(''.join(kept), encoding='utf-8')
    assert refusal() == f'{NAME}/{PARAMETERS}, line {line}: no address on any bus'


@pytest.mark.parametrize('file', TABLES)
@pytest.mark.parametrize('end', ['', ',surplus'])
def test_wrong_number_of_columns(folder: Path, file: str, end: str) -> None:
    lines = (folder / file).read_text(encoding='utf-8').splitlines()
    lines[3] = lines[3] + end if end else lines[3].rsplit(',', 1)[0]
    (folder / file).write_text('\n'.join(lines) + '\n', encoding='utf-8')
    assert refusal() == f'{NAME}/{file}, line 4: too many or too few columns'


@pytest.mark.parametrize(
    ('file', 'column'), [(PARAMETERS, 'labels'), (ADDRESSES, 'codec'), (ROLES, 'role')]
)
def test_missing_column(folder: Path, file: str, column: str) -> None:
    text = (folder / file).read_text(encoding='utf-8')
    (folder / file).write_text(text.replace(column, 'column', 1), 'utf-8')
    assert refusal() == f"{NAME}/{file}, line 2: no '{column}'"


@pytest.mark.parametrize('file', [ADDRESSES, CODES, ROLES])
def test_missing_table(folder: Path, file: str) -> None:
    (folder / file).unlink()
    assert refusal().startswith(f'{NAME}/{file}: [Errno 2] No such file')


def test_table_that_is_no_text(folder: Path) -> None:
    (folder / CODES).write_bytes(b'code,text\n5,\xff\n')
    assert refusal().startswith(f"{NAME}/{CODES}: 'utf-8' codec can't decode")


def test_quote_that_is_not_closed(folder: Path) -> None:
    text = (folder / CODES).read_text(encoding='utf-8')
    (folder / CODES).write_text(text + '99,"open', 'utf-8')
    assert refusal() == f'{NAME}/{CODES}, line 50: unexpected end of data'


def test_roles() -> None:
    g2, optimal = load_family('sinus_g2'), load_family('sinus_optimal')
    # pole pairs follow from its nominal values, and no setting of it is a keypad's control
    assert set(Role) - set(g2.roles) == {Role.POLE_PAIRS, Role.LOCAL_OPERATION}
    assert set(g2.roles) > set(optimal.roles)
    assert g2.key(Role.ACTUAL_SPEED) == 'status.spd_act'
    assert g2.key(Role.COMMUNICATION_TIMEOUT) == 'serial.sio_tot'
    assert g2.role_of['status.spd_act'] is Role.ACTUAL_SPEED
    assert 'status.sigma' not in g2.role_of
    # a role that nobody has is a feature that is missing
    assert optimal.key(Role.COMMUNICATION_TIMEOUT) == ''
    assert optimal.key(Role.COMMUNICATION_TIMEOUT) not in optimal


def test_family_without_an_error_log(folder: Path) -> None:
    (folder / ERROR_LOG).unlink()
    assert load_afresh(NAME).error_logs == {}


def test_the_catalog_knows_no_family() -> None:
    names = {name for one in families() for name in (one, load_family(one).profile.title)}
    # how to set a parameter is shown by one
    keys = {key for one in families() for key in load_family(one)} - {'control.accel'}
    for path in Path(family.__file__).parent.glob('*.py'):
        text = path.read_text(encoding='utf-8')
        assert {name for name in names | keys if name in text} == set(), path.name


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
