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

"""What commands ask of a MOVITRAC 31; what it does not do, and says so."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import dataclasses
from typing import Any

from movitrac_rig import DIRECTIONS
from movitrac_rig import MODEL
from movitrac_rig import P841
from movitrac_rig import REMOTE
from movitrac_rig import bits
from movitrac_rig import make
from movitrac_rig import requests_since
from movitrac_rig import succeeded
import pytest
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.simulator.movitrac31.codes import Mode
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE
from nfo_sinus_driver.simulator.movitrac31.fault_memory import FaultMemory

# --- what an enable asks --------------------------------------------------------------------------

#: P600 to P609 of terminals that only an option card has, P760 and P880 likewise.
CARDS = {153, 154, 155, 156, 321, 322, 323, 249, 212}


def asked_by_enable(rig: VirtualRig) -> list[int]:
    """Enable; return the indices that were asked for or written meanwhile."""
    before = len(rig.link.frames)
    assert 'enabled' in rig.answer(rig.drive.enable())
    asked = [index for index, _ in requests_since(rig, before)]
    assert succeeded(rig, rig.drive.stop())
    return asked


@pytest.mark.parametrize(('settings', 'most'), [({}, 38), (REMOTE, 31)], ids=['P841', 'mine'])
def test_an_enable_asks_little_of_a_drive_whose_settings_were_read(
    make_virtual: MakeVirtual, settings: dict[str, Any], most: int
) -> None:
    rig = make_virtual(settings, model=MODEL, telemetry_rate=0.0, poll_rate=0.1)
    rig.connect()
    rig.answer(rig.drive.parameters.read())
    asked = asked_by_enable(rig)
    assert len(asked) <= most, asked
    assert not CARDS & set(asked)


def test_a_card_that_was_fitted_meanwhile_is_asked_for_again(make_virtual: MakeVirtual) -> None:
    rig = make_virtual({'terminal.input_48': 'CW/Stop'}, model=MODEL)
    rig.connect()
    rig.answer(rig.drive.parameters.read())
    assert not CARDS & set(asked_by_enable(rig))
    unit = rig.far.control_unit
    unit.variant = dataclasses.replace(unit.variant, option_card='fio')
    unit.terminals.inputs += (48, 49, 50, 51, 52, 53, 54)
    # a card is fitted while the drive has no power
    rig.far.power_cycle(5.0)
    rig.pass_time(10.0)
    assert rig.drive.snapshot.connected
    unit.switch(48, True)
    assert 'terminal 48 (CW/Stop) is closed' in rig.answer(rig.drive.enable())


def test_one_refusal_is_not_believed_of_a_card(make_virtual: MakeVirtual) -> None:
    rig = make(make_virtual)
    rig.connect()
    assert set(asked_by_enable(rig)) >= CARDS
    assert set(asked_by_enable(rig)) >= CARDS
    assert not CARDS & set(asked_by_enable(rig))


# --- what it does not do, and says so -------------------------------------------------------------


@pytest.mark.parametrize(
    ('settings', 'closed', 'opened', 'reason'),
    [
        ({}, 41, 0, 'terminal 41 (CW/Stop) is closed'),
        ({}, 42, 0, 'terminal 42 (CCW/Stop) is closed'),
        ({}, 0, 43, 'terminal 43 (Enable/Stop) is open'),
        ({'serial.manual_operation': True}, 0, 0, 'P870'),
        ({'special.parameter_lock': True}, 0, 0, 'P800'),
        ({'frequency.f_min_1': 5.0}, 0, 0, 'set frequency.f_min_1 to 0'),
    ],
)
def test_an_enable_is_refused_with_the_reason(
    make_virtual: MakeVirtual, settings: dict[str, Any], closed: int, opened: int, reason: str
) -> None:
    rig = make_virtual(settings, model=MODEL)
    rig.connect()
    for terminal, state in ((closed, True), (opened, False)):
        if terminal:
            rig.far.control_unit.switch(terminal, state)
    assert reason in rig.answer(rig.drive.enable())
    rig.send(20.0)
    rig.pass_time(1.0)
    assert not rig.drive.armed
    assert not bits(rig) & DIRECTIONS
    assert not rig.written(P841) or 'P800' in reason
    assert round(rig.far.memory.number(CONTROL_MODE)) == Mode.STANDARD


@pytest.mark.parametrize(
    ('card', 'settings', 'reason'),
    [
        ('fen', {'control.operating_mode': 'Positioning control'}, 'P770'),
        ('frs', {'control.synchronous_operation': True}, 'P760'),
        ('fea', {'serial.master_slave': True}, 'no response'),
    ],
)
def test_an_enable_is_refused_in_another_operating_mode(
    make_virtual: MakeVirtual, card: str, settings: dict[str, Any], reason: str
) -> None:
    rig = make_virtual(settings, variant={'option_card': card}, model=MODEL)
    if reason == 'no response':
        # on RS-485 it hears nobody then; what the simulated line does is tested elsewhere
        rig.far.control_unit.hears = lambda *line: True  # type: ignore[method-assign]
        reason = 'P880'
    rig.connect()
    assert reason in rig.answer(rig.drive.enable())
    assert not rig.drive.armed


@pytest.mark.parametrize(
    'ask',
    [
        lambda drive: drive.tune(Procedure.FULL),
        lambda drive: drive.erase_error_log(),
        lambda drive: drive.reset_energy(),
    ],
    ids=['tune', 'erase', 'energy'],
)
def test_what_it_has_not_is_answered_so(
    make_virtual: MakeVirtual, ask: Callable[[Drive], Future[Any]]
) -> None:
    rig = make(make_virtual)
    rig.connect()
    frames = len(rig.link.frames)
    future = ask(rig.drive)
    assert not succeeded(rig, future)
    assert MODEL in rig.answer(future) or 'MOVITRAC' in rig.answer(future)
    assert all(words is None for _, words in requests_since(rig, frames))


def test_the_last_five_faults_are_told_newest_first(make_virtual: MakeVirtual) -> None:
    rig = make(make_virtual)
    rig.connect()
    for fault in (101, 107, 106, 145, 103, 101):
        rig.far.trip(fault)
        rig.far.control_unit.reset()
    log = rig.drive.error_log()
    rig.answer(log)
    assert [entry.code for entry in log.result()] == [101, 103, 145, 106, 107]
    assert [entry.text for entry in log.result()[:2]] == ['Overcurrent', 'Brake chopper']


def test_a_fault_code_with_decimals_is_an_unknown_code(
    make_virtual: MakeVirtual, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make(make_virtual)
    rig.connect()
    remembered = FaultMemory.raw
    monkeypatch.setattr(
        FaultMemory, 'raw', lambda *of: 45 if of[1] == 'status.fault_t0' else remembered(*of)
    )
    log = rig.drive.error_log()
    rig.answer(log)
    assert [(one.code, one.text) for one in log.result()] == [(255, 'unknown code (raw 45)')]
