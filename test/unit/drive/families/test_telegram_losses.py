# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Telegram 1: no motor goes on by itself after a loss, on PLCs of any speed, drives of either kind.

A drive may take its commands by edges or by levels, as far as its manual allows, and the PLC may
exchange telegrams with it faster or slower than the driver asks.
"""

from __future__ import annotations

from collections.abc import Callable
import itertools

import pytest
from support.examples import FULL
from support.rig import CONNECTIONS, Rig
from support.telegram_laws import words
from support.variants import ramps

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.link.plc.telegram import PLC_TIME
from nfo_sinus_driver.simulator.plc import Channel, Plc

#: Of each family: the option by which a drive goes on by what stands in a telegram.
LEVELS = {
    'telegram1 optimal': {'commands': 'levels'},
    'telegram1 sinus_h': {'unlisted_exits': 'levels'},
    'telegram1 g2': {'commands': 'levels'},
}
SINUS_H = 'telegram1 sinus_h'
every_family = pytest.mark.parametrize('connection', LEVELS)
#: From one telegram with the drive to the next, s, and whether a drive takes levels.
SPEEDS = [(0.004, True), (0.1, True), (0.1, False)]
ALL_SPEEDS = list(itertools.product((0.004, 0.02, 0.1), (False, True)))


def plc_of(rig: Rig) -> Plc:
    assert rig.line.plc is not None
    return rig.line.plc


def channel_of(rig: Rig) -> Channel:
    return plc_of(rig).channels[1]


def power_cycle(rig: Rig, seconds: float) -> None:
    rig.far.power_cycle(seconds)
    rig.pass_time(seconds)


def lose_run_input(rig: Rig) -> None:
    rig.far.set_run_input(False)
    rig.pass_time(1.0)
    rig.far.set_run_input(True)


def cut_fieldbus(rig: Rig, seconds: float) -> None:
    channel_of(rig).cut_until = rig.clock.now + seconds
    rig.pass_time(seconds)


def cut_and_power_cycle(rig: Rig) -> None:
    cut_fieldbus(rig, 0.3)
    power_cycle(rig, 0.3)


def stop_program(rig: Rig) -> None:
    plc_of(rig).stopped_until = rig.clock.now + 2.0
    rig.pass_time(2.0)


def lose_line(rig: Rig, state: str, seconds: float) -> None:
    rig.line.state = state
    rig.pass_time(seconds)
    rig.line.mend()


def restart_plc(rig: Rig, seconds: float) -> None:
    """Restart it with a program that clears bit 0 and nothing else: STW1 0 stops no Sinus H."""
    plc_of(rig).restart(rig.clock.now + seconds)
    channel_of(rig).program.lost_clears, channel_of(rig).program.lost_sets = 0x0001, 0


def lose_plc(rig: Rig, seconds: float) -> None:
    restart_plc(rig, seconds)
    lose_line(rig, 'gone', seconds)


def trip(rig: Rig) -> None:
    rig.far.trip(12)
    rig.pass_time(1.0)
    rig.far.control_unit.faults.acknowledge()


LOSSES: dict[str, Callable[[Rig], None]] = {
    # what is shorter need not show: the life counter stands for 0.2 s and a poll at least [C125],
    # and a motor that was caught has to be still slower when it is looked at
    'power cycle of 0.3 s': lambda rig: power_cycle(rig, 0.3),
    'power cycle of 0.6 s': lambda rig: power_cycle(rig, 0.6),
    'power cycle of 3 s': lambda rig: power_cycle(rig, 3.0),
    'RUN input': lose_run_input,
    'fieldbus for 0.3 s, then a power cycle': cut_and_power_cycle,
    'fieldbus for 0.7 s': lambda rig: cut_fieldbus(rig, 0.7),
    'fieldbus for 3 s': lambda rig: cut_fieldbus(rig, 3.0),
    'program of the PLC': stop_program,
    'line for 1.5 s': lambda rig: lose_line(rig, 'silent', 1.5),
    'line for 5 s': lambda rig: lose_line(rig, 'silent', 5.0),
    'connection for 0.3 s': lambda rig: lose_line(rig, 'gone', 0.3),
    'connection for 3 s': lambda rig: lose_line(rig, 'gone', 3.0),
    'restart of the PLC in 0.2 s': lambda rig: lose_plc(rig, 0.2),
    'restart of the PLC in 3 s': lambda rig: lose_plc(rig, 3.0),
    'fault': trip,
}
#: What is said of some of them.
NAMED = {
    'fieldbus for 3 s': 'the PLC has no valid data from the drive',
    'program of the PLC': "the drive's data in the PLC have not changed",
    'line for 5 s': 'was not reached for',
}


@every_family
@pytest.mark.parametrize('lose', [cut_fieldbus, None], ids=['fieldbus', 'telegrams stand still'])
def test_life_counter_goes_on_while_only_the_drive_is_lost(
    connection: str, lose: Callable[[Rig, float], None] | None
) -> None:
    # else the watchdog of the PLC takes the driver for dead
    with Rig(connection) as rig:
        rig.turn()
        channel = channel_of(rig)
        counts = {channel.block.registers()[10]}
        alive: list[bool] = []

        def look() -> None:
            counts.add(channel.block.registers()[10])
            alive.append(channel.program.ros_alive)

        rig.looked = look
        if lose is not None:
            lose(rig, 10.0)
        else:
            # the PLC goes on, and the drive's telegrams are as they were
            channel.exchange = lambda now: setattr(channel, 'exchanged', False)  # type: ignore
            channel.program.drive_time = 60.0
            rig.pass_time(10.0)
            del channel.exchange
        assert not rig.drive.state.contact.connected
        assert all(alive)
        rig.looked = lambda: None
        # at the rate of the polls
        assert len(counts) > 0.7 * 10.0 * rig.drive.settings.poll_rate
        rig.wait_until(lambda: rig.drive.state.contact.connected)
        rig.assert_only_enable_helps()


def complaint(connection: str, exchange: float, levels: bool, loss: str) -> str:
    """Return what is wrong after a loss; ``''`` if nothing is."""
    options = LEVELS[connection] if levels else {}
    slow = ramps(CONNECTIONS[connection].model, 2.0, 2.0)
    line = {'plc': {'exchange': exchange}}
    with Rig(connection, options=options, parameters=slow, line=line, poll_rate=20.0) as rig:
        rig.turn()
        LOSSES[loss](rig)
        # programs go on sending set-points
        rig.pass_time(1.0 + rig.drive.settings.lost_after)
        if rig.turns:
            return f'it turns at {rig.far.motor.frequency:.1f} Hz'
        if rig.drive.following:
            return 'it is still enabled'
        rig.pass_time(3.0)
        if rig.turns:
            return f'it turns again, at {rig.far.motor.frequency:.1f} Hz'
        if rig.drive.stop_unconfirmed:
            return 'the stop is not confirmed'
        if not rig.notes.said(NAMED.get(loss, '')):
            return f'nothing says {NAMED[loss]}'
        begun = rig.clock.now
        answer = rig.answer(rig.drive.enable(), 6.0)
        rig.pass_time(1.5)
        if not rig.turns:
            return f'enable does not work again: {answer}'
        if rig.clock.now - begun > 6.0:
            return f'enable took {rig.clock.now - begun:.1f} s'
    return ''


@every_family
@pytest.mark.parametrize('loss', LOSSES)
def test_after_a_loss_it_stands_until_it_is_enabled(connection: str, loss: str) -> None:
    if connection == SINUS_H and loss == 'RUN input':
        pytest.skip('it has none of this kind')
    rows = ALL_SPEEDS if FULL else SPEEDS
    wrong = {row: found for row in rows if (found := complaint(connection, *row, loss))}
    assert not wrong, '\n'.join(f'{row}: {found}' for row, found in wrong.items())


@every_family
def test_the_first_answer_without_valid_data_ends_the_enable(connection: str) -> None:
    with Rig(connection, line={'plc': {'drive_time': 0.05}}) as rig:
        rig.turn()
        run = words(rig.line.frames)[-1]
        cut_fieldbus(rig, 0.15)
        assert not rig.drive.following and words(rig.line.frames)[-1] != run
        # a PLC is not asked more often while it has none
        before = len(rig.line.frames)
        cut_fieldbus(rig, 5.0)
        assert len(rig.line.frames) - before < 2 * 50 * 5


@pytest.mark.parametrize('echo_bits', ['state', 'word'])
def test_a_sinus_h_whose_plc_clears_bit_0_alone_is_led_out_of_operation(echo_bits: str) -> None:
    with Rig(SINUS_H, options={'echo_bits': echo_bits}) as rig:
        rig.turn()
        channel_of(rig).program.lost_clears = 0x0001
        lose_line(rig, 'silent', PLC_TIME + 1.0)
        rig.answer(rig.drive.stop_for_good(4.0))
        rig.pass_time(0.2)
        assert not rig.far.motor.driven
        assert rig.far.control_unit.report()['state'] != 'S4'


@every_family
def test_nothing_is_written_after_a_reconnection_until_a_command(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        lose_line(rig, 'gone', 0.3)
        before = len(words(rig.line.frames))
        channel_of(rig).block.stw1 = 0
        rig.pass_time(5.0)
        assert rig.drive.snapshot.connected
        assert len(words(rig.line.frames)) <= before + 1 and not rig.turns
        if CONNECTIONS[connection].model == 'sinus_optimal':
            assert channel_of(rig).block.stw1 == 0


def test_a_motor_that_turns_without_an_echo_is_stopped_when_the_driver_comes() -> None:
    with Rig(SINUS_H) as rig:
        rig.turn()
        rig.kill()
        # the block of the PLC is 0 now, and the drive keeps the last word [C116]
        restart_plc(rig, 0.5)
        rig.line.go_to(rig.clock.now + 3.0)
        assert rig.turns
        rig.begin()
        rig.connect()
        rig.pass_time(1.0)
        assert not rig.turns and not rig.far.motor.driven
        assert rig.notes.said(Cause.FOUND_RUNNING)


@pytest.mark.parametrize(
    'connection', [name for name in CONNECTIONS if name.startswith('telegram1')]
)
def test_a_motor_that_is_loaded_is_not_stopped_although_it_is_looked_at_seldom(
    connection: str,
) -> None:
    with Rig(connection, poll_rate=4.0) as rig:
        rig.turn()
        advance_to = rig.far.advance_to

        def loaded(now: float) -> None:
            advance_to(now)
            rig.far.motor.rotor *= 0.75
            rig.far.motor.ramp *= 0.75

        rig.far.advance_to = loaded  # type: ignore[method-assign]
        rig.pass_time(3.0)
        slowest = min(snapshot.actual for snapshot in rig.notes.snapshots[-8:])
        assert slowest < 19 * rig.connection.hertz
        assert rig.drive.following, rig.notes.events
