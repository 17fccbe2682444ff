# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Set-points: what one is in each control mode, its limits, and the drive's own time-out."""

from __future__ import annotations

from dataclasses import dataclass, replace
import math

import pytest
from support.rig import Rig

from nfo_sinus_driver.catalog import Fact
from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.drive.known.settings import AS_THE_DRIVE_CAN


@dataclass(frozen=True)
class Quantity:
    """
    What one control mode controls.

    :ivar steps: of the drive in one unit.
    :ivar most: its limit [M2 table 2].
    :ivar value: a set-point that is soon reached.
    :ivar nominal: what the simulated motor is made for; 0: nothing says it.
    """

    unit: str
    steps: int
    most: float
    value: float
    nominal: float = 0.0


MODES = {
    'Freque': Quantity('Hz', 10, 150, 20, nominal=50),
    'Speed': Quantity('rpm', 1, 9000, 600, nominal=1440),
    'Torque': Quantity('%', 1, 200, 10, nominal=100),
    'PI-Reg': Quantity('bar', 10, 150, 40),
}
BOTH = ['rtu', 'rtu, control word']
both_methods = pytest.mark.parametrize('connection', BOTH)
every_mode = pytest.mark.parametrize(
    ('connection', 'mode'),
    [
        *((name, mode) for name in BOTH for mode in MODES),
        ('optimal', 'Freque'),
        ('optimal', 'Speed'),
    ],
)


def enabled(connection: str, mode: str, **settings: float) -> Rig:
    """An enabled drive in a control mode; of an Optimal the driver has to be given it."""
    unit = {} if connection == 'optimal' else {'pi_reg.unit': 'bar'}
    parameters = {'control.mode': mode, **unit}
    rig = Rig(connection, expected_control_mode=mode, parameters=parameters, **settings)
    rig.connect()
    rig.enable()
    return rig


def in_drive(rig: Rig, mode: str) -> float:
    """What stands in the drive, in the unit of the mode; its sign may be a direction."""
    control = rig.far.control_unit
    directed = rig.connection.method == 'drive_control' and mode != 'PI-Reg'
    sign = control.machine.direction if directed else 1
    return sign * rig.far.memory.raw(control.setpoint_key) / MODES[mode].steps


def facts(rig: Rig) -> Fact:
    status = rig.drive.snapshot.status
    return Fact(0) if status is None else status.facts


def assert_turns(rig: Rig, mode: str, value: float) -> float:
    """The motor turns at a set-point, and what is published has its unit; return what it shows."""
    turns = rig.far.motor.torque if mode == 'Torque' else rig.far.motor.frequency
    assert turns * value > 0
    # of PI-Reg it is RegAct; the simulated process has no sign
    actual = abs(value) if mode == 'PI-Reg' else value
    snapshot = rig.drive.snapshot
    assert snapshot.actual == pytest.approx(actual, rel=0.07, abs=1.0)
    assert (snapshot.control_mode, snapshot.unit) == (mode, MODES[mode].unit)
    return actual


@every_mode
def test_unit_sign_and_reached(connection: str, mode: str) -> None:
    with enabled(connection, mode) as rig:
        for value in (MODES[mode].value, -MODES[mode].value):
            # so slow that it is seen on its way
            rig.far.memory.set('control.accel', 20.0)
            rig.send(value)
            rig.pass_time(0.4)
            assert in_drive(rig, mode) == rig.drive.snapshot.setpoint == value
            # a torque is there at once, a speed needs its ramp
            assert (Fact.SETPOINT_REACHED in facts(rig)) == (mode == 'Torque')
            rig.far.memory.set('control.accel', 0.2)
            rig.pass_time(2.0)
            assert Fact.SETPOINT_REACHED in facts(rig)
            assert_turns(rig, mode, value)
            assert not rig.drive.snapshot.setpoint_clamped


@pytest.mark.parametrize('mode', MODES)
def test_older_firmware_has_one_set_point_whose_unit_and_steps_are_those_of_its_mode(
    mode: str,
) -> None:
    # E001E [M2 table 2]
    with enabled('classic v5.0', mode) as rig:
        for value in (MODES[mode].value, -MODES[mode].value):
            rig.send(value)
            rig.pass_time(4.0)
            assert rig.written('fieldbus.setpoint')[-1] == MODES[mode].steps * value
            assert in_drive(rig, mode) == rig.drive.snapshot.setpoint == value
            actual = assert_turns(rig, mode, value)
        key = 'status.reg_act'
        if mode == 'PI-Reg':
            assert rig.notes.telemetry[-1].measured[key] == pytest.approx(actual, rel=0.07)


@pytest.mark.parametrize('mode', MODES)
def test_over_classic_one_parameter_takes_the_set_point_of_every_mode(mode: str) -> None:
    # E001E, which the drive redirects by its Mode [M0 table 3]
    with enabled('classic', mode) as rig:
        rig.send(MODES[mode].value)
        rig.pass_time(2.0)
        raw = MODES[mode].value * MODES[mode].steps
        assert rig.written('fieldbus.setpoint')[-1] == raw
        assert b'\x04!\x02E001E=%04X\x03' % raw in {
            bytes.fromhex(frame['hex'])[:-1] for frame in rig.line.frames
        }
        assert rig.far.memory.raw(rig.far.control_unit.setpoint_key) == raw
        snapshot = rig.drive.snapshot
        assert (snapshot.control_mode, snapshot.unit) == (mode, MODES[mode].unit)
        assert snapshot.actual == pytest.approx(MODES[mode].value, rel=0.07, abs=1.0)


def test_a_set_point_is_rounded_to_a_step_of_the_drive() -> None:
    for mode, value, raw in (('Freque', 12.34, 123), ('Speed', -600.4, -600)):
        with enabled('rtu', mode) as rig:
            rig.send(value)
            rig.pass_time(0.3)
            # what is shown is what the drive was given
            assert in_drive(rig, mode) == rig.drive.snapshot.setpoint == raw / MODES[mode].steps


@pytest.mark.parametrize('ends', [(0.0, 1000.0), (1000.0, 0.0), (-50.0, 400.0), (0.0, 0.0)])
def test_a_process_set_point_lies_between_setmin_and_setmax(ends: tuple[float, float]) -> None:
    # in the unit of the process, such as 400 kPa [C113]
    setmin, setmax = ends
    process = {
        'control.mode': 'PI-Reg', 'pi_reg.unit': 'kPa',
        'pi_reg.setmin': setmin, 'pi_reg.setmax': setmax,
    }
    with Rig(parameters=process, setpoint_timeout=0.0).connect() as rig:
        rig.enable()
        low, high = sorted(ends) if setmin != setmax else (-2000.0, 2000.0)
        for value in (400.0, high + 100.0, low - 100.0):
            rig.drive.set_setpoint(value)
            rig.pass_time(0.3)
            limited = max(low, min(high, value))
            assert rig.far.memory.number('status.reg_set') == limited
            assert rig.drive.snapshot.setpoint == limited
            assert rig.drive.snapshot.setpoint_clamped == (value != limited)
        # and setpoint_max counts where it is less
        rig.drive.settings = replace(rig.drive.settings, setpoint_max=50.0)
        rig.drive.set_setpoint(380.0)
        rig.pass_time(0.3)
        assert rig.drive.snapshot.setpoint == 50.0


@every_mode
def test_limits(connection: str, mode: str) -> None:
    quantity = MODES[mode]
    # an Optimal tells no nominal value, and no process has any; 400 Hz may have been meant as rpm
    nominal = quantity.nominal if connection != 'optimal' and quantity.nominal else quantity.most
    less = quantity.value / 2
    for most, limit in ((0.0, nominal), (less, less), (2 * quantity.most, quantity.most)):
        with enabled(connection, mode, setpoint_max=most) as rig:
            for wanted in (1e6, -1e30):
                rig.send(wanted)
                rig.pass_time(0.4)
                assert rig.drive.snapshot.setpoint == math.copysign(limit, wanted)
                assert rig.drive.snapshot.setpoint_clamped
                assert in_drive(rig, mode) == math.copysign(limit, wanted)
            rig.send(limit)
            rig.pass_time(0.3)
            assert rig.drive.snapshot.setpoint == limit
            assert not rig.drive.snapshot.setpoint_clamped
            # said once, not with every message
            texts = [event.text for event in rig.notes.events if 'is limited to' in event.text]
            assert len(texts) == 1, texts
            assert texts[0].startswith(f'set-point 1e+06 is limited to {limit:g}')


def test_the_newest_set_point_counts_and_what_is_no_number_is_none() -> None:
    with enabled('rtu', 'Freque') as rig:
        for value in (10.0, 30.0, 20.0):
            rig.drive.set_setpoint(value)
        for value in (math.nan, math.inf, -math.inf):
            with pytest.raises(ValueError, match='is no number'):
                rig.drive.set_setpoint(value)
        rig.pass_time(0.4)
        assert rig.drive.snapshot.setpoint == 20.0
        assert not rig.notes.said(Cause.SETPOINT_LIMITED, Severity.WARNING)


# --- the control mode changes ---------------------------------------------------------------------


@both_methods
@pytest.mark.parametrize(
    ('before', 'after'),
    [('Freque', 'Speed'), ('Speed', 'Torque'), ('Torque', 'PI-Reg'), ('PI-Reg', 'Freque')],
    ids='-'.join,
)
def test_mode_that_is_changed_at_the_keypad_ends_the_enable(
    connection: str, before: str, after: str
) -> None:
    with enabled(connection, before) as rig:
        rig.send(MODES[before].value)
        rig.pass_time(1.0)
        rig.far.set_from_keypad('control.mode', after)
        first = len(rig.notes.snapshots)
        rig.pass_time(8.0)
        assert not rig.far.motor.driven
        later = rig.notes.snapshots[first:]
        snapshots = [snapshot for snapshot in later if snapshot.control_mode == after]
        # everywhere at once: no set-point of the one mode ever has the unit of the other
        assert {snapshot.unit for snapshot in snapshots} == {MODES[after].unit}
        assert not any(snapshot.enabled for snapshot in snapshots)
        assert all(math.isnan(snapshot.setpoint) for snapshot in snapshots)
        (text,) = [event.text for event in rig.notes.events if 'control mode' in event.text]
        assert f'the control mode was changed to {after} at the drive' in text
        assert f'set-points are in {MODES[after].unit} now: check what sends them' in text
        assert text.endswith('call ~/enable to go on')
        # what it was enabled for does not hold any more
        message = rig.answer(rig.drive.enable())
        assert message.startswith(f'the drive is in control mode {after}, expected is {before}')


@both_methods
def test_mode_that_we_change_has_its_unit_at_once(connection: str) -> None:
    with Rig(connection).connect(parameters=True) as rig:
        rig.enable()
        # a motor that is enabled is driven, and a drive changes its mode at standstill only
        change = {'control.mode': 'Speed'}
        assert 'control.mode' in rig.answer(rig.drive.parameters.change(change))
        assert rig.drive.following
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        frequencies = rig.written('status.frq_set')
        rig.result(rig.drive.parameters.change(change))
        rig.pass_time(0.1)
        assert rig.drive.snapshot.unit == 'rpm'
        rig.enable()
        rig.send(300.0)
        rig.pass_time(0.3)
        assert in_drive(rig, 'Speed') == 300.0
        assert rig.written('status.frq_set') == frequencies


@both_methods
def test_mode_that_was_changed_at_a_standstill_is_found_by_enable(connection: str) -> None:
    with Rig(connection).turn() as rig:
        rig.answer(rig.drive.stop())
        rig.send(None)
        rig.pass_time(1.0)
        rig.far.memory.set('control.mode', 'Speed')
        frequencies = rig.written('status.frq_set')
        rig.enable()
        rig.send(20.0)
        rig.pass_time(0.3)
        assert rig.far.memory.raw('status.spd_set') == 20
        assert rig.written('status.frq_set') == frequencies


# --- the drive's own time-out ---------------------------------------------------------------------

TOT, STOP = 'serial.sio_tot', 'serial.auto_stop'
def timeouts(rig: Rig) -> tuple[int, int]:
    """SioTot (tenths of a second) and AutoStop in the drive."""
    return rig.far.memory.raw(TOT), rig.far.memory.raw(STOP)


def test_drive_timeout_is_set() -> None:
    with Rig(drive_timeout=2.5).connect() as rig:
        assert timeouts(rig) == (0, 0) and not rig.notes.said(Cause.OWN_TIMEOUT_OFF)
        rig.enable()
        assert timeouts(rig) == (25, 1)
        assert [rig.far.writes[key] for key in (TOT, STOP)] == [1, 1]
        assert rig.notes.said('serial.sio_tot: 0 -> 2.5 s (drive_timeout)')
        assert rig.notes.said('serial.auto_stop: false -> true (drive_timeout)')
        assert rig.notes.said('the drive stops the motor after 2.5 s (SioTot)', Severity.INFO)
        # parameters live in EEPROM: what is right is not written again
        assert rig.result(rig.drive.set_drive_timeout(2.5)) == ()
        (change,) = rig.result(rig.drive.set_drive_timeout(3.0))
        assert str(change) == 'serial.sio_tot: 2.5 -> 3 s'
        assert [rig.far.writes[key] for key in (TOT, STOP)] == [2, 1]


def test_a_time_out_that_is_to_stay_as_it_is_is_a_decision_that_is_said_once() -> None:
    for found, cause, severity in (
        (0.0, Cause.OWN_TIMEOUT_OFF, Severity.WARNING),
        (5.0, Cause.OWN_TIMEOUT_KEPT, Severity.INFO),
    ):
        with Rig(parameters={TOT: found, STOP: True}, drive_timeout=0.0) as rig:
            rig.connect()
            rig.far.power_cycle()
            rig.pass_time(10.0)
            rig.enable()
            said = [event for event in rig.notes.events if 'drive_timeout' in event.text]
            (event,) = said
            assert (event.severity, cause in event.text.causes) == (severity, True)
            assert 'drive_timeout' in said[0].text and ' 0' in said[0].text
            assert timeouts(rig) == (10 * found, 1)


def test_the_default_follows_what_lost_after_asks_for() -> None:
    with Rig(parameters={STOP: True}, drive_timeout=AS_THE_DRIVE_CAN) as rig:
        rig.connect()
        found = []
        for lost_after in (1.0, 3.0, 1.0):
            rig.drive.settings = replace(rig.drive.settings, lost_after=lost_after)
            rig.enable()
            rig.answer(rig.drive.stop())
            found.append(timeouts(rig))
        assert found == [(20, 1), (35, 1), (20, 1)]
        # a time that is asked for stays in the drive, and one that was not does not
        rig.answer(rig.drive.disconnect(4.0))
        assert timeouts(rig) == (0, 1)


def test_a_time_out_of_the_drive_that_strikes_before_it_is_lost_is_said() -> None:
    with Rig(parameters={TOT: 1.2, STOP: True}).connect() as rig:
        assert rig.notes.said('SioTot 1.2 s) is less than lost_after + 0.5 s', Severity.WARNING)
        assert rig.notes.said('set drive_timeout, at least 1.5 s', Severity.WARNING)


def test_a_drive_timeout_that_is_not_taken_leaves_what_was_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with Rig(parameters={TOT: 7.0}).connect() as rig:
        rig.spoil('refused', STOP)
        # 0 leaves it as it is
        assert rig.result(rig.drive.set_drive_timeout(0.0)) == () and not rig.far.writes
        assert 'exception 4' in rig.answer(rig.drive.set_drive_timeout(2.0))
        assert timeouts(rig) == (70, 0)
        store = rig.far._store
        monkeypatch.setattr(
            rig.far, '_store', lambda key, raw: store(key, max(raw, 50) if key == TOT else raw)
        )
        assert rig.answer(rig.drive.set_drive_timeout(2.0)) == (
            'serial.sio_tot: the drive keeps 5 s where 2 s was written; it is 7 s as before'
        )
        assert timeouts(rig) == (70, 0)


def test_drive_timeout_that_no_manual_allows() -> None:
    # the register holds up to 6553.5 s; the driver must cope with what it reads
    with Rig(drive_timeout=2.0) as rig:
        rig.far.memory.put(TOT, 300)
        rig.connect()
        rig.enable()
        assert timeouts(rig) == (20, 1)
