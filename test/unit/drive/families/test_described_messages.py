# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is said of described drives: in the words and the numbers of their files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.described import DescribedRig
from support.oddities import PLAIN, described
from test_described_faults import complaints

from nfo_sinus_driver.drive import Cause

HEX = {
    'line': {'numbering': 1},
    'status': {'register': 0x2101, 'running': {'bit': 0}, 'fault': {'bit': 3}},
}


def in_hex(file: Path, *numbers: int) -> Path:
    """Have a file write numbers in hexadecimal."""
    text = file.read_text(encoding='utf-8')
    for number in numbers:
        text = text.replace(f'register: {number}\n', f'register: 0x{number:04X}\n')
    file.write_text(text, encoding='utf-8')
    return file


def test_registers_are_named_as_the_file_has_them(tmp_path: Path) -> None:
    rig = DescribedRig(in_hex(described(tmp_path, **HEX), 0x2101))
    names = {key: row.name for key, row in rig.file.parameters.items()}
    assert names['line.status'] == 'status (register 0x2101)'
    assert names['line.r0009'] == 'register 10' and names['line.setpoint'] == (
        'set-point (register 11)'
    )
    assert names['measured.actual_frequency'] == 'actual_frequency (register 22)'
    assert names['line.fault'] == 'fault (register 21)'
    status = {**HEX['status'], 'alarm': {'register': 50, 'bit': 1}}
    status['ready'] = {'register': 0x2200, 'bit': 1}
    said = complaints(tmp_path, **{**HEX, 'status': status})
    assert 'the status stands at 50' in said and '0032h' not in said, said


def test_what_a_drive_lacks_is_named(tmp_path: Path) -> None:
    with DescribedRig(in_hex(described(tmp_path, **HEX), 0x2101)) as rig:
        rig.spoil('none such', 'line.status', 1000, written=False)
        answer = rig.answer(rig.drive.connect())
        assert 'every odd has status (register 0x2101)' in answer, answer


def test_all_that_is_required_is_said_at_once(tmp_path: Path) -> None:
    choices = {0: 'Keypad', 1: 'Bus'}
    parameters = {
        **PLAIN['parameters'],
        'source.command': {'register': 41, 'choices': choices},
        'source.reference': {'register': 42, 'choices': choices},
    }
    requires = [
        {'parameter': 'source.command', 'value': 'Bus', 'text': 'set P01 to 1.'},
        {'parameter': 'source.reference', 'value': 'Bus'},
    ]
    file = described(
        tmp_path, parameters=parameters, control={**PLAIN['control'], 'requires': requires}
    )
    with DescribedRig(file) as rig:
        rig.connect()
        answer = rig.answer(rig.drive.enable())
        assert answer == (
            'the line has no control: source.command is Keypad (set P01 to 1), '
            'source.reference is Keypad (set it to Bus)'
        )
        rig.spoil('none such', 'source.reference', 1000, written=False)
        assert 'the drive has no source.reference' in rig.answer(rig.drive.enable())


@pytest.mark.parametrize('state', ['silent', 'noise'])
def test_what_to_check_at_the_drive_is_said_whatever_comes(tmp_path: Path, state: str) -> None:
    line: dict[str, Any] = {'check': 'P01 = 2 (RS-485).', 'baud_rate': 9600}
    with DescribedRig(described(tmp_path, line=line)) as rig:
        rig.line.state = state
        answer = rig.answer(rig.drive.connect())
        cause = Cause.NO_RESPONSE if state == 'silent' else Cause.NO_VALID_ANSWER
        assert cause in answer.causes, answer
        assert 'P01 = 2 (RS-485); 9600 bit/s from the factory' in answer, answer


def test_a_coil_is_on_or_off(tmp_path: Path) -> None:
    said = complaints(tmp_path, control={
        'run': [{'coil': 2, 'value': 1}], 'stop': [{'coil': 2, 'on': False}],
    })
    assert 'on: true or on: false' in said, said


def test_sentences_of_a_file_end_as_those_of_the_driver(tmp_path: Path) -> None:
    codes = {7: {'text': 'hot', 'description': 'Too hot.', 'remedy': 'Let it cool.'}}
    with DescribedRig(described(tmp_path, faults={'register': 900, 'codes': codes})) as rig:
        rig.turn()
        rig.far.trip(7)
        rig.pass_time(0.5)
        shown = rig.drive.snapshot
        assert (shown.description, shown.remedy) == ('Too hot', 'Let it cool')
        for event in rig.notes.events:
            assert '.;' not in event.text and '. ;' not in event.text and '.:' not in event.text
