# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Nothing that the tables have is missing in the page of all parameters."""

from __future__ import annotations

from pathlib import Path
import runpy

from nfo_sinus_driver.catalog import Access, families, load_family
from nfo_sinus_driver.cli.parameter_file import readable

ROOT = Path(__file__).resolve().parents[3]
page = runpy.run_path(str(ROOT / 'tools' / 'parameters_page.py'))['page']
LINES = page().splitlines()


def cells(line: str) -> list[str]:
    """The cells of a row."""
    return [cell.strip() for cell in line.strip('|').split('|')]


def rows_of(parameter: str) -> list[dict[str, str]]:
    """The rows whose first cell is a parameter, by the titles of their table."""
    found = []
    titles: list[str] = []
    for line in LINES:
        if not line.startswith('| '):
            titles = []
        elif not titles:
            titles = cells(line)
        elif cells(line)[0] == parameter:
            found.append(dict(zip(titles, cells(line), strict=True)))
    return found


def test_every_table_is_one() -> None:
    before: list[str] = []
    for line in LINES:
        row = cells(line) if line.startswith('|') else []
        if row and before:
            assert len(row) == len(before), line
        before = row


def test_every_parameter_has_its_row() -> None:
    missing = []
    for row in (row for name in families() for row in load_family(name).values()):
        modbus = row.addresses.get('modbus')
        register = f'{modbus.index:04X}h' if modbus else ''
        found = rows_of(f'`{row.key}`')
        if (row.description, register) not in {
            (printed['Meaning'], printed.get('Modbus', '')) for printed in found
        }:
            missing.append(row.key)
    assert missing == []


def test_rows_written_by_hand() -> None:
    assert rows_of('`motor.p_nom`') == [
        {
            'ROS parameter': '`motor.p_nom`',
            'Display': 'P-Nom',
            'Meaning': 'Nominal motor output (RMS)',
            'Type': 'double',
            'Values': '0.01 to 100',
            'Unit': 'kW',
            'Step': '0.001, 0.01',
            'Stopped': 'yes',
            'Modbus': '0220h',
            'Classic': 'E0008',
            'PROFIBUS': 'P1005',
            'CANopen': '2005h',
        }
    ]
    assert rows_of('`error.short_c_err_cnt`')[0]['From'] == '4.32'
    assert rows_of('`motor.l_main`')[0]['Step'] == '0.000001, 0.0001'
    assert rows_of('`motor.i_nom`')[0]['Values'] == 'from 0.1'
    assert rows_of('`pi_reg.reg_amp`')[0]['Values'] == '-1, 1'
    assert rows_of('`serial.auto_stop`')[0]['Values'] == '`false`, `true`'
    assert rows_of('`output.v_out`')[0]['Values'] == (
        '`Disable` (0), `Freque` (1), `Speed` (2), `Torque` (3)'
    )
    assert rows_of('`status.op_time`')[0]['Classic'] == 'E0027, E0127'
    assert rows_of('`fieldbus.inv_st_with_ack`')[0]['Access'] == 'reading acknowledges'
    assert any(
        line.startswith('`pi_reg.op_mode` is one of `Terminal` (129), ')
        and line.endswith(', `Temp F` (258), `Temp R` (259).')
        for line in LINES
    )


def test_everything_that_a_drive_keeps_or_measures_is_read_by_the_tool_and_by_ros() -> None:
    for name in families():
        family = load_family(name)
        rows = [row for row in family.values() if row.access is Access.READ]
        # the driver itself reads the words of the bus
        listed = {row.key for row in rows if row.group != 'Fieldbus'}
        assert listed <= readable(family).keys()
        assert listed <= {parameter.key for parameter in family.measured}
    only_read = [row for row in load_family('movitrac31').kept if not row.is_setting]
    part = page().split('### Only read\n')[1].split('### ')[0]
    assert part.count('\n| ') == 2 + len(only_read) == 21
