# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which fault a described drive has: its number is read only while the status reports a fault."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.described import SHIPPED, DescribedRig
from support.oddities import ODD, PLAIN, described

from nfo_sinus_driver.catalog.declared import DescriptionError, read
from nfo_sinus_driver.drive import Cause

_FAULTS = {'register': 900, 'codes': {7: {'text': 'hot', 'remedy': 'Let it cool'}}}
PLACES: dict[str, dict[str, Any]] = {
    'beside the status': {'faults': {**_FAULTS, 'register': 21}},
    'far away': {'faults': _FAULTS},
    'beside coils': {**ODD['coils'], 'faults': _FAULTS},
    'an input register': {'faults': {**_FAULTS, 'table': 'input'}},
    'some bits of a register': {'faults': {**_FAULTS, 'bits': [4, 8]}},
    'the third place': {
        'faults': _FAULTS, 'status': {**PLAIN['status'], 'alarm': {'register': 50, 'bit': 2}},
    },
}


def reads(rig: DescribedRig) -> int:
    """Return how often the number of the fault was read."""
    return sum(key == 'line.fault' for _, key, _ in rig.asked)


@pytest.mark.parametrize('name', PLACES)
def test_a_fault_is_named_by_a_register_that_is_read_for_it_alone(
    tmp_path: Path, name: str
) -> None:
    with DescribedRig(described(tmp_path, **PLACES[name])) as rig:
        rig.turn(20.0)
        assert not reads(rig)
        rig.far.trip(7)
        rig.pass_time(0.5)
        assert reads(rig)
        shown = rig.drive.snapshot
        assert shown.text == 'hot' and shown.remedy == 'Let it cool' and shown.status is not None
        assert shown.status.code == 7 and shown.requires_ack
        # the first report of it has its name
        assert not rig.drive.following and shown.stop is not None
        assert 'hot' in str(shown.stop), shown.stop
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
        rig.pass_time(0.5)
        before = reads(rig)
        rig.pass_time(2.0)
        assert reads(rig) == before and rig.drive.snapshot.text == 'Ready'


def test_another_fault_that_comes_meanwhile_has_its_own_name(tmp_path: Path) -> None:
    codes = {7: {'text': 'hot'}, 8: {'text': 'short circuit'}}
    with DescribedRig(described(tmp_path, faults={'register': 900, 'codes': codes})) as rig:
        rig.connect()
        for number, text in ((7, 'hot'), (8, 'short circuit'), (99, 'Fault 99')):
            rig.far.faults.acknowledge()
            rig.far.trip(number)
            rig.pass_time(2.5)
            assert rig.drive.snapshot.text == text and rig.drive.snapshot.status.faulted


@pytest.mark.parametrize('what', ['refused', 'unheard'])
def test_a_number_that_cannot_be_read_stops_no_status(tmp_path: Path, what: str) -> None:
    with DescribedRig(described(tmp_path, faults=_FAULTS)) as rig:
        rig.turn(20.0)
        rig.spoil(what, 'line.fault', 1000, written=False)
        rig.far.trip(7)
        rig.pass_time(2.0)
        assert rig.drive.state.contact.connected and not rig.drive.following
        shown = rig.drive.snapshot
        assert shown.text == 'Fault' and shown.status is not None and shown.status.faulted
        assert not rig.notes.said(Cause.LOST)
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())


def test_no_number_is_no_name(tmp_path: Path) -> None:
    with DescribedRig(described(tmp_path, faults={**_FAULTS, 'none': 3})) as rig:
        rig.connect()
        rig.far.trip(7)
        rig.far.control_unit.fault_number = lambda: 3
        rig.pass_time(2.0)
        assert rig.drive.snapshot.text == 'Fault'


def test_a_status_is_read_by_function_04_where_its_file_says_so(tmp_path: Path) -> None:
    # a condition beside others of the same row, and a holding register of the same number
    status = {**PLAIN['status'], 'table': 'input', 'alarm': {'register': 21, 'bit': 1}}
    with DescribedRig(described(tmp_path, status=status, faults={'register': 20})) as rig:
        rig.connect()
        asked = [bytes.fromhex(frame['hex'])[1] for frame in rig.line.frames]
        assert 4 in asked
        assert not reads(rig)
        assert 'line.fault' in rig.file.parameters


def test_what_stands_in_the_status_itself_is_not_read_again() -> None:
    for name in ('invertek_optidrive_e3', 'delta_ms300', 'delta_vfd_el'):
        file = read(SHIPPED[name])
        assert 'line.fault' not in file.parameters and file.codes is not None


def test_a_motor_of_an_acs355_has_its_direction_beside_its_fault() -> None:
    # 0103 OUTPUT FREQ is a size, 0101 SPEED & DIR has a sign
    with DescribedRig(SHIPPED['abb_acs355']) as rig:
        rig.connect()
        rig.enable()
        for frequency in (20.0, -20.0):
            rig.follow(frequency)
            rig.pass_time(1.0)
            assert rig.drive.snapshot.speed * frequency > 0
        rig.far.trip(16)
        rig.pass_time(0.5)
        assert rig.drive.snapshot.text == 'EARTH FAULT'
        place = rig.file.parameters['measured.actual_frequency'].at('modbus')
        assert not place.number.signed


def complaints(tmp_path: Path, **otherwise: Any) -> str:
    """Return what is wrong with a drive."""
    try:
        read(described(tmp_path, **otherwise))
    except DescriptionError as error:
        return str(error)
    return ''


def test_a_flag_may_have_a_code_of_its_own_and_no_two_faults_have_one(tmp_path: Path) -> None:
    flag = {'register': 21, 'bit': 0, 'text': 'hot'}
    coded = {'faults': {'register': 900, 'codes': {100: {'text': 'cold'}}, 'flags': [flag]}}
    said = complaints(tmp_path, **coded)
    assert "'hot' and 'cold' have the code 100" in said and 'code: ' in said, said
    coded['faults']['flags'] = [{**flag, 'code': 77}]
    with DescribedRig(described(tmp_path, **coded)) as rig:
        rig.connect()
        for code, text in ((77, 'hot'), (100, 'cold')):
            rig.far.faults.acknowledge()
            rig.far.trip(code)
            rig.pass_time(2.5)
            assert rig.drive.snapshot.text == text and rig.drive.snapshot.status.code == code
    coded['faults']['flags'] = [{**flag, 'code': 77}, {**flag, 'bit': 1, 'code': 77}]
    assert 'have the code 77' in complaints(tmp_path, **coded)
    # 190 to 199 are moved, as those of codes are
    coded['faults']['flags'] = [{**flag, 'code': 195}]
    assert not complaints(tmp_path, **coded)
    assert [fault.code for _, fault in read(described(tmp_path, **coded)).flags] == [1195]


def test_a_number_in_two_forms_is_one_number(tmp_path: Path) -> None:
    for otherwise in (
        {'faults': {'register': 21, 'codes': {'16': {'text': 'hot'}, '0x10': {'text': 'cold'}}}},
        {'line': {'exceptions': {'33': 'busy', '0x21': 'other'}}},
        {'line': {'exceptions': {'033': 'busy'}}},
    ):
        path = described(tmp_path, **otherwise)
        path.write_text(path.read_text(encoding='utf-8').replace("'", ''), encoding='utf-8')
        with pytest.raises(DescriptionError, match=r'stands in line \d+ already|zeros in front'):
            read(path)
