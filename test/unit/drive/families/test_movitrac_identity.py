# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Who a MOVITRAC 31 says it is: type, size and software; one of another type is not connected."""

from __future__ import annotations

from typing import Any

from movitrac import make, succeeded
import pytest
from support.rig import Rig

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.drive import Cause, DriveError, Identity, Severity

TYPE, SIZE = 'status.inverter_type', 'status.output_stage'
SOFTWARE = 'special.software_system'


def identity(**parameters: Any) -> Identity:
    settings = {key.replace('__', '.'): value for key, value in parameters.items()}
    with make(parameters=settings) as rig:
        rig.connect()
        return rig.drive.identity


def test_it_identifies_its_size_and_its_software() -> None:
    with make() as rig:
        rig.connect()
        assert str(rig.drive.identity) == 'MOVITRAC 31C015-503-4-00, firmware 821 123 4.11'
        assert rig.drive.identity.vendor == 'SEW-EURODRIVE'
        assert rig.notes.said('connected: MOVITRAC 31C015-503-4-00', Severity.INFO)
        assert not rig.notes.said(Cause.UNEXPECTED_IDENTITY)


@pytest.mark.parametrize(('word', 'number'), [
    # the second example of [M4 §4 P810]
    (0x211234_11, '821 123 4.11'), (0x2112_3A11, '821 123 X.11'), (0x2F123411, 'P810 2F123411h'),
])
def test_a_part_number_is_put_together_as_the_manual_says(word: int, number: str) -> None:
    assert identity(special__software_system=word).versions == number


def test_a_size_that_the_manual_does_not_list_is_shown_as_its_number() -> None:
    with make() as rig:
        rig.far.memory.put(SIZE, 9900)
        rig.connect()
        assert rig.drive.identity.model == 'MOVITRAC 31.. (output stage 99)'


def test_what_a_drive_refuses_to_show_is_left_out() -> None:
    with make() as rig:
        rig.meet = lambda key, data: 'refused' if key in (TYPE, SIZE, SOFTWARE) else None
        rig.connect()
        assert str(rig.drive.identity) == ''
        assert rig.notes.said('connected: movitrac31', Severity.INFO)


@pytest.mark.parametrize('type_', ['MOVITRAC 3000', 'MOVIDYN 5000'])
@pytest.mark.parametrize('method', ['function_bits', 'monitor'])
def test_a_drive_of_another_type_is_not_connected_and_nothing_is_written(
    type_: str, method: str
) -> None:
    remote = {TYPE: type_, 'serial.control_mode': 'Remote control'}
    with Rig('movitrac', parameters=remote, control_method=method, drive_timeout=0.0) as rig:
        with pytest.raises(DriveError, match=f'identifies itself as a {type_}'):
            rig.connect()
        assert not any(data for _, _, data in rig.asked)


def test_a_type_that_the_manual_does_not_list_is_warned_of() -> None:
    with make() as rig:
        rig.far.memory.put(TYPE, 320000)
        rig.connect()
        assert rig.notes.said(Cause.UNLISTED_MODEL, Severity.WARNING)
        assert 'inverter type 3200' in rig.drive.identity.model
        rig.enable()


def test_one_that_was_exchanged_while_it_was_lost_is_not_connected_again() -> None:
    with make() as rig:
        rig.turn()
        rig.line.state = 'silent'
        rig.pass_time(4.0)
        rig.far.memory.put(TYPE, 500000)
        rig.line.mend()
        rig.asked.clear()
        rig.pass_time(10.0)
        # what its function bits are is known of no other
        assert not any(data for _, _, data in rig.asked) and not rig.drive.snapshot.connected
        assert rig.drive.stop_unconfirmed and rig.notes.said(Cause.CANNOT_STOP, Severity.ERROR)
        assert rig.notes.said(Cause.NOT_RECOGNISED)
        assert 'is not connected' in rig.answer(rig.drive.enable())
        assert not rig.drive.following


def test_a_stop_asks_nothing_of_the_type() -> None:
    with make() as rig:
        rig.turn()
        rig.asked.clear()
        assert succeeded(rig, rig.drive.stop())
        assert not {TYPE, SIZE, SOFTWARE} & {key for _, key, _ in rig.asked}


@pytest.mark.parametrize(('card', 'x20', 'x21'), [
    ('none', 'None', 'None'), ('fio', 'FIO', 'None'), ('ffi', 'FF. (Fieldbus)', 'None'),
    ('fen', 'None', 'FEN'), ('fpi', 'None', 'FPI'),
])
def test_option_cards_are_named_as_the_manual_names_them(card: str, x20: str, x21: str) -> None:
    # P050 and P051 are bytes 1 and 2 of index 237
    with make(options={'option_card': card}) as rig:
        rig.connect()
        params = rig.drive.params
        named = [
            rig.result(rig.bus.run(params.read(f'status.option_{place}', Priority.SERVICE)))
            for place in ('x20', 'x21')
        ]
        assert named == [x20, x21]
