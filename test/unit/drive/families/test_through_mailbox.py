# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive behind a PLC whose blocks have a mailbox: settings, faults, error log, losses."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

import pytest
from support.rig import Rig
from support.said import raises, said
from support.telegram_laws import COMMANDS, words

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Access, Role, load_family
from nfo_sinus_driver.drive import Cause, DriveSettings, Procedure, Severity
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.parameter_channel import ParameterEntry

G2, SINUS_H = 'telegram1 g2, mailbox', 'telegram1 sinus_h, mailbox'
ACCEL = 'control.accel'


def plc(connection: str = G2, **setting: Any) -> Rig:
    """Return a drive behind a PLC that is programmed so."""
    return Rig(connection, line={'plc': setting, 'response_timeout': 0.2})


# --- settings -------------------------------------------------------------------------------------


def test_settings_of_a_g2_are_those_that_it_has_over_modbus() -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        values = rig.drive.parameters.values
        over_modbus = load_family('sinus_g2')
        reached = {row.key for row in over_modbus.settings if 'profibus' in row.addresses}
        assert set(values) == reached
        for key, value in values.items():
            assert value == rig.far.peek(key), key
            assert type(value) is over_modbus[key].kind or over_modbus[key].kind is float, key
        assert str(rig.drive.identity).startswith('firmware 4.38')


def test_a_setting_is_written_and_read_back() -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        rig.answer(rig.drive.parameters.change({ACCEL: 7.5, 'pi_reg.t_min': -12}))
        assert rig.far.peek(ACCEL) == 7.5 and rig.far.peek('pi_reg.t_min') == -12
        assert rig.far.writes[ACCEL] == rig.far.writes['pi_reg.t_min'] == 1
        assert rig.drive.parameters.values[ACCEL] == 7.5


def test_a_refusal_has_the_reason_of_the_drive() -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        channel = rig.line.plc.channels[1].server.parameters

        def refuse(raw: int) -> None:
            raise Refused(Reason.STATE, 'not now')

        channel.entries[1028, 1] = dataclasses.replace(channel.entries[1028, 1], write=refuse)
        with raises(Cause.NOT_CHANGED):
            rig.result(rig.drive.parameters.change({ACCEL: 9.0}))
        said = rig.answer(rig.drive.parameters.change({ACCEL: 9.0}))
        assert 'refused PNU 1028.1 (PROFIdrive error 11h)' in said


def test_what_only_a_standing_motor_allows_is_refused_while_it_turns() -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        rig.enable()
        rig.send(20.0)
        rig.pass_time(1.5)
        with raises(Cause.NOT_CHANGED):
            rig.result(rig.drive.parameters.change({'motor.f_nom': 60}))
        # it decides what a set-point means
        with raises(Cause.NOT_CHANGED):
            rig.result(rig.drive.parameters.change({'control.mode': 'Speed'}))
        assert rig.turns


def test_a_drive_in_a_mode_without_set_points_of_the_telegram_is_not_enabled() -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        rig.answer(rig.drive.parameters.change({'control.mode': 'Torque'}))
        with raises(Cause.WRONG_CONTROL_MODE):
            rig.result(rig.drive.enable())
        rig.answer(rig.drive.parameters.change({'control.mode': 'Freque'}))
        rig.enable()


def test_no_command_can_be_reached_by_the_mailbox_but_what_begins_a_procedure() -> None:
    model = load_family('sinus_g2', 'telegram1')
    assert not model['fieldbus.scmd'].is_setting
    written = {
        row.at('telegram1').index
        for row in model.values()
        if row.at('telegram1').space == 'pnu' and row.access is not Access.READ
    }
    assert len(written) > 100 and COMMANDS & written == {SCMD[0]}


# --- faults and the error log ---------------------------------------------------------------------


def test_a_fault_stops_the_motor_at_once_and_is_named_with_its_remedy() -> None:
    with Rig(G2) as rig:
        rig.turn()
        rig.far.trip(3)
        rig.wait_until(lambda: rig.notes.said('191 Fault'), 0.3)
        assert not rig.drive.following
        rig.wait_until(lambda: rig.drive.snapshot.text == 'Temp Hi', 1.5)
        shown = rig.drive.snapshot
        assert 'check fan' in shown.remedy and shown.requires_ack
        assert rig.far.faults, 'it is not acknowledged by that'
        assert rig.notes.said('fault 3 Temp Hi', Severity.ERROR)
        assert 'acknowledged 3 Temp Hi' in rig.answer(rig.drive.acknowledge())
        rig.pass_time(0.5)
        assert rig.drive.snapshot.text != 'Temp Hi'
        # the next one is another
        rig.far.trip(5)
        rig.wait_until(lambda: rig.notes.said('fault 5 '), 2.0)


def test_the_error_log_is_read_and_watched() -> None:
    with Rig(G2) as rig:
        rig.connect()
        for code in (3, 5):
            rig.far.trip(code)
            rig.pass_time(2.0)
            rig.acknowledged += 1
            rig.answer(rig.drive.acknowledge())
        entries = rig.result(rig.drive.error_log())
        assert [entry.code for entry in entries[:2]] == [5, 3]
        assert rig.notes.said('error log: 5 ')


@pytest.mark.parametrize(('code', 'text', 'remedy'), [
    (11, 'Overcurrent Trip', 'Lengthen the acceleration time'),
    (35, 'Lost Command', 'Check the PLC'),
    (
        64,
        'Internal Communication Error between the Inverter and the Option Card',
        'seat of the module',
    ),
])
def test_a_trip_of_a_sinus_h_is_named_with_its_remedy(code: int, text: str, remedy: str) -> None:
    with Rig(SINUS_H) as rig:
        rig.turn()
        rig.far.trip(code)
        rig.wait_until(lambda: rig.drive.snapshot.text == text, 1.5)
        assert remedy in rig.drive.snapshot.remedy
        assert [entry.code for entry in rig.result(rig.drive.error_log())] == [code]
        assert f'acknowledged {code} {text}' in rig.answer(rig.drive.acknowledge())
        # the present situation is empty now, and the one before it is the newest entry
        rig.pass_time(0.5)
        assert [entry.code for entry in rig.result(rig.drive.error_log())] == [code]
        assert rig.result(rig.drive.error_log(1))[0].code == code


def test_every_message_of_a_fault_situation_of_a_sinus_h_is_in_the_log() -> None:
    # eight situations of eight messages [M3 §9]
    with Rig(SINUS_H) as rig:
        rig.connect()
        for code in (12, 11, 64):
            rig.far.trip(code)
        (entry,) = rig.result(rig.drive.error_log())
        assert entry.code == 12
        assert entry.readings == (
            'also 11 Overcurrent Trip',
            'also 64 Internal Communication Error between the Inverter and the Option Card',
        )
        channel = rig.line.plc.channels[1].server.parameters
        for situation, messages in ((0, (0,)), (1, (12, 11)), (2, (33,))):
            for message in range(8):
                code = dict(enumerate(messages)).get(message, 0)
                channel.entries[947, 8 * situation + message] = ParameterEntry(
                    lambda code=code: code
                )
        shown = [(entry.code, entry.readings) for entry in rig.result(rig.drive.error_log())]
        assert shown[:2] == [(12, ('also 11 Overcurrent Trip',)), (33, ())]


def test_the_version_of_a_sinus_h_module_is_the_number_that_it_shows() -> None:
    # "102" is version 1.2 [M3 §8], and no 1.02
    with Rig(SINUS_H) as rig:
        rig.connect()
        params = rig.drive.params
        task = rig.bus.run(params.read('profidrive.version', Priority.SERVICE))
        assert rig.result(task) == 102


def test_torque_and_current_of_a_sinus_h_come_with_its_longer_telegram() -> None:
    with Rig(SINUS_H, telemetry_rate=2.0) as rig:
        rig.turn()
        rig.far.motor.load = 0.5
        rig.pass_time(2.0)
        measured = rig.notes.telemetry[-1].values
        motor = rig.far.motor
        assert measured[Role.ACTUAL_TORQUE] == pytest.approx(100 * motor.torque, abs=1.0)
        assert measured[Role.OUTPUT_CURRENT] == pytest.approx(motor.current, abs=0.2)
        assert rig.result(rig.drive.measure('profidrive.telegram')) == 'Vendor specific telegram'
    with Rig('telegram1 sinus_h', telemetry_rate=2.0) as rig:
        rig.turn()
        rig.pass_time(2.0)
        assert math.isnan(rig.notes.telemetry[-1].values[Role.ACTUAL_TORQUE])


def test_current_torque_and_voltages_of_a_g2_come_by_the_mailbox_one_each_time() -> None:
    # P1119 to P1123 and P1128 [M0 table 9]
    keys = [f'status.{name}' for name in ('u_rms', 'i_rms', 'p_out', 'pf', 'dc_link', 'trq_act')]
    with Rig(G2, telemetry_rate=2.0) as rig:
        rig.turn()
        rig.far.motor.load = 0.5
        rig.pass_time(10.0)
        measured = rig.notes.telemetry[-1].values
        motor = rig.far.motor
        assert measured[Role.OUTPUT_CURRENT] == pytest.approx(motor.current, abs=0.1)
        assert measured[Role.ACTUAL_TORQUE] == pytest.approx(100 * motor.torque, abs=2.0)
        for role in (Role.OUTPUT_VOLTAGE, Role.OUTPUT_POWER, Role.POWER_FACTOR):
            assert measured[role] > 0, role
        assert measured[Role.DC_LINK_VOLTAGE] > 500
        asked = len(rig.asked)
        rig.pass_time(10.0)
        key_of = {key for _, key, _ in rig.asked[asked:]}
        assert key_of >= set(keys)
        # each is several transactions of a PLC that has other work
        last = rig.notes.telemetry[-1].at
        times = [last - telemetry.at for telemetry in rig.notes.telemetry[-12:]]
        assert max(times) < 8.0
        assert rig.drive.following


def test_torque_by_the_mailbox_is_in_no_poll() -> None:
    with Rig(G2, telemetry_rate=0.0, poll_rate=10.0) as rig:
        rig.far.memory.set('control.mode', 'Torque')
        rig.connect()
        rig.pass_time(3.0)
        asked = len(rig.asked)
        rig.pass_time(3.0)
        assert not [key for _, key, _ in rig.asked[asked:] if key == 'status.trq_act']
        assert rig.drive.state.control_mode == 'Torque'


#: What the parameters of PROFIdrive are called here, by PNU and sub-index [M0 table 8].
PROFIDRIVE = {
    'profidrive.node_address': (918, 0),
    'profidrive.telegram': (922, 0),
    'profidrive.operating_mode': (930, 0),
    'profidrive.fault_counter': (944, 0),
    'profidrive.fault_number': (947, 0),
    'profidrive.warning_word': (953, 0),
    'profidrive.warning_word_2': (954, 0),
    'profidrive.manufacturer': (964, 0),
    'profidrive.unit_type': (964, 1),
    'profidrive.version': (964, 2),
    'profidrive.firmware_year': (964, 3),
    'profidrive.firmware_day': (964, 4),
    'profidrive.profile': (965, 0),
    'profidrive.control_word': (967, 0),
    'profidrive.status_word': (968, 0),
}


def test_parameters_of_profidrive_are_read_by_their_numbers() -> None:
    with Rig(G2) as rig:
        rig.connect()
        channel = rig.line.plc.channels[1].server.parameters
        for place in PROFIDRIVE.values():
            # each has another number: none is taken for another
            number = place[0] + 1000 * place[1]
            channel.entries[place] = ParameterEntry(lambda number=number: number)
        # a torque control mode, as the manual codes it
        channel.entries[930, 0] = ParameterEntry(lambda: 0x8000)
        found = {key: rig.result(rig.drive.measure(key)) for key in PROFIDRIVE}
        wanted: dict[str, Any] = {
            key: number + 1000 * sub for key, (number, sub) in PROFIDRIVE.items()
        }
        wanted |= {'profidrive.operating_mode': 'Torque control'}
        # xxyy, in decimal
        wanted |= {'profidrive.version': 29.64}
        assert found == wanted


def test_status_words_of_a_g2_are_read_by_their_numbers() -> None:
    with Rig(G2) as rig:
        rig.connect()
        entries = rig.line.plc.channels[1].server.parameters.entries
        # DriveStatus has 32 bits, of which 16 are described [M0 table 10], [C24]
        entries[1019, 0] = ParameterEntry(lambda: 0x00050231, size=4)
        entries[1001, 0] = ParameterEntry(lambda: 0x0331)
        words = 'fieldbus.drive_status', 'fieldbus.profidrive_status'
        assert [rig.result(rig.drive.measure(key)) for key in words] == [0x0231, 0x0331]


@pytest.mark.parametrize(('connection', 'version'), [(G2, 41), (SINUS_H, 40)])
def test_the_profile_is_the_high_byte_of_its_number_and_the_version_the_low_one(
    connection: str, version: int
) -> None:
    with Rig(connection) as rig:
        rig.connect()
        number = int(rig.result(rig.drive.measure('profidrive.profile')))
        # PROFIdrive is profile 3 [M0 table 8, M3 §8]
        assert divmod(number, 0x100) == (3, version)
        assert f'{number:04X}h' in rig.drive.state.model['profidrive.profile'].description


#: Of what is measured slowly, where it stands [M0 table 9], and how much of it is 1 there.
SLOW = {
    Role.MOTOR_TEMPERATURE: (1132, 0.1, 2),
    Role.PT1000_TEMPERATURE: (1131, 0.1, 2),
    Role.OPERATING_TIME: (1039, 0.1, 4),
    Role.RUNNING_TIME: (1040, 0.1, 4),
    Role.BRAKE_TIME: (1133, 1.0, 4),
    Role.ENERGY: (1233, 0.001, 4),
    Role.TOTAL_ENERGY: (1234, 1.0, 4),
}


def test_temperatures_times_energy_and_versions_of_a_g2_come_by_the_mailbox_too() -> None:
    named = ['status.spd_act', 'status.reg_act', 'fieldbus.sw_ver', 'fieldbus.nfo_ver']
    named += ['fieldbus.spd_scl_numerator', 'fieldbus.spd_scl_denominator']
    with Rig(G2, measured=named) as rig:
        channel = rig.line.plc.channels[1].server.parameters
        for pnu, _, size in SLOW.values():
            number = 3 * pnu
            channel.entries[pnu, 0] = ParameterEntry(
                lambda number=number: number, size=size, signed=True
            )
        for pnu, number in ((1022, -345), (1130, 234)):
            channel.entries[pnu, 0] = ParameterEntry(lambda number=number: number, signed=True)
        for sub, number in enumerate((3, 20)):
            channel.entries[1023, sub] = ParameterEntry(lambda number=number: number, size=4)
        rig.connect()
        rig.wait_until(lambda: rig.notes.telemetry)
        shown = rig.notes.telemetry[0]
        wanted = {role: pytest.approx(3 * pnu * unit) for role, (pnu, unit, _) in SLOW.items()}
        assert {role: shown.values[role] for role in SLOW} == wanted
        assert [*shown.measured.values()] == pytest.approx(
            [-345, 23.4, 4.38, 4018, 3, 20]
        )


@pytest.mark.parametrize(('scale', 'told'), [((1, 1), True), ((0, 0), True), ((3, 20), False)])
def test_in_freque_the_speed_comes_by_the_mailbox(scale: tuple[int, int], told: bool) -> None:
    with Rig(G2, telemetry_rate=2.0) as rig:
        entries = rig.line.plc.channels[1].server.parameters.entries
        speed = 1432
        asked: list[int] = []

        def read() -> int:
            asked.append(speed)
            return speed

        # P1022 in rpm, by the factory's SpdScl (P1023) [M0 table 9, §8.3.2]
        entries[1022, 0] = ParameterEntry(read, signed=True)
        for sub, number in enumerate(scale):
            entries[1023, sub] = ParameterEntry(lambda number=number: number, size=4)
        rig.connect()
        rig.drive.activate()
        for speed in (1432, -1432, 0):
            rig.pass_time(10.0)
            shown = rig.drive.snapshot
            assert shown.speed == pytest.approx(speed if told else math.nan, nan_ok=True)
            assert rig.notes.telemetry[-1].values[Role.ACTUAL_SPEED] == pytest.approx(
                shown.speed, nan_ok=True
            )
            assert shown.frequency == 0.0
        # not with each poll: the mailbox is slow
        asked.clear()
        rig.pass_time(10.0)
        assert 15 <= len(asked) <= 21
        # what is not answered, or not asked for, is not known
        entry = entries.pop((1022, 0))
        rig.pass_time(10.0)
        assert math.isnan(rig.drive.snapshot.speed)
        entries[1022, 0] = entry
        rig.connect()
        rig.pass_time(10.0)
        assert math.isnan(rig.drive.snapshot.speed) != told
        rig.drive.settings = dataclasses.replace(rig.drive.settings, telemetry_rate=0.0)
        rig.pass_time(2.0)
        assert math.isnan(rig.drive.snapshot.speed)


#: Where current and power have 16 bits, and what is one there [M0 table 9], [M0 table 2].
NARROW = {G2: ((1120, 0.001), (1121, 1.0)), 'classic': ((0x95, 0.01), (0xD9, 1.0))}


@pytest.mark.parametrize('connection', NARROW)
@pytest.mark.parametrize(('nominal', 'true', 'told'), [
    # in range, in generator operation, at its end, and beyond it
    (1.5, 21000, True), (1.5, -1800, True), (1.5, 0x7FFF, False), (1.5, 36000, False),
    (22.0, 21000, True), (22.0, -1800, False), (22.0, 36000, False),
])
def test_current_and_power_of_16_bits_are_told_or_are_none(
    connection: str, nominal: float, true: int, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    (current, ampere), (power, watt) = NARROW[connection]
    raw = (true + 0x8000) % 0x10000 - 0x8000
    settings = {'motor.p_nom': nominal}
    with Rig(connection, parameters=settings, measured=['status.p_out']) as rig:
        # in generator operation a current is a current
        there = {current: abs(true) if true < 0 else raw, power: raw}
        if connection == G2:
            entries = rig.line.plc.channels[1].server.parameters.entries
            for pnu, number in there.items():
                entries[pnu, 0] = ParameterEntry(lambda number=number: number, signed=True)
        else:
            enquiry = rig.far.servers['classic'].enquiry

            def instead(id_: int) -> int:
                return there[id_] & 0xFFFF if id_ in there else enquiry(id_)

            monkeypatch.setattr(rig.far.servers['classic'], 'enquiry', instead)
        rig.connect()
        rig.wait_until(lambda: rig.notes.telemetry)
        shown = rig.notes.telemetry[0]
        amperes = abs(true) * ampere if told or true < 0 else math.nan
        watts = true * watt if told else math.nan
        found = shown.values[Role.OUTPUT_CURRENT], shown.values[Role.OUTPUT_POWER]
        assert found == pytest.approx((amperes, watts), nan_ok=True)
        assert shown.measured['status.p_out'] == pytest.approx(watts, nan_ok=True)
        for key, value in (('status.i_rms', amperes), ('status.p_out', watts)):
            assert rig.result(rig.drive.measure(key)) == pytest.approx(value, nan_ok=True)


# --- procedures: by SCMD, P1035, alone [M0 §7, table 10] ------------------------------------------

SCMD = (1035, 0)
TUNINGS = {
    Procedure.FULL: (0x201, '45 TuningOK'),
    Procedure.BASIC: (0x301, '45 TuningOK'),
    Procedure.STATOR_RESISTANCE: (0x401, '46 RsMeasOK'),
    Procedure.CALCULATE: (0x501, '47 ParClcOK'),
}


def commands_of(rig: Rig) -> list[int]:
    """Note what is written to SCMD from now on."""
    given: list[int] = []
    entries = rig.line.plc.channels[1].server.parameters.entries
    write = entries[SCMD].write

    def noted(raw: int) -> None:
        given.append(raw)
        write(raw)

    entries[SCMD] = dataclasses.replace(entries[SCMD], write=noted)
    return given


@pytest.mark.parametrize('procedure', TUNINGS)
def test_each_tuning_is_done_by_the_mailbox(procedure: Procedure) -> None:
    command, text = TUNINGS[procedure]
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        given = commands_of(rig)
        before = {key: rig.far.peek(key) for key in rig.far.settings}
        result = rig.result(rig.drive.tune(procedure), 120.0)
        assert result.success and text in said(result.how)
        assert given == [command]
        after = {key: rig.far.peek(key) for key in rig.far.settings}
        changed = {key: (before[key], after[key]) for key in after if before[key] != after[key]}
        assert changed
        assert {change.key: (change.old, change.new) for change in result.changes} == changed
        # and it can be enabled as before
        rig.turn(20.0)


def test_a_tuning_that_fails_is_told_with_the_name_of_its_fault() -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        rig.far.control_unit.fail_tuning(16)
        result = rig.result(rig.drive.tune(Procedure.FULL), 120.0)
        assert not result.success and '16 TunFailP' in said(result.how)
        rig.result(rig.drive.acknowledge())
        rig.turn(20.0)


def test_a_motor_that_is_tuned_is_not_told_to_be_stopped() -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        future = rig.drive.tune(Procedure.FULL)
        rig.wait_until(lambda: rig.far.control_unit.tuning is not None, 20.0)
        rig.pass_time(1.0)
        assert rig.drive.snapshot.text == 'Tuning'
        stop = rig.drive.stop()
        rig.wait_until(stop.done, 20.0)
        # no manual says that the drive takes it
        assert stop.exception() is not None and rig.far.control_unit.tuning is not None
        assert 'is NOT confirmed' in said(stop.exception())
        rig.wait_until(lambda: rig.far.control_unit.tuning is None, 60.0)
        rig.wait_until(future.done, 20.0)
        # then it is, and nothing turns before the next enable
        rig.pass_time(5.0)
        assert not rig.far.motor.driven
        rig.turn(20.0)


@pytest.mark.parametrize('state', ['silent', 'deaf', 'gone'])
def test_nothing_turns_by_a_tuning_whose_plc_was_lost(state: str) -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        future = rig.drive.tune(Procedure.FULL)
        rig.wait_until(lambda: rig.far.control_unit.tuning is not None, 20.0)
        rig.line.state = state
        rig.wait_until(future.done, 20.0)
        assert future.exception() is not None
        rig.pass_time(5.0)
        rig.line.mend()
        rig.wait_until(lambda: rig.far.control_unit.tuning is None, 60.0)
        rig.pass_time(5.0)
        assert not rig.turns
        rig.turn(20.0)


def test_log_and_counter_of_a_g2_are_cleared_by_the_mailbox() -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        given = commands_of(rig)
        rig.far.trip(5)
        rig.pass_time(2.0)
        rig.result(rig.drive.acknowledge())
        rig.pass_time(2.0)
        rig.far.control_unit.counters.energy = 1.25
        rig.result(rig.drive.erase_error_log())
        rig.result(rig.drive.reset_energy())
        assert not rig.far.faults.log and rig.far.control_unit.counters.energy < 0.1
        assert given == [0x800, 0x900]
        assert not rig.far.motor.driven


def test_without_a_mailbox_a_procedure_is_refused_with_that_reason() -> None:
    with Rig('telegram1 g2') as rig:
        rig.connect()
        rig.asked.clear()
        for begin in (
            lambda: rig.drive.tune(Procedure.FULL), rig.drive.erase_error_log,
            rig.drive.reset_energy,
        ):
            assert 'layout 1, which has no mailbox' in rig.answer(begin())
        assert not [data for _, _, data in rig.asked if data is not None]


# --- parameters by a user's own addresses ---------------------------------------------------------


OWN = ('drv.acc_time=1105h:0.1:s:rw', 'drv.max_freq=4356:0.01:Hz')


def test_parameters_of_a_sinus_h_are_those_that_the_user_names_by_address() -> None:
    with Rig(SINUS_H, drive_addresses=OWN) as rig:
        rig.connect(parameters=True)
        assert rig.drive.parameters.values == {
            'drv.acc_time': rig.far.peek('drv.acc_time'), 'drv.max_freq': 60.0
        }
        rig.answer(rig.drive.parameters.change({'drv.acc_time': 7.5}))
        assert rig.far.peek('drv.acc_time') == 7.5 and rig.far.writes['drv.acc_time'] == 1
        with raises(Cause.NO_SETTING):
            rig.result(rig.drive.parameters.change({'drv.max_freq': 50.0}))


@pytest.mark.parametrize('fate', ['unheard', 'drop'])
@pytest.mark.parametrize('at', range(1, 16, 2))
def test_a_loss_while_an_address_is_written_writes_it_no_second_time(fate: str, at: int) -> None:
    with Rig(SINUS_H, drive_addresses=OWN, poll_rate=1.0, telemetry_rate=0.0) as rig:
        rig.connect(parameters=True)
        requests = itertools.count()
        rig.line.plan = lambda frame: fate if next(requests) == at else None
        rig.answer(rig.drive.parameters.change({'drv.acc_time': 7.5}))
        assert next(requests) > at
        assert rig.far.peek('drv.acc_time') == 7.5 and rig.far.writes['drv.acc_time'] == 1


@pytest.mark.parametrize('at', [6, 10, 31, 37, 57])
def test_an_access_that_one_drive_has_begun_is_not_ended_in_another(at: int) -> None:
    with Rig(SINUS_H, drive_addresses=OWN, poll_rate=1.0, telemetry_rate=0.0) as rig:
        rig.connect(parameters=True)
        server = rig.line.plc.channels[1].server
        entries = server.parameters.entries
        written: list[int] = []
        requests = itertools.count()
        goes_on = math.inf

        def exchange() -> None:
            server._by_address[:] = [0x1104, 1234, 0, 0]
            for pnu in range(1000, 1004):
                entry = entries[pnu, 0]

                def write(word: int, pnu: int = pnu, entry: ParameterEntry = entry) -> None:
                    if rig.clock.now >= goes_on:
                        written.append(pnu)
                    assert entry.write is not None
                    entry.write(word)

                entries[pnu, 0] = dataclasses.replace(entry, write=write)

        def plan(frame: bytes) -> None:
            nonlocal goes_on
            if next(requests) == at:
                # the driver stands still while this is answered
                goes_on = rig.clock.now + 5.0
                rig.line.later(goes_on - 1.0, exchange)
                rig.line.stand_still(rig.clock.now, 5.0)

        rig.line.plan = plan
        rig.answer(rig.drive.parameters.change({'drv.acc_time': 7.5}))
        rig.pass_time(3.0)
        assert goes_on < math.inf and written[:1] in ([], [1000])


@pytest.mark.parametrize(('connection', 'key', 'settings'), [
    (G2, ACCEL, {}), (SINUS_H, 'drv.acc_time', {'drive_addresses': OWN}),
])
def test_what_is_watched_is_watched_again_after_the_driver_stood_still(
    connection: str, key: str, settings: dict[str, Any]
) -> None:
    with Rig(connection, telemetry_rate=2.0, lost_after=20.0, **settings) as rig:
        rig.connect(parameters=True)
        rig.drive.activate()
        requests = itertools.count(1)

        def plan(frame: bytes) -> None:
            # whatever is read just then
            if next(requests) % 11 == 0:
                rig.line.stand_still(rig.clock.now, 5.0)

        rig.line.plan = plan
        rig.pass_time(200.0)
        rig.line.plan = lambda frame: None
        assert next(requests) > 200
        before = len(rig.notes.telemetry)
        rig.far.set_from_keypad(key, 9.0)
        rig.pass_time(60.0)
        assert len(rig.notes.telemetry) > before + 60
        assert rig.drive.parameters.values[key] == 9.0


def test_an_address_that_the_drive_lacks_is_reported() -> None:
    with Rig(SINUS_H, drive_addresses=(*OWN, 'drv.none=1')) as rig:
        rig.connect(parameters=True)
        assert rig.notes.said('drv.none cannot be read: the drive refused the access to its addr')
        assert len(rig.drive.parameters.values) == 2


@pytest.mark.parametrize(
    ('text', 'why'),
    [
        ('drv.acc_time', 'write group.name=ADDRESS'),
        ('acc_time=1105h', 'write group.name=ADDRESS'),
        ('drv.acc_time=1105h:0', 'the factor is not 0'),
        ('drv.acc_time=10000h', 'not this address'),
        ('drv.command=0382h:1::rw', 'not this address'),
        ('drv.word=047Fh:1::rw', 'not this address'),
        ('fieldbus.x=1', 'or not this group'),
        ('telegram.torque=1', 'already'),
    ],
)
def test_what_cannot_be_an_address_is_refused(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=f'drive_addresses: .*{why}'):
        DriveSettings(model='sinus_h', drive_addresses=(text,))
    with pytest.raises(ValueError, match='no manual says'):
        DriveSettings(model='sinus_optimal', drive_addresses=('drv.acc_time=1105h',))


# --- what it does not have ------------------------------------------------------------------------


def test_layout_1_goes_on_and_says_what_it_lacks() -> None:
    with Rig('telegram1 g2') as rig:
        rig.connect(parameters=True)
        assert rig.notes.said(Cause.NO_MAILBOX, Severity.INFO)
        assert rig.notes.said('layout 1, which has no mailbox')
        assert not rig.drive.parameters.values
        rig.enable()
        rig.far.trip(3)
        rig.pass_time(3.0)
        assert rig.drive.snapshot.status.code == 191


def test_a_plc_without_access_to_parameters_is_no_reason_not_to_connect() -> None:
    rig = Rig(G2)
    rig.line.plc.channels[1].server.parameters = None
    with rig:
        rig.connect(parameters=True)
        assert rig.notes.said(Cause.NO_MAILBOX, Severity.WARNING)
        assert rig.notes.said('FB_RosParameter')
        rig.enable()
        rig.send(20.0)
        rig.pass_time(1.5)
        assert rig.turns


# --- nothing waits for it -------------------------------------------------------------------------


@pytest.mark.parametrize('apart', [False, True])
def test_stop_and_polls_wait_for_no_answer_of_the_mailbox(apart: bool) -> None:
    with plc(access_time=0.02, write_and_read=not apart) as rig:
        rig.turn()
        rig.line.plc.channels[1].records._seconds = 30.0
        pending = rig.drive.parameters.change({ACCEL: 9.0})
        rig.pass_time(0.3)
        polls = len(rig.notes.snapshots)
        rig.pass_time(0.5)
        assert len(rig.notes.snapshots) - polls >= 4
        began = rig.clock.now
        answer = rig.answer(rig.drive.stop())
        assert 'stop' in answer and rig.clock.now - began < 0.5
        assert not rig.turns
        with raises(Cause.NOT_CHANGED):
            rig.result(pending)


def test_life_counter_goes_on_while_settings_are_read() -> None:
    with Rig(G2) as rig:
        rig.turn()
        reading = rig.drive.parameters.read()
        rig.wait_until(reading.done)
        assert rig.turns and rig.drive.following


@pytest.mark.parametrize('outage', [0.1, 0.6, 3.0])
@pytest.mark.parametrize('at', range(6))
def test_a_line_cut_in_the_middle_of_a_request_loses_nothing_and_blocks_no_stop(
    at: int, outage: float
) -> None:
    with Rig(G2, line={'response_timeout': 0.2}) as rig:
        rig.connect(parameters=True)
        rig.enable()
        rig.send(20.0)
        rig.pass_time(1.5)
        asked = rig.drive.parameters.change({ACCEL: 9.0})
        before = len(rig.line.frames)

        def cut() -> bool:
            return requests_to_mailbox(rig, before) > at or asked.done()

        rig.wait_until(cut)
        rig.line.state = 'silent'
        rig.pass_time(outage)
        stopped = rig.drive.stop()
        rig.pass_time(0.1)
        rig.line.mend()
        rig.answer(stopped)
        rig.wait_until(lambda: not rig.far.motor.driven, 3.0)
        rig.wait_until(asked.done)
        # the drive has one of the two, and the driver knows which
        rig.wait_until(lambda: rig.drive.state.contact.connected)
        assert rig.far.writes[ACCEL] <= 2
        rig.wait_until(lambda: rig.drive.parameters.values[ACCEL] == rig.far.peek(ACCEL), 90.0)
        rig.answer(rig.drive.parameters.change({ACCEL: 11.0}))
        assert rig.far.peek(ACCEL) == 11.0


def requests_to_mailbox(rig: Rig, since: int) -> int:
    """Return how many requests were sent to the mailbox."""
    sent = [frame for frame in list(rig.line.frames)[since:] if frame['direction'] == 'request']
    data = [bytes.fromhex(frame['hex']) for frame in sent]
    return sum(int.from_bytes(request[8:10], 'big') >= 16 for request in data)


def test_what_the_mailbox_asks_writes_no_word_to_the_drive() -> None:
    with Rig(G2) as rig:
        rig.connect(parameters=True)
        rig.pass_time(2.0)
        assert not words(rig.line.frames)
