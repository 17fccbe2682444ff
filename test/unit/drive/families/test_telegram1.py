# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Telegram 1: what an Optimal, a Sinus H and a G2 behind a PLC do that no other connection does."""

from __future__ import annotations

import math
from typing import Any

import pytest
from support import telegram_laws
from support.rig import Rig
from support.telegram_laws import words

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.catalog.status import Fact, State
from nfo_sinus_driver.drive import Drive, DriveSettings
from nfo_sinus_driver.link import LineSettings, open_link

OPTIMAL, SINUS_H, G2 = 'telegram1 optimal', 'telegram1 sinus_h', 'telegram1 g2'
BY_DRIVECONTROL = 'telegram1 g2, drivecontrol'
#: STW1 from the first word to the run command, and of a stop, as the manuals' tables have it.
ENABLING = {
    OPTIMAL: [0x0400, 0x0408, 0x0409],
    SINUS_H: [0x0476, 0x0477, 0x047F],
    G2: [0x0476, 0x0477, 0x047F],
    BY_DRIVECONTROL: [0xC077, 0xC07F],
}
STOPPED = {OPTIMAL: 0x0408, SINUS_H: 0x0477, G2: 0x047E, BY_DRIVECONTROL: 0xC076}
#: What a motor that stands is left with.
LEFT = {OPTIMAL: 0x0400, SINUS_H: 0x0476, G2: 0x0476}
every_family = pytest.mark.parametrize('connection', (OPTIMAL, SINUS_H, G2))


def plc(connection: str, **setting: Any) -> Rig:
    """Return a drive behind a PLC that is programmed so."""
    return Rig(connection, line={'plc': setting, 'response_timeout': 1.0})


# --- the words, and what they mean ----------------------------------------------------------------


@pytest.mark.parametrize('connection', ENABLING)
def test_a_motor_is_enabled_and_stopped_by_the_words_of_the_manual(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        said = words(rig.line.frames)
        assert said[-len(ENABLING[connection]) :] == ENABLING[connection]
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        assert words(rig.line.frames)[-1] == STOPPED[connection]


@every_family
def test_an_exit_leaves_the_word_of_a_motor_that_stands(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.answer(rig.drive.stop_for_good(4.0))
        assert not rig.far.motor.driven and words(rig.line.frames)[-1] == LEFT[connection]


@every_family
def test_status_and_direction_are_those_of_the_motor(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.enable()
        for wanted in (0.0, 15.0, -15.0, 10.0):
            rig.send(wanted)
            rig.pass_time(1.5)
            # a Sinus H takes no reverse by its telegram
            turns = 0.0 if wanted < 0 and connection == SINUS_H else wanted
            assert rig.far.motor.frequency == pytest.approx(turns, abs=0.2)
            assert rig.drive.snapshot.frequency == pytest.approx(turns, abs=0.2)
            assert rig.drive.snapshot.actual == pytest.approx(turns, abs=0.5)
            status = rig.drive.snapshot.status
            # of a G2, pulses enabled is no stop [C111]
            assert status is not None and status.state is State.OPERATION_ENABLED
            assert Fact.OPERATION_ENABLED in status.valid & status.facts
            assert Fact.REVERSE in status.valid
            if turns:
                assert (Fact.REVERSE in status.facts) == (turns < 0)
        assert rig.notes.said('set-point -15 is limited to 0') == (connection == SINUS_H)
        assert math.isnan(rig.drive.snapshot.speed)
        lacks = 'not documented' if connection == OPTIMAL else 'layout 1, which has no mailbox'
        assert lacks in rig.answer(rig.drive.error_log())


def test_pulses_enabled_is_shown_in_the_status_word_of_a_g2_and_is_no_stop() -> None:
    # P924: bit 15 of ZSW1 [M0 table 8]; of DriveStatus it would say that the drive stops
    with Rig(G2) as rig:
        rig.connect()
        rig.enable()
        rig.send(20.0)
        rig.pass_time(1.5)
        status = rig.drive.snapshot.status
        assert status is not None and status.shown_word & 0x8000
        assert status.state is State.OPERATION_ENABLED and Fact.STOPPING not in status.facts
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        status = rig.drive.snapshot.status
        assert status is not None and not status.shown_word & 0x8000


#: 750 rpm in the block: by 8192 for 1500 on an Optimal [M1]; counts of SpdSet [M0 §6.3 table 9].
BLOCK_AT_750 = {'telegram1 optimal, speed': 4096, 'telegram1 g2, speed': 750}


@pytest.mark.parametrize('connection', BLOCK_AT_750)
def test_in_speed_mode_the_telegram_has_speeds(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.enable()
        for rpm in (750, -750):
            rig.send(rpm / 30)
            rig.pass_time(1.5)
            last = list(telegram_laws.exchanges(rig.line.frames, 1))[-1].setpoint
            assert last == math.copysign(BLOCK_AT_750[connection], rpm) % 0x10000
            assert rig.far.motor.speed == pytest.approx(rpm, abs=3)
            snapshot = rig.drive.snapshot
            assert (snapshot.control_mode, snapshot.unit) == ('Speed', 'rpm')
            assert snapshot.setpoint == rpm
            assert snapshot.actual == snapshot.speed == pytest.approx(rpm, abs=3)
            # nothing tells how many Hz they are
            assert math.isnan(snapshot.frequency)
        rig.send(60.0)
        rig.pass_time(1.0)
        assert rig.notes.said('set-point 1800 is limited to 1500 rpm, which is nominal')
        assert rig.far.motor.speed == pytest.approx(1500, abs=5)
        assert rig.answer(rig.drive.stop()) == 'stopping: it ramps down'
        rig.pass_time(1.5)
        assert rig.drive.snapshot.speed == 0 and not rig.far.motor.driven


@pytest.mark.parametrize('model', ['sinus_optimal', 'sinus_g2'])
def test_speed_mode_of_a_telegram_needs_the_nominal_speed(model: str) -> None:
    chosen = {'model': model, 'control_method': 'telegram1', 'expected_control_mode': 'Speed'}
    with pytest.raises(ValueError, match='set nominal_speed first, in rpm, such as 1500'):
        DriveSettings(**chosen)
    settings = DriveSettings(nominal_speed=1500.0, **chosen)
    connection = f'telegram1 {model.removeprefix("sinus_")}'
    with Rig(connection) as rig, pytest.raises(ValueError, match='cannot change within a session'):
        rig.drive.state.use(settings)
    # over Modbus both read it, and a Sinus H has no such mode
    DriveSettings(model=model, expected_control_mode='Speed')
    with pytest.raises(ValueError, match="expected_control_mode 'Speed'"):
        DriveSettings(model='sinus_h', expected_control_mode='Speed', nominal_speed=1500.0)


@every_family
def test_a_drive_without_nominal_values_has_its_own_limit(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.enable()
        rig.send(1000.0)
        rig.pass_time(0.5)
        most = 327.67 if connection == SINUS_H else 150
        assert rig.notes.said(f'set-point 1000 is limited to {most:g} (setpoint_max, or')
        assert rig.turns


@every_family
def test_each_word_stands_until_the_drive_has_had_it(connection: str) -> None:
    with plc(connection, exchange=0.1) as rig:
        rig.connect()
        channel = rig.line.plc.channels[1]
        given: set[int] = set()
        exchange = channel.exchange

        def noted(now: float) -> None:
            given.add(channel.program.stw1)
            exchange(now)

        channel.exchange = noted
        for _ in range(3):
            rig.enable()
            rig.send(20.0)
            rig.pass_time(1.0)
            rig.answer(rig.drive.stop())
            rig.pass_time(1.0)
        rig.enable()
        rig.far.trip(12)
        rig.pass_time(1.0)
        rig.answer(rig.drive.acknowledge())
        rig.pass_time(1.0)
        assert len(given) > 3 and set(words(rig.line.frames)) <= given


# --- stops ----------------------------------------------------------------------------------------


@every_family
def test_a_stop_is_confirmed_by_the_first_status_after_it(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        stops = len(rig.written('telegram.clear'))
        # what the PLC shows at first is from before the stop, and none is written twice for that
        for _ in range(10):
            rig.result(rig.drive.stop())
        assert len(rig.written('telegram.clear')) == stops + 10


@every_family
@pytest.mark.parametrize('command', ['stop', 'quick_stop'])
def test_what_a_plc_goes_on_showing_confirms_no_stop(connection: str, command: str) -> None:
    with Rig(connection, lost_after=10.0) as rig:
        rig.turn()
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        # its registers are answered, and show a drive that stands
        rig.line.plc.stopped_until = math.inf
        rig.pass_time(0.2)
        assert 'NOT confirmed' in rig.answer(getattr(rig.drive, command)())
        assert rig.drive.stop_unconfirmed
        rig.line.plc.stopped_until = rig.clock.now
        rig.pass_time(1.0)
        assert not rig.drive.stop_unconfirmed


@pytest.mark.parametrize('echo_bits', ['state', 'word'])
def test_quick_stop_releases_a_sinus_h(echo_bits: str) -> None:
    ramp = {'adv.stop_mode': 'Dec', 'drv.dec_time': 10.0}
    with Rig(SINUS_H, parameters=ramp, options={'echo_bits': echo_bits}) as rig:
        rig.turn()
        assert rig.answer(rig.drive.quick_stop()) == 'released: the motor coasts'
        # bit 1 alone is removed from SwitchOFF: out of S4 to S1 [M3 §6]
        assert words(rig.line.frames)[-1] == 0x0474
        assert rig.far.control_unit.report()['state'] == 'S1'
        assert not rig.far.motor.driven and rig.far.motor.turning
        rig.pass_time(12.0)
        rig.assert_only_enable_helps()


@pytest.mark.parametrize(
    ('stop_mode', 'answer'),
    [
        ('Dec', 'stopping: by its stop ramp (202 Inhibited)'),
        ('Free-Run', 'stopped (202 Inhibited)'),
    ],
)
@pytest.mark.parametrize('echo_bits', ['state', 'word'])
def test_rapid_stop_of_a_sinus_h_is_adv_8(stop_mode: str, answer: str, echo_bits: str) -> None:
    ramp = {'adv.stop_mode': stop_mode, 'drv.dec_time': 10.0}
    with Rig(SINUS_H, parameters=ramp, options={'echo_bits': echo_bits}) as rig:
        rig.turn()
        assert rig.answer(rig.drive.rapid_stop()) == answer
        # bit 2 alone is removed from SwitchOFF: out of S4 to S1 [M3 §6]
        assert words(rig.line.frames)[-1] == 0x0472
        assert rig.far.control_unit.report()['state'] == 'S1'
        assert rig.far.motor.driven == (stop_mode == 'Dec')
        rig.pass_time(12.0)
        assert not rig.far.motor.driven
        rig.assert_only_enable_helps()


def test_a_sinus_h_that_ignores_its_stops_is_released() -> None:
    with Rig(SINUS_H) as rig:
        rig.turn()
        machine = rig.far.control_unit.machine
        for exit in [exit for exit in machine._exits if exit[1].name != 'COAST_STOP']:
            machine._exits.pop(exit)
        assert 'NOT confirmed' in rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.far.motor.driven, 15.0)
        assert 0x0474 in words(rig.line.frames)
        rig.pass_time(1.0)
        assert not rig.drive.stop_unconfirmed and rig.notes.said('a normal stop had no effect')


@every_family
def test_a_stop_is_the_next_word_in_the_block(connection: str) -> None:
    run = telegram_laws.JUDGES[Rig(connection).connection.model].run
    # more is always waiting for its turn
    with Rig(connection, telemetry_rate=50.0, line={'plc': {'answer_time': (0.05, 0.05)}}) as rig:
        rig.connect()
        rig.pass_time(1.0)
        for moment in range(5):
            rig.enable()
            rig.send(20.0)
            rig.pass_time(1.0 + 0.017 * moment)
            before = len(rig.line.frames)
            rig.answer(rig.drive.stop())
            rig.send(None)
            said = telegram_laws.exchanges(rig.line.frames[before:], 1)
            assert not next(said).stw1 & run
            rig.pass_time(1.0)


# --- PLCs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    'setting', [{'answer_time': (0.05, 0.25)}, {'write_and_read': False}], ids=['slow', 'no 23']
)
def test_a_plc_that_is_slow_or_has_no_function_23_is_used(setting: dict[str, Any]) -> None:
    with plc(SINUS_H, **setting) as rig:
        rig.connect()
        rig.pass_time(3.0)
        rig.turn()
        assert 'stop' in rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        assert not rig.turns and not rig.drive.stop_unconfirmed


def test_without_the_release_of_the_plc_nothing_turns() -> None:
    with plc(SINUS_H, released=False) as rig:
        channel = rig.line.plc.channels[1]
        rig.connect()
        assert 'has not released the drive to ROS' in rig.answer(rig.drive.enable())
        channel.released = True
        rig.pass_time(1.0)
        rig.turn()
        channel.released = False
        rig.pass_time(1.0)
        assert rig.notes.said('the PLC has withdrawn its release to ROS')
        assert not rig.turns
        channel.released = True
        rig.pass_time(1.0)
        rig.assert_only_enable_helps()


def test_the_plc_stops_the_motor_when_the_driver_is_gone() -> None:
    with Rig(SINUS_H, lost_after=2.0, drive_timeout=3.0) as rig:
        said = rig.answer(rig.drive.connect())
        assert 'the PLC watches this driver, and stops the motor 1 s after its last word' in said
        assert not words(rig.line.frames)
    with Rig(SINUS_H) as rig:
        rig.turn()
        rig.kill()
        rig.line.go_to(rig.clock.now + 2.0)
        assert not rig.turns


def test_a_driver_that_only_watches_writes_nothing() -> None:
    # the others are watched on their own line
    with Rig(SINUS_H, control_method='monitor') as rig:
        rig.connect()
        rig.pass_time(2.0)
        assert len(rig.notes.snapshots) > 5 and not words(rig.line.frames)


def test_each_drive_has_its_own_block() -> None:
    blocks = {'plc': {'blocks': ((1, 0), (2, 20))}}
    with Rig(SINUS_H, drives=2, own={2: {'block_address': 20}}, line=blocks) as rig:
        rig.connect()
        rig.enable(2)
        rig.send(12.0, 2)
        rig.pass_time(2.0)
        assert rig.fars[2].motor.frequency > 11.5
        assert not rig.fars[1].motor.driven and not rig.drives[1].following
        assert not telegram_laws.violations(rig.line.frames, 'sinus_h', 2, 20)


def test_a_line_that_has_no_plc_is_refused() -> None:
    link = open_link('modbus_rtu', '/dev/x', LineSettings())
    with pytest.raises(ValueError, match='needs another line: set protocol to modbus_tcp'):
        Drive(Bus(link), DriveSettings(model='sinus_h'), None)
