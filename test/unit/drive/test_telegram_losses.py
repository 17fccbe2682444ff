# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
Telegram 1: no motor goes on by itself after a loss, on PLCs of any speed, drives of either kind.

Findings 1, 8, 11, 12, 20 and 28 of the issue on findings, in virtual time.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import itertools

from plc_rig import MODELS
from plc_rig import PlcRig
import pytest
from support.said import says

from nfo_sinus_driver.catalog.status import Fact
from nfo_sinus_driver.catalog.status import State
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.link.telegram import PLC_TIME

LOST_AFTER = 1.0
#: From one telegram with the drive to the next, s.
EXCHANGES = (0.004, 0.02, 0.1)


def _power_cycle(seconds: float) -> Callable[[PlcRig], None]:
    def lose(rig: PlcRig) -> None:
        rig.far.power_cycle(seconds)
        rig.pass_time(seconds)

    return lose


def _run_input(rig: PlcRig) -> None:
    rig.far.set_run_input(False)
    rig.pass_time(1.0)
    rig.far.set_run_input(True)


def _fieldbus(seconds: float) -> Callable[[PlcRig], None]:
    def lose(rig: PlcRig) -> None:
        rig.channel.cut_until = rig.clock.now + seconds
        rig.pass_time(seconds)

    return lose


def _program(rig: PlcRig) -> None:
    rig.plc.stopped_until = rig.clock.now + 2.0
    rig.pass_time(2.0)


def _line(seconds: float, state: str) -> Callable[[PlcRig], None]:
    def lose(rig: PlcRig) -> None:
        rig.link.state = state
        rig.pass_time(seconds)
        rig.link.mend()

    return lose


def _restart_plc(rig: PlcRig, seconds: float) -> None:
    """Restart it with a program that clears bit 0 and nothing else: STW1 0 stops no Sinus H."""
    rig.plc.restart(rig.clock.now + seconds)
    rig.channel.program.lost_clears, rig.channel.program.lost_sets = 0x0001, 0


def _plc_restart(seconds: float) -> Callable[[PlcRig], None]:
    def lose(rig: PlcRig) -> None:
        rig.link.state = 'gone'
        _restart_plc(rig, seconds)
        rig.pass_time(seconds)
        rig.link.mend()

    return lose


def _fault(rig: PlcRig) -> None:
    rig.far.trip(12)
    rig.pass_time(1.0)
    rig.far.control_unit.faults.acknowledge()


LOSSES: dict[str, Callable[[PlcRig], None]] = {
    'power cycle of 0.2 s': _power_cycle(0.2),
    'power cycle of 0.3 s': _power_cycle(0.3),
    'power cycle of 0.6 s': _power_cycle(0.6),
    'power cycle of 3 s': _power_cycle(3.0),
    'RUN input': _run_input,
    'fieldbus for 0.3 s, then a power cycle': lambda rig: (
        _fieldbus(0.3)(rig), _power_cycle(0.3)(rig)
    ),
    'fieldbus for 0.7 s': _fieldbus(0.7),
    'fieldbus for 3 s': _fieldbus(3.0),
    'program of the PLC': _program,
    'line for 1.5 s': _line(1.5, 'silent'),
    'line for 5 s': _line(5.0, 'silent'),
    'connection for 0.3 s': _line(0.3, 'gone'),
    'connection for 3 s': _line(3.0, 'gone'),
    'restart of the PLC in 0.2 s': _plc_restart(0.2),
    'restart of the PLC in 3 s': _plc_restart(3.0),
    'fault': _fault,
}


def _complaints(model: str, exchange: float, levels: bool, loss: str) -> str:
    """Return what is wrong after a loss; ``''`` if nothing is."""
    rig = PlcRig(model, exchange=exchange, levels=levels, lost_after=LOST_AFTER)
    with rig.judged():
        rig.connect()
        rig.turn()
        LOSSES[loss](rig)
        # programs go on sending set-points
        rig.pass_time(1.0 + LOST_AFTER)
        if rig.turns:
            return f'it turns at {rig.far.motor.frequency:.1f} Hz'
        if rig.drive.armed:
            return 'it is still enabled'
        rig.pass_time(4.0)
        if rig.turns:
            return f'it turns again, at {rig.far.motor.frequency:.1f} Hz'
        if rig.drive.stop_unconfirmed:
            return 'the stop is not confirmed'
        begun = rig.clock.now
        with contextlib.suppress(AssertionError):
            rig.turn(15.0)
        if not rig.turns:
            return f'enable does not work again: {rig.answer(rig.drive.enable())}'
        # it turns for 3 s then
        if rig.clock.now - begun > 3.0 + 6.0:
            return f'enable took {rig.clock.now - begun - 3.0:.1f} s'
    return ''


@pytest.mark.parametrize('levels', [False, True], ids=['edges', 'levels'])
@pytest.mark.parametrize('exchange', EXCHANGES)
@pytest.mark.parametrize('model', MODELS)
def test_after_a_loss_it_stands_until_it_is_enabled(
    model: str, exchange: float, levels: bool
) -> None:
    # a Sinus H has no RUN input of this kind
    losses = [loss for loss in LOSSES if model != 'sinus_h' or loss != 'RUN input']
    found = {loss: _complaints(model, exchange, levels, loss) for loss in losses}
    assert not any(found.values()), {loss: why for loss, why in found.items() if why}


@pytest.mark.parametrize('model', MODELS)
def test_each_word_stands_until_the_drive_has_had_it(model: str) -> None:
    rig = PlcRig(model, exchange=0.1)
    with rig.judged():
        rig.connect()
        given: list[tuple[float, int]] = []
        sent: list[float] = []
        exchange = rig.channel.exchange

        def noted(now: float) -> None:
            if not given or given[-1][1] != rig.channel.program.stw1:
                given.append((now, rig.channel.program.stw1))
            sent.append(now)
            exchange(now)

        rig.channel.exchange = noted  # type: ignore[method-assign]
        rig.turn()
        for _ in range(2):
            rig.answer(rig.drive.stop())
            rig.pass_time(1.0)
            rig.turn()
        rig.answer(rig.drive.stop())
        rig.far.trip(12)
        rig.pass_time(1.0)
        rig.answer(rig.drive.acknowledge())
        rig.pass_time(1.0)
        had = [word for _, word in given]
        # the PLC began with what stood before
        assert [word for word in rig.words if word in had] == rig.words, (rig.words, had)


@pytest.mark.parametrize('model', MODELS)
def test_the_first_answer_without_valid_data_ends_the_enable(model: str) -> None:
    rig = PlcRig(model, plc={'drive_time': 0.05})
    with rig.judged():
        rig.connect()
        rig.turn()
        run = rig.words[-1]
        rig.channel.cut_until = rig.clock.now + 0.3
        rig.pass_time(0.15)
        assert not rig.drive.armed and rig.words[-1] != run
        # a PLC is not asked more often while it has none
        before = len(rig.frames)
        rig.channel.cut_until = rig.clock.now + 5.0
        rig.pass_time(5.0)
        assert len(rig.frames) - before < 2 * 50 * 5


def test_operation_enabled_and_the_state_agree() -> None:
    for model, level in itertools.product(MODELS, (0.0, 25.0)):
        rig = PlcRig(model)
        with rig.judged():
            rig.connect()
            rig.turn(level)
            status = rig.drive.snapshot.status
            assert status is not None and status.state is State.OPERATION_ENABLED, model
            assert Fact.OPERATION_ENABLED in status.valid & status.facts, model


@pytest.mark.parametrize('echo_bits', ['state', 'word'])
def test_a_sinus_h_whose_plc_clears_bit_0_alone_is_led_out_of_operation(echo_bits: str) -> None:
    rig = PlcRig('sinus_h', options={'echo_bits': echo_bits})
    with rig.judged():
        rig.connect()
        rig.turn()
        rig.channel.program.lost_clears = 0x0001
        rig.link.state = 'silent'
        rig.pass_time(PLC_TIME + 1.0)
        rig.link.mend()
        rig.answer(rig.drive.stop_for_good(4.0))
        rig.pass_time(0.2)
        assert not rig.far.motor.driven
        assert rig.far.control_unit.report()['state'] != 'S4'


@pytest.mark.parametrize('model', MODELS)
def test_an_exit_leaves_the_word_of_a_motor_that_stands(model: str) -> None:
    ready = {'sinus_optimal': 0x0400, 'sinus_h': 0x0476, 'sinus_g2': 0x0476}
    rig = PlcRig(model)
    with rig.judged():
        rig.connect()
        rig.turn()
        rig.answer(rig.drive.stop_for_good(4.0))
        rig.elapse(0.1)
        assert not rig.far.motor.driven and rig.words[-1] == ready[model]


@pytest.mark.parametrize('model', MODELS)
def test_nothing_is_written_after_a_reconnection_until_a_command(model: str) -> None:
    rig = PlcRig(model)
    with rig.judged():
        rig.connect()
        rig.turn()
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        rig.link.state = 'gone'
        rig.pass_time(0.3)
        rig.link.mend()
        before = len(rig.words)
        rig.channel.block.stw1 = 0
        rig.pass_time(5.0)
        assert rig.drive.snapshot.connected
        assert len(rig.words) <= before + 1 and not rig.turns
        if model == 'sinus_optimal':
            assert rig.channel.block.stw1 == 0


def test_a_motor_that_turns_without_an_echo_is_stopped_when_the_driver_comes() -> None:
    rig = PlcRig('sinus_h')
    with rig.judged():
        rig.connect()
        rig.turn()
        rig.kill()
        # the block of the PLC is 0 now, and the drive keeps the last word [C116]
        _restart_plc(rig, 0.5)
        rig.elapse(3.0)
        assert rig.turns
        rig.begin()
        rig.send(None)
        rig.connect()
        rig.pass_time(1.0)
        assert not rig.turns and not rig.far.motor.driven
        assert any(says(text, Cause.FOUND_RUNNING) for _, _, text in rig.notes.events)


def test_a_g2_is_stopped_by_what_its_actual_value_says() -> None:
    rig = PlcRig('sinus_g2', ramp=1.0)
    with rig.judged():
        rig.connect()
        rig.answer(rig.drive.enable())
        rig.send(10.0)
        rig.pass_time(2.5)
        status = rig.drive.snapshot.status
        assert status is not None and status.word is not None
        # pulses enabled is no stop [C111]
        assert status.word & 0x8000 and status.state is State.OPERATION_ENABLED
        rig.send(-10.0)
        rig.pass_time(5.0)
        assert rig.far.motor.frequency < -9.5
        assert rig.drive.snapshot.frequency < -9.5


def test_a_g2_whose_master_maps_drivecontrol_is_chosen_by_name() -> None:
    rig = PlcRig(
        'sinus_g2', options={'telegram_words': 'drivecontrol'}, telegram_words='drivecontrol'
    )
    rig.connect()
    rig.turn()
    rig.answer(rig.drive.stop())
    rig.pass_time(1.0)
    assert not rig.turns
    assert rig.words[-3:] == [0xC077, 0xC07F, 0xC076]
    rig.close()
