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


"""Telegram 1 end to end: Optimal, Sinus H and G2 behind a simulated PLC, over Modbus TCP."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
from concurrent.futures import Future
import contextlib
from pathlib import Path
import time
from typing import Any
from unittest import mock

from drive_rig import PATIENCE
from drive_rig import wait_until
import pytest
from support import telegram_laws
from support.examples import FULL
from telegram_rig import MODELS
from telegram_rig import TelegramRig

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.catalog.status import Fact
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import sequences
from nfo_sinus_driver.link import LineSettings
from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.simulator.plc import PlcSetting

#: STW1 from the first word to the run command, as the manuals' tables have it.
ENABLING = {
    'sinus_optimal': [0x0400, 0x0408, 0x0409],
    'sinus_h': [0x0476, 0x0477, 0x047F],
    'sinus_g2': [0x0476, 0x0477, 0x047F],
}
STOPPED = {'sinus_optimal': 0x0408, 'sinus_h': 0x0477, 'sinus_g2': 0x047E}
WAYS_OUT: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'deactivate': lambda drive: drive.deactivate(),
    'clean up': lambda drive: drive.disconnect(4.0),
    'exit': lambda drive: drive.stop_for_good(4.0),
}
Make = Callable[..., TelegramRig]


#: For what does not depend on the family: the full run has all.
ONE_MODEL = pytest.mark.parametrize('model', MODELS if FULL else MODELS[:1], indirect=True)


@pytest.fixture(params=MODELS)
def model(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def make(tmp_path: Path, model: str, unhurried: None) -> Iterator[Make]:
    with contextlib.ExitStack() as stack:

        def made(**options: Any) -> TelegramRig:
            rig = TelegramRig(tmp_path / 'trace.jsonl', model, **options)
            rig.start()
            stack.callback(rig.stop)
            return rig

        yield made


def test_a_ride(make: Make, model: str) -> None:
    rig = make()
    rig.ride(20.0)
    first = rig.words.index(ENABLING[model][0])
    assert rig.words[first:] == ENABLING[model]
    wait_until(lambda: abs(rig.drive.snapshot.actual - 20.0) < 0.5)
    rig.send(-10.0)
    if model == 'sinus_h':
        wait_until(lambda: rig.far.motor.frequency == 0)
        wait_until(lambda: rig.notes.told('set-point -10 is limited to 0'))
    else:
        wait_until(lambda: rig.far.motor.frequency < -9.5)
        wait_until(lambda: rig.drive.snapshot.actual < -9.0)
    rig.send(15.0)
    wait_until(lambda: rig.far.motor.frequency > 14.5)
    assert 'stop' in rig.answer(rig.drive.stop())
    rig.stays()
    assert rig.words[-1] == STOPPED[model]
    rig.ride(10.0)


def test_every_way_out_stops_the_motor(make: Make, model: str) -> None:
    rig = make()
    for way in (*WAYS_OUT.values(), lambda drive: drive.disconnect(4.0)):
        if rig.drive.snapshot.connected:
            rig.drive.activate()
        rig.ride()
        way(rig.drive).result(30.0)
        rig.stands()
        assert not rig.drive.armed
        assert rig.far.motor.frequency == 0 or not rig.far.motor.driven
        if way is WAYS_OUT['exit']:
            break


@pytest.mark.parametrize('part', ['drive', 'program'])
def test_old_or_invalid_data_stop_it_and_are_told(make: Make, model: str, part: str) -> None:
    rig = make(lost_after=3.0, plc=PlcSetting(ros_time=10.0, drive_time=2.0))
    rig.ride()
    # until it is told, however long a busy machine takes for that
    if part == 'drive':
        rig.simulator.inject('fieldbus-cut', seconds=3600.0)
        wait_until(lambda: rig.notes.told('the PLC has no valid data from the drive'))
        rig.simulator.inject('fieldbus-cut', seconds=0.0)
    else:
        rig.simulator.inject('plc-stop', seconds=3600.0)
        wait_until(lambda: rig.notes.told('the data from the drive stand still in the PLC'))
        rig.simulator.inject('plc-stop', seconds=0.0)
    assert not rig.drive.armed
    wait_until(lambda: rig.words[-1] == STOPPED[model])
    wait_until(lambda: rig.drive.snapshot.connected)
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    rig.stays()


def test_a_fault_is_acknowledged_and_nothing_runs(make: Make, model: str) -> None:
    rig = make()
    rig.ride()
    code = {'sinus_h': 12}.get(model, 12)
    rig.simulator.inject('fault', code=code)
    wait_until(lambda: not rig.drive.armed)
    rig.stays()
    wait_until(lambda: rig.drive.snapshot.status is not None and rig.drive.snapshot.status.faulted)
    rig.simulator.inject('ack-cause-gone')
    assert rig.answer(rig.drive.acknowledge()).startswith('acknowledged')
    rig.stays()
    rig.ride(10.0)


@ONE_MODEL
def test_a_release_is_needed(make: Make, model: str) -> None:
    rig = make(plc=PlcSetting(ros_time=10.0, drive_time=10.0, released=False))
    rig.connect()
    assert 'has not released the drive to ROS' in rig.answer(rig.drive.enable())
    rig.simulator.inject('release', state='on')
    wait_until(lambda: rig.drive.snapshot.text not in ('', 'Not released'))
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    rig.ride()
    rig.simulator.inject('release', state='off')
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: rig.notes.told('the PLC has taken the release to ROS back'))
    rig.stands()
    rig.simulator.inject('release', state='on')
    rig.stays()


@ONE_MODEL
def test_the_driver_is_killed(make: Make, model: str) -> None:
    rig = make(plc=PlcSetting(ros_time=1.5, drive_time=10.0))
    rig.ride()
    # nothing is said any more, not even that it ends
    rig.bus._stopping = True
    rig.bus._awake.set()
    rig.stands()


@ONE_MODEL
def test_a_line_that_is_dead_for_long(make: Make, model: str) -> None:
    rig = make(
        plc=PlcSetting(ros_time=1.5, drive_time=10.0),
        response_timeout=0.3, lost_after=10.0, plc_time=2.0,
    )
    rig.ride()
    rig.simulator.inject('line-dead', seconds=4.0)
    wait_until(lambda: rig.notes.told('was not reached for'))
    rig.stands()
    wait_until(lambda: rig.drive.snapshot.connected)
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    rig.stays()
    rig.ride(10.0)


def test_a_direction_that_is_told_is_the_one_in_which_it_turns(make: Make, model: str) -> None:
    rig = make()
    rig.connect()
    rig.enable()
    for wanted in (15.0, -15.0):
        if rig.drive.model.profile.setpoints['Freque'].forward_only and wanted < 0:
            continue
        rig.send(wanted)
        wait_until(lambda wanted=wanted: abs(rig.far.motor.frequency - wanted) < 0.5)
        wait_until(lambda wanted=wanted: abs(rig.drive.snapshot.frequency - wanted) < 0.5)
        status = rig.drive.snapshot.status
        assert status is not None
        if Fact.REVERSE in status.valid:
            assert (Fact.REVERSE in status.facts) == (wanted < 0)


def test_a_stop_is_confirmed_by_the_first_status_after_it(make: Make, model: str) -> None:
    rig = make()
    rig.ride()
    rig.answer(rig.drive.stop())
    rig.stands()
    attempts = []
    try_once = sequences.StopSequence._try_once

    async def counted(sequence: sequences.StopSequence) -> Any:
        attempts.append(await try_once(sequence))
        return attempts[-1]

    def each_at_the_first_attempt() -> bool:
        attempts.clear()
        for _ in range(10):
            rig.drive.stop().result(PATIENCE)
        return len(attempts) == 10

    # what the PLC shows at first is from before the stop, and none is written twice for that; a
    # machine that rests is given another chance
    with mock.patch.object(sequences.StopSequence, '_try_once', counted):
        wait_until(each_at_the_first_attempt)


@pytest.mark.parametrize('command', ['stop', 'quick_stop'])
def test_what_a_plc_goes_on_showing_confirms_no_stop(
    make: Make, model: str, command: str
) -> None:
    rig = make()
    rig.connect()
    rig.ride()
    rig.answer(rig.drive.stop())
    rig.stands()
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    # its registers are answered, and show a drive that stands
    rig.simulator.inject('plc-stop', seconds=3600.0)
    assert 'NOT confirmed' in rig.answer(getattr(rig.drive, command)())
    assert rig.drive.stop_unconfirmed
    rig.simulator.inject('plc-stop', seconds=0.0)
    wait_until(lambda: not rig.drive.stop_unconfirmed)


@ONE_MODEL
def test_a_plc_that_answers_slowly(make: Make, model: str) -> None:
    rig = make(plc=PlcSetting(ros_time=10.0, drive_time=10.0, answer_time=(0.05, 0.4)))
    rig.connect()
    rig.enable()
    rig.send(15.0)
    wait_until(lambda: abs(rig.far.motor.frequency - 15.0) < 0.5)
    assert 'stop' in rig.answer(rig.drive.stop())
    rig.stands()


@ONE_MODEL
def test_a_stop_is_the_next_thing_in_the_block(make: Make, model: str) -> None:
    setting = PlcSetting(ros_time=10.0, drive_time=10.0, answer_time=(0.05, 0.05))
    # more is always waiting for its turn
    rig = make(plc=setting, telemetry_rate=50.0)
    run = telegram_laws.JUDGES[model].run
    for _ in range(5):
        rig.ride()
        asked_at = time.monotonic()
        rig.answer(rig.drive.stop())
        rig.send(None)
        words = [
            one.stw1
            for one in telegram_laws.exchanges(
                [frame for frame in rig.frames if frame['first'] > asked_at], 1
            )
        ]
        # what the worker had taken up already goes before it
        told = next(number for number, word in enumerate(words) if not word & run)
        assert told <= 1, [f'{word:04X}' for word in words]


@ONE_MODEL
def test_a_plc_without_function_23(make: Make, model: str) -> None:
    rig = make(plc=PlcSetting(ros_time=10.0, drive_time=10.0, write_and_read=False))
    rig.ride()
    assert 'stop' in rig.answer(rig.drive.stop())
    rig.stays()


def test_a_driver_that_only_watches_writes_nothing(make: Make, model: str) -> None:
    if model != 'sinus_h':
        pytest.skip('the others are watched on their own line')
    rig = make(control_method='monitor')
    rig.connect()
    rig.drive.snapshot  # noqa: B018
    wait_until(lambda: len(rig.notes.snapshots) > 5)
    assert not list(telegram_laws.exchanges(rig.frames, 1))


def test_the_drive_of_a_block_elsewhere(tmp_path: Path, model: str) -> None:
    from nfo_sinus_driver.simulator.simulator import Simulator

    plc = PlcSetting(ros_time=10.0, drive_time=10.0, blocks=((1, 0), (1, 20)))
    simulator = Simulator(protocol='telegram1', model=model, addresses=(1, 2), plc=plc)
    simulator.start()
    link = open_link('modbus_tcp', simulator.port, LineSettings(response_timeout=2.0))
    bus = Bus(link)
    from drive_rig import Notes

    settings = [
        DriveSettings(
            model=model, control_method='telegram1', block_address=block, lost_after=10.0,
            setpoint_timeout=0.0,
        )
        for block in (0, 20)
    ]
    one, other = (Drive(bus, each, Notes()) for each in settings)
    bus.start()
    try:
        for drive in (one, other):
            drive.connect().result(30.0)
            drive.activate()
        wait_until(lambda: not (one.stop_unconfirmed or other.stop_unconfirmed))
        other.enable().result(30.0)
        other.set_setpoint(12.0)
        wait_until(lambda: simulator.drives[2].motor.frequency > 11.5)
        assert not simulator.drives[1].motor.driven and not one.armed
    finally:
        bus.close()
        simulator.stop()


def test_what_the_telegram_does_not_tell(make: Make, model: str) -> None:
    rig = make()
    rig.connect()
    assert rig.drive.snapshot.speed != rig.drive.snapshot.speed
    assert 'not documented' in rig.answer(rig.drive.error_log())


def test_its_own_time_out_is_that_of_the_plc(make: Make) -> None:
    rig = make(lost_after=2.0, drive_timeout=3.0)
    said = rig.answer(rig.drive.connect())
    assert 'the PLC watches this driver, and stops the motor 1 s after its last word' in said
    assert not list(telegram_laws.exchanges(rig.frames, 1))


def test_a_drive_that_tells_nothing_nominal_has_its_own_limit(make: Make, model: str) -> None:
    rig = make()
    rig.connect()
    rig.enable()
    rig.drive.set_setpoint(1000.0)
    most = {'sinus_h': 327.67}.get(model, 150)
    wait_until(lambda: rig.notes.told(f'set-point 1000 is limited to {most:g} (setpoint_max, or'))
    wait_until(lambda: rig.far.motor.driven)
    assert 'stop' in rig.answer(rig.drive.stop())
    rig.stays()


def test_nothing_turns_by_an_enable_or_a_set_point_alone(make: Make) -> None:
    rig = make()
    rig.connect()
    rig.send(20.0)
    rig.stays()
    rig.send(None)
    rig.enable()
    count = len(rig.notes.snapshots)
    wait_until(lambda: len(rig.notes.snapshots) > count + 40)
    # what came before the enable is none: it holds at 0
    assert rig.far.motor.frequency == 0
    rig.send(20.0)
    wait_until(lambda: rig.far.motor.frequency > 19.0)


def test_a_line_that_has_no_plc() -> None:
    settings = DriveSettings(model='sinus_h')
    link = open_link('modbus_rtu', '/dev/x', LineSettings())
    with pytest.raises(ValueError, match='goes through a PLC: set protocol to modbus_tcp'):
        Drive(Bus(link), settings, None)  # type: ignore[arg-type]


def test_causes_are_there() -> None:
    assert {Cause.OLD_DATA, Cause.CONTROL_WITHHELD, Cause.OWN_TIMEOUT_UNKNOWN} <= set(Cause)
