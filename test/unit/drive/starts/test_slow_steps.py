# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive takes some time for each step of a command: no step is written before it is shown."""

from __future__ import annotations

import pytest
from support.rig import SLICE, Rig

from nfo_sinus_driver.simulator.sinus_optimal import control_unit
from nfo_sinus_driver.simulator.sinus_optimal.control_unit import OptimalControlUnit

OPTIMAL = 'optimal, control word'
BUS_CONTROL, ENABLE, SWITCH_ON = 1 << 14, 1 << 3, 1 << 0
#: How often a slow drive takes its control word, s.
_SAMPLED = 0.1
#: What commands a drive by levels and edges.
_MASK, _CONTROL = 'fieldbus.drv_ctrl_write_mask', 'fieldbus.drive_control'
_WORDS = (_CONTROL, _MASK, 'fieldbus.control_word', 'fieldbus.function_bits')


class Sampled:
    """Has a simulated drive take what its word is now only now and then, as a slow one does."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._taken_at = rig.clock.now
        self._waiting: tuple[str, int] | None = None
        rig.meet, rig.looked = self._meet, self._look
        unit = rig.far.control_unit
        self._show = unit.show
        unit.show = self._shown  # type: ignore[method-assign]

    def _shown(self, key: str) -> int | None:
        # what was written stands in the word, whether it was taken or not
        if self._waiting is not None and key == self._waiting[0]:
            return self._waiting[1]
        return self._show(key)

    def _meet(self, key: str, data: bytes | None) -> str | None:
        if data is None or key not in _WORDS:
            return None
        params = self._rig.drive.params
        raw = params.model[key].at(params.protocol).codec.decode(data)
        if key == _MASK:
            # the word takes the mask at once, and the drive the word later
            before = self._waiting[1] if self._waiting else self._rig.far.read_raw(_CONTROL)
            key, raw = _CONTROL, before & raw | raw >> 16
        self._waiting = key, raw
        return 'ignored'

    def _look(self) -> None:
        if self._rig.clock.now < self._taken_at + _SAMPLED:
            return
        self._taken_at = self._rig.clock.now
        if self._waiting is not None:
            (key, raw), self._waiting = self._waiting, None
            self._rig.far.write_raw(key, raw)


def take_late(rig: Rig, key: str) -> None:
    """Have a simulated drive take each value of a parameter some time after it was written."""
    waiting: list[tuple[float, int]] = []

    def meet(asked: str, data: bytes | None) -> str | None:
        if data is None or asked != key:
            return None
        waiting.append((rig.clock.now + _SAMPLED, rig.number(data)))
        return 'ignored'

    def look() -> None:
        if waiting and rig.clock.now >= waiting[0][0]:
            rig.far.write_raw(key, waiting.pop(0)[1])

    rig.meet, rig.looked = meet, look


@pytest.mark.parametrize('seconds', [0.03, 0.1, 0.3])
def test_an_optimal_is_enabled_once_it_shows_who_has_control(
    seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # its status code says Bus Stby before the status word does
    monkeypatch.setattr(control_unit, '_RESPONSE', seconds)
    code = OptimalControlUnit.inv_st.fget
    assert code is not None
    monkeypatch.setattr(
        OptimalControlUnit,
        'inv_st',
        property(lambda unit: 37 if code(unit) == 24 and unit.control_word else code(unit)),
    )
    with Rig(OPTIMAL) as rig:
        rig.connect()
        rig.enable()


def test_an_optimal_is_enabled_that_mode_has_put_under_control_of_the_bus(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # its status shows that the bus has control, and not when the bit in the word counts
    monkeypatch.setattr(control_unit, '_RESPONSE', 0.1)
    with Rig(OPTIMAL) as rig:
        rig.far.write_raw('fieldbus.mode', 3)
        rig.connect()
        rig.enable()


def test_an_optimal_is_enabled_that_an_earlier_session_has_left_enabled() -> None:
    with Rig(OPTIMAL) as rig:
        for word in (BUS_CONTROL, BUS_CONTROL | ENABLE):
            rig.far.write_raw('fieldbus.drive_control', word)
            rig.pass_time(0.5)
        rig.connect()
        take_late(rig, 'fieldbus.drive_control')
        rig.enable()


@pytest.mark.parametrize('taken_after', range(5))
def test_an_optimal_is_enabled_that_its_keypad_has_taken(taken_after: int) -> None:
    with Rig(OPTIMAL) as rig:
        rig.turn(25.0)
        rig.far.control_unit.press('stop')
        rig.wait_until(lambda: not rig.drive.following and not rig.drive.stop_unconfirmed)
        Sampled(rig)
        rig.pass_time(taken_after * SLICE)
        rig.enable()


def test_an_optimal_that_ramps_keeps_its_enable_for_a_new_start() -> None:
    # without it the motor would be released [C109]
    with Rig(OPTIMAL, parameters={'control.retard': 6.0}) as rig:
        rig.turn(25.0)
        rig.answer(rig.drive.stop())
        assert rig.far.motor.driven
        asked = len(rig.asked)
        rig.drive.enable()
        rig.pass_time(1.0)
        words = [
            rig.number(data)
            for _, key, data in rig.asked[asked:]
            if key == 'fieldbus.drive_control' and data is not None
        ]
        assert words and all(word & ENABLE for word in words)


def test_ds402_is_switched_off_again_once_the_bus_has_control() -> None:
    # without "remote" the control word is not processed
    with Rig('canopen, ds402 alone') as rig:
        rig.connect()
        rig.far.control_unit.press('stop')
        take_late(rig, 'fieldbus.mode')
        rig.enable()


@pytest.mark.parametrize(
    'connection',
    [OPTIMAL, 'rtu, control word', 'canopen, control word', 'canopen, ds402', 'movitrac'],
)
def test_a_fault_is_acknowledged_in_a_drive_that_takes_its_word_now_and_then(
    connection: str,
) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.far.trip(rig.a_fault)
        rig.wait_until(lambda: not rig.drive.following)
        rig.pass_time(1.0)
        Sampled(rig)
        for offset in range(3):
            rig.pass_time(offset * SLICE)
            answer = rig.answer(rig.drive.acknowledge())
            assert 'acknowledged' in answer, answer
            rig.far.trip(rig.a_fault)
            rig.pass_time(1.0)
