# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``nfo-sinus family``, ``families``, and ``--family`` of the tool and the simulator."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
import re
import shutil

from cli_bench import MakeBench
import pytest
from support.described import SHIPPED
from support.recognition import other_make
import yaml

from nfo_sinus_driver.catalog.finding import find
from nfo_sinus_driver.cli import families
from nfo_sinus_driver.cli.main import main, parse
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.simulator import main as simulator

V20 = str(SHIPPED['siemens_v20'])


def test_a_file_is_checked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = tmp_path / 'bad.vfd.yaml'
    bad.write_text(Path(V20).read_text().replace('bit: 2', 'bit: 3'))
    assert main(['family', 'check', V20]) == 0
    said = capsys.readouterr().out
    assert "SINAMICS V20, 4 settings, from its maker's manual, on no drive yet" in said
    assert 'no time-out of its own' in said
    assert main(['family', 'check', V20, str(bad)]) == 1
    assert f'{bad}, line 39: fault and running mean the same bits' in capsys.readouterr().out
    assert main(['family', 'check', str(tmp_path / 'none.vfd.yaml')]) == 1
    assert 'no such file' in capsys.readouterr().out
    # as --family takes it
    assert main(['family', 'check', 'siemens_v20', 'sinus_g2']) == 0
    said = capsys.readouterr().out
    assert 'siemens_v20: Siemens SINAMICS V20' in said and 'sinus_g2: NFO Sinus G2' in said


def test_what_tells_a_drive_from_others_is_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    known = tmp_path / 'known.vfd.yaml'
    identify = 'identify: [{register: 40200, value: 1}]\ncontrol:'
    known.write_text(Path(V20).read_text().replace('control:', identify))
    for path, asked_for in ((V20, True), (str(known), False)):
        assert main(['family', 'check', path]) == 0
        assert ('add identify' in capsys.readouterr().out) is asked_for


def test_what_is_asked_for_is_shown_as_a_line_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    delta = SHIPPED['delta_vfd_el'].read_text()
    assert main(['family', 'check', 'delta_vfd_el']) == 0
    said = capsys.readouterr().out
    lines = re.findall(r'identify: \[.*\]|keeps_run: (?:true|false)', said)
    assert len(lines) == 3
    for first, second in (lines[:2], (lines[0], lines[2])):
        path = tmp_path / 'mine.vfd.yaml'
        path.write_text(f'{delta}{first}\n{second}\n')
        assert main(['family', 'check', str(path)]) == 0
        said = capsys.readouterr().out
        assert 'add identify' not in said and 'keeps_run' not in said


def test_a_forgotten_numbering_is_remarked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'printed.vfd.yaml'
    file.write_text(Path(V20).read_text().replace('  numbering: 40001\n', ''))
    for path, remarked in ((V20, False), (str(file), True)):
        assert main(['family', 'check', path]) == 0
        assert ('add numbering: 40001' in capsys.readouterr().out) is remarked


def test_whether_the_run_command_survives_a_power_cycle_is_asked_where_it_is_not_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number, said in enumerate(('', 'keeps_run: true\n', 'keeps_run: false\n')):
        file = tmp_path / f'mine{number}.vfd.yaml'
        file.write_text(Path(V20).read_text() + said)
        assert main(['family', 'check', str(file)]) == 0
        assert ('add keeps_run' in capsys.readouterr().out) is (not said)


@pytest.mark.parametrize('words', [('run', '10', '--for', '1'), ('stop',), ('set', 'ramp.accel=7')])
def test_a_drive_of_another_make_is_only_read(
    make_bench: MakeBench, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: Sequence[str]
) -> None:
    bench = make_bench(model=other_make(tmp_path), serial_numbers=[])
    delta = str(SHIPPED['delta_vfd_el'])
    assert main(['--port', bench.simulator.port, '--family', delta, *words]) != 0
    said = capsys.readouterr()
    assert 'another model' in said.err and 'is confirmed' not in said.err
    assert bench.writes() == [] and not bench.state()['run_command']


def test_info_says_that_nothing_identifies_the_drive(
    make_bench: MakeBench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    known = tmp_path / 'known.vfd.yaml'
    identify = 'identify: [{register: 40200, value: 1}]\ncontrol:'
    known.write_text(Path(V20).read_text().replace('control:', identify))
    bench = make_bench(model=str(known), serial_numbers=[])
    for file, is_known in ((V20, False), (str(known), True)):
        assert main(['--port', bench.simulator.port, '--family', file, 'info']) == 0
        said = capsys.readouterr().err
        assert ('recognised by nothing of its own' in said) is not is_known


@pytest.mark.parametrize('typed', ['yaskawa_v1000', 'siemens_v20', './mine.vfd.yaml'])
def test_the_file_of_a_scan_names_the_family_from_wherever_the_driver_is_started(
    make_bench: MakeBench,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    typed: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(V20, 'mine.vfd.yaml')
    model = find(typed)
    bench = make_bench(model=model, serial_numbers=[])
    line = ('--port', bench.simulator.port, '--family', typed, '--retries', '1')
    assert main([*line, 'scan', '--addresses', '1-2', '--params', '-']) == 0
    written = yaml.safe_load(capsys.readouterr().out)
    monkeypatch.chdir('/')
    given = written['/**/drive_2']['ros__parameters']
    assert given['address'] == 2 and DriveSettings(**given).model == model


def test_families_are_listed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    assert main(['family', 'list']) == 0
    listed = capsys.readouterr().out
    assert {'sinus_g2', *SHIPPED} <= {line.split()[0] for line in listed.splitlines()}
    assert V20 in listed
    monkeypatch.setattr('sys.argv', ['families', '--ros-args', '-r', '__node:=x'])
    assert families.main() == 0
    assert capsys.readouterr().out == listed


def test_the_line_is_that_of_the_file_where_nothing_else_is_given() -> None:
    options = parse(['--family', 'yaskawa_v1000', 'info'])
    assert (options.address, options.baud_rate, options.char_format) == (31, 9600, '8N1')
    options = parse(['info', '--family', 'yaskawa_v1000', '--address', '2', '--baud-rate', '1200'])
    assert (options.address, options.baud_rate, options.char_format) == (2, 1200, '8N1')
    assert options.protocol == 'modbus_rtu'
    # its speed is none of another protocol
    options = parse(['--family', 'yaskawa_v1000', '--protocol', 'modbus_tcp', 'info'])
    assert (options.address, options.baud_rate, options.protocol) == (31, 0, 'modbus_tcp')
    options = parse(['--family', 'yaskawa_v1000', '--baud-rate', '0', 'info'])
    assert options.baud_rate == 9600
    assert options.model == str(SHIPPED['yaskawa_v1000'])


def test_a_family_that_is_none_leaves_with_what_to_do(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for command in (['--family', 'none', 'info'], ['--family', './none.vfd.yaml', 'info']):
        with pytest.raises(SystemExit) as left:
            parse(command)
        assert left.value.code == 2
    assert 'choose one of' in (said := capsys.readouterr().err) and 'no such file' in said
    assert 'usage' not in said
    with pytest.raises(SystemExit):
        simulator.main(['--family', 'none'])
    assert "no family 'none'" in capsys.readouterr().err


def test_a_parameter_file_is_of_the_family(tmp_path: Path) -> None:
    path = tmp_path / 'mine.vfd.yaml'
    shutil.copy(V20, path)
    assert parse(['--family', str(path), 'info']).model == str(path)


def test_info_of_a_described_drive_has_its_title(make_bench: MakeBench) -> None:
    bench = make_bench(model=V20, serial_numbers=[])
    bench.options = ('--port', bench.simulator.port, '--family', V20)
    done = bench.run('info')
    assert done.status == 0, done.err
    assert ' Siemens SINAMICS V20\n' in done.out and 'module' not in done.out
