# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``~/measured``: the quantities that the telemetry has no field for, by the drive's own names."""

from __future__ import annotations

import math
import re

import pytest
from support.places import ROOT
from support.rig import CONNECTIONS, Rig
from support.said import says

from nfo_sinus_driver.catalog import Access, families, load_family, load_profile
from nfo_sinus_driver.drive import Cause, DriveSettings

#: Where the drive shows the set-point that it was given [M0 table 4, M1].
OWN_SETPOINT = {
    'rtu': 'status.frq_set', 'classic': 'status.frq_set', 'canopen': 'status.frq_set',
    'classic v5.0': 'status.frq_set', 'rtu, control word': 'status.frq_set',
    'optimal': 'fieldbus.input_freq_setpoint',
}  # fmt: skip


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_what_matters_of_a_model_is_measured_without_being_named(connection: str) -> None:
    with Rig(connection, telemetry_rate=2.0).turn() as rig:
        rig.pass_time(4.0)
        values = rig.notes.telemetry[-1].measured
        model = rig.drive.model
        usual = [key for key in model.profile.measured if rig.drive.params.reaches(key)]
        assert list(values) == usual
        lacking = {key for key in usual if not rig.drive.state.nameplate.has(key)}
        assert {key for key, value in values.items() if math.isnan(value)} == lacking
        if connection in OWN_SETPOINT:
            assert values[OWN_SETPOINT[connection]] == pytest.approx(20.0, abs=0.11)


def test_the_manuals_own_example_of_a_safety_value_is_there() -> None:
    # heat sink temperature, P001 [M4 §1.1]
    with Rig('movitrac', telemetry_rate=2.0).turn() as rig:
        rig.pass_time(1.0)
        assert 0 < rig.notes.telemetry[-1].measured['status.heat_sink_temperature'] < 90


def test_names_choose_and_keep_their_order() -> None:
    names = ['status.dc_link', 'status.reg_act', 'status.frq_act']
    with Rig(measured=names, telemetry_rate=2.0).turn() as rig:
        rig.pass_time(1.0)
        values = rig.notes.telemetry[-1].measured
        assert list(values) == names
        assert values['status.dc_link'] == pytest.approx(565, abs=30)
        assert values['status.frq_act'] == pytest.approx(20.0, abs=0.11)


def test_a_value_that_is_lost_is_nan_and_not_the_old_one() -> None:
    with Rig(measured=['status.reg_act'], telemetry_rate=2.0).turn() as rig:
        rig.pass_time(1.0)
        rig.meet = lambda key, data: 'refused' if key == 'status.reg_act' else None
        rig.pass_time(1.0)
        assert math.isnan(rig.notes.telemetry[-1].measured['status.reg_act'])
        assert rig.drive.following


def test_a_value_with_labels_and_one_of_another_group_is_its_number() -> None:
    software = 'special.software_system'
    names = ['status.inverter_type', 'status.option_x20', 'terminal.output_61', software]
    with Rig('movitrac', measured=names, telemetry_rate=2.0).turn() as rig:
        codes = {'status.inverter_type': 3100, 'status.option_x20': 9, 'terminal.output_61': 1}
        for key, code in codes.items():
            rig.far.memory.set(key, rig.drive.model[key].labels[code])
        rig.far.memory.set(software, 21123411)
        rig.pass_time(1.5)
        assert rig.notes.telemetry[-1].measured == {**codes, software: 21123411}


@pytest.mark.parametrize('model', families())
def test_all_that_is_only_read_and_is_a_number_or_a_label_can_be_named(model: str) -> None:
    for method, chosen in load_profile(model).methods.items():
        family = load_family(model, method)
        read = [row.key for row in family.values() if row.access is Access.READ]
        reference = chosen.references[0]
        DriveSettings(model=model, control_method=method, reference=reference, measured=read)


@pytest.mark.parametrize('model', ['sinus_g2', 'sinus_optimal', 'movitrac31'])
def test_the_page_names_the_usual_ones_as_they_are_typed(model: str) -> None:
    page = (ROOT / 'docs/messages.md').read_text(encoding='utf-8')
    row = re.search(rf'^\| `{model}` \| (.*) \|$', page, re.MULTILINE)
    assert row and tuple(re.findall('`(.*?)`', row[1])) == load_profile(model).measured


@pytest.mark.parametrize('name', ['motor.p_nom', 'fieldbus.scmd', 'status.no_such', 'speed'])
def test_other_names_are_refused_with_those_that_there_are(name: str) -> None:
    with pytest.raises(ValueError, match=f'measured: sinus_g2 measures no {name!r}.*status.frq_a'):
        DriveSettings(measured=[name])


@pytest.mark.parametrize('model', families())
def test_the_usual_ones_of_every_model_are_measured_values_of_it(model: str) -> None:
    for method in load_profile(model).methods:
        family = load_family(model, method)
        assert {*family.profile.measured} <= {parameter.key for parameter in family.measured}


def test_a_monitored_drive_reports_the_setpoint_of_another_master() -> None:
    with Rig(control_method='monitor', telemetry_rate=2.0).connect() as rig:
        target = rig.drive.model.profile.setpoints['Freque'].key
        rig.far.memory.set(target, 12.5)
        rig.pass_time(1.5)
        assert rig.notes.snapshots[-1].setpoint == pytest.approx(12.5)


@pytest.mark.parametrize(('mode', 'setpoint'), [('Freque', 25.0), ('Speed', 750.0)])
def test_a_monitored_optimal_reports_the_setpoint_that_it_follows(
    mode: str, setpoint: float
) -> None:
    # that of its terminals here, and not the one that was written last over the bus [C53]
    with Rig(
        'optimal',
        parameters={'control.mode': mode},
        control_method='monitor',
        expected_control_mode=mode,
        telemetry_rate=2.0,
    ).connect() as rig:
        rig.far.memory.set(rig.drive.model.profile.setpoints[mode].key, 12)
        rig.far.control_unit.press('ext')
        rig.pass_time(1.5)
        assert rig.notes.snapshots[-1].setpoint == pytest.approx(setpoint)
        followed = rig.drive.model.profile.setpoints[mode].followed
        assert rig.notes.telemetry[-1].measured[followed] == pytest.approx(setpoint)


def test_what_is_only_read_is_kept_up_beside_the_settings() -> None:
    with Rig('movitrac') as rig:
        rig.answer(rig.drive.connect(parameters=True))
        values = rig.drive.parameters.values
        key = 'special.software_system'
        assert not rig.drive.model[key].is_setting
        before = int(values[key])
        rig.far.memory.set(key, before + 7)
        rig.wait_until(lambda: rig.drive.parameters.values[key] == before + 7, 120.0)
        change = rig.answer(rig.drive.parameters.change({key: before}))
        assert says(change, Cause.NO_SETTING)
