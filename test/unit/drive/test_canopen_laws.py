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

"""The laws on CANopen, whatever the manual leaves open of its node [C102]."""

from __future__ import annotations

from pathlib import Path
import time

from canopen_rig import CanopenRig
from drive_rig import PATIENCE
from drive_rig import wait_until
import pytest
from support.examples import FULL

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.link import NoAnswer
from nfo_sinus_driver.simulator import can_line
from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.canopen import Server

#: Each reading in one of them at least.
SHAPES = {
    'full': {},
    'narrow': {
        'canopen_types': 'narrow', 'canopen_sub_indices': 'from_zero', 'canopen_error_log': '4F7D',
    },
    'wide': {'canopen_types': 'wide', 'canopen_profile': 'minimal'},
    'bare': {
        'canopen_profile': 'bare', 'canopen_error_log': 'none', 'canopen_bus_mode': 'free',
    },
    'guarded': {'canopen_watch': 'guarding', 'canopen_sub_indices': 'from_zero'},
}
EACH_SHAPE = pytest.mark.parametrize('shape', SHAPES)
METHODS = pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
#: A fault whose status is a code of its own: Overload.
OVERLOAD = 5

pytestmark = pytest.mark.usefixtures('unhurried')


@EACH_SHAPE
@METHODS
@pytest.mark.parametrize('turnaround', [0.003, 0.05] if FULL else [0.003])
def test_a_ride_over_each_shape_of_the_node(
    tmp_path: Path, shape: str, method: str, turnaround: float
) -> None:
    with CanopenRig(
        tmp_path, control_method=method, drive_timeout=20.0, options=SHAPES[shape],
        line={'turnaround': turnaround},
    ) as rig:
        rig.connect()
        assert not rig.told(Cause.OWN_TIMEOUT_NOT_TAKEN)
        with rig.turning(-10.0):
            # nobody has asked for it to be acknowledged: the fault stays, and the motor stands
            rig.touch(lambda: rig.far.trip(OVERLOAD))
            wait_until(lambda: rig.told(Cause.STOPPED_BECAUSE_OF_FAULT))
            rig.still()
            assert rig.far.faults.codes == [OVERLOAD]
            if shape != 'bare':
                # and its entry of the log is found wherever it stands
                wait_until(lambda: rig.notes[1].entries)
            assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
            rig.still()
        with rig.turning(10.0):
            assert 'stopp' in rig.answer(rig.drive.stop())
            rig.still()
        answer = rig.answer(rig.drive.disconnect(PATIENCE))
        assert ('the bus keeps control' in answer) == (shape != 'bare'), answer
        # as it was found: whoever watches has nothing to watch for
        assert rig.far.peek('serial.sio_tot') == 0
        assert not rig.far.faults.codes
        rig.touch(lambda: rig.far.advance(30.0))
        assert not rig.far.faults.codes


@pytest.mark.parametrize('shape', ['full', 'guarded', 'wide'])
def test_the_drive_stops_when_the_driver_is_gone(tmp_path: Path, shape: str) -> None:
    # a driver that finds the drive lost on a slow machine would stop it before
    with CanopenRig(tmp_path, drive_timeout=4.0, options=SHAPES[shape]) as rig:
        rig.connect()
        with rig.turning():
            # the worker ends without a word, as by SIGKILL
            rig.bus._stopping = True
            rig.bus.wake(None)
            wait_until(lambda: rig.far.faults.codes in ([14], [15]))
            wait_until(lambda: not rig.far.motor.driven)


@pytest.mark.parametrize('shape', ['full', 'guarded'])
def test_the_drive_watches_before_the_motor_starts(tmp_path: Path, shape: str) -> None:
    with CanopenRig(tmp_path, drive_timeout=4.0, options=SHAPES[shape]) as rig:
        rig.connect()
        rig.drive.enable().result(PATIENCE)
        rig.bus._stopping = True
        rig.bus.wake(None)
        wait_until(lambda: rig.far.faults.codes in ([14], [15]))


def test_the_watch_outlives_an_idle_driver(tmp_path: Path) -> None:
    with CanopenRig(tmp_path, drive_timeout=8.0, poll_rate=0.2, telemetry_rate=0.0) as rig:
        rig.connect()
        asked = rig.drive.statistics.transactions
        wait_until(lambda: rig.drive.statistics.transactions > asked + 2)
        assert not rig.far.faults.codes


def test_a_watch_that_could_not_be_changed_is_ended_all_the_same(tmp_path: Path) -> None:
    with CanopenRig(tmp_path, drive_timeout=5.0, response_timeout=1.0, retries=0) as rig:
        rig.connect()
        rig.simulator.inject('silence', seconds=3600.0)
        assert 'did not answer' in rig.answer(rig.drive.set_drive_timeout(6.0))
        rig.simulator.inject('silence', seconds=0.0)
        server = rig.far.servers['canopen']
        assert isinstance(server, Server)
        # its consumer heartbeat, whose time is the low half
        assert server.read(0x1016, 1)[:2] == (5000).to_bytes(2, 'little')
        rig.answer(rig.drive.disconnect(PATIENCE))
        assert server.read(0x1016, 1) == bytes(4)


def test_a_drive_that_started_anew_is_disarmed_at_once(tmp_path: Path) -> None:
    # its silence alone would say so after a minute
    with CanopenRig(tmp_path, lost_after=60.0, line={'boot_time': 0.01}) as rig:
        rig.connect()
        with rig.turning():
            rig.touch(lambda: rig.far.power_cycle())
            wait_until(lambda: rig.told('as its boot-up message says'))
            assert not rig.drive.armed
            wait_until(lambda: rig.drive.snapshot.connected)
            rig.still()
            # the watch of the old days is forgotten with everything else
        with rig.turning():
            pass


def test_a_long_ramp_leaves_no_fault_behind(tmp_path: Path) -> None:
    with CanopenRig(
        tmp_path, drive_timeout=4.0, parameters={'control.retard': 30.0},
        options=SHAPES['wide'],
    ) as rig:
        rig.connect()
        with rig.turning(20.0):
            pass
        assert 'left to its ramp' in rig.answer(rig.drive.disconnect(0.1))
        assert rig.far.peek('serial.sio_tot') == 0
        rig.bus.close()
        rig.touch(lambda: rig.far.advance(60.0))
        assert not rig.far.faults.codes


def test_only_watched_and_yet_in_bus_mode(tmp_path: Path) -> None:
    with CanopenRig(tmp_path, control_method='monitor') as rig:
        rig.connect()
        assert rig.told('only watched, and yet the CANopen module holds the drive in bus mode')


def test_an_adapter_is_unplugged_and_back(tmp_path: Path) -> None:
    with CanopenRig(tmp_path) as rig:
        rig.connect()
        with rig.turning():
            rig.simulator.inject('hangup', 2.0)
            wait_until(lambda: rig.told('is the adapter unplugged?'))
            wait_until(lambda: rig.drive.snapshot.connected)
            rig.still()
            assert not rig.drive.armed


def test_of_two_nodes_one_is_silent(tmp_path: Path) -> None:
    with CanopenRig(
        tmp_path, addresses=(1, 2), lost_after=5.0, response_timeout=0.3
    ) as rig:
        rig.connect()
        with rig.turning():
            rig.touch(lambda: rig.simulator.drives[2].silence(1000.0))
            wait_until(lambda: rig.notes[2].told('did not answer'))
            assert rig.drive.armed
            before = len(rig.notes[1].snapshots)
            wait_until(lambda: len(rig.notes[1].snapshots) > before + 5)
            assert 'stopp' in rig.answer(rig.drive.stop())


def test_a_wrong_bit_rate_says_what_to_check(tmp_path: Path) -> None:
    with CanopenRig(tmp_path, line={'baud': 250_000}) as rig:
        with pytest.raises(DriveError):
            rig.drive.connect().result(PATIENCE)
        for _ in range(9):
            answer = rig.answer(rig.drive.connect(patient=False))
        assert 'with this bit rate?' in answer and 'the node id, the bit rate' in answer


def test_a_lost_answer_to_the_end_of_the_watch_is_no_failed_clean_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with CanopenRig(tmp_path, drive_timeout=5.0, retries=0) as rig:
        rig.connect()
        link = rig.bus._link
        write = link.write

        def lose(unit: int, address, data: bytes):
            if address.index == 0x1016:
                write(unit, address, data)
                raise NoAnswer('unit 1 did not answer')
            return write(unit, address, data)

        monkeypatch.setattr(link.supervision, '_write', lose)
        assert 'the bus keeps control' in rig.answer(rig.drive.disconnect(PATIENCE))
        assert rig.told(Cause.WATCH_LEFT)


def test_the_motor_of_a_node_that_another_master_stops_stands(tmp_path: Path) -> None:
    with CanopenRig(tmp_path, lost_after=1.0, response_timeout=0.2) as rig:
        rig.connect()
        with rig.turning(20.0):
            server = rig.far.servers['canopen']
            assert isinstance(server, Server)
            stop = Frame(0, bytes((2, 1)))
            rig.touch(lambda: list(server.receive(stop, time.monotonic())))
            wait_until(lambda: rig.told(Cause.LOST_IN_USE))
            rig.still()


def test_another_sdo_client_is_reported_and_nothing_of_it_is_published(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # it writes an object that the driver reads, and reads a text in segments
    foreign = ('2B7B200009090000', '400A100000000000', '6000000000000000', '7000000000000000')
    frames = tuple(Frame(0x601, bytes.fromhex(data)) for data in foreign)
    monkeypatch.setattr(can_line, '_FOREIGN', frames)
    with CanopenRig(tmp_path) as rig:
        rig.connect()
        with rig.turning(20.0):
            rig.notes[1].snapshots.clear()
            rig.simulator.inject('traffic', 50.0)
            wait_until(lambda: rig.bus.statistics().foreign_frames >= 50)
            wait_until(lambda: rig.notes[1].snapshots)
            assert all(abs(shown.actual - 20) < 0.5 for shown in rig.notes[1].snapshots)
            (remark,) = rig.bus.remarks
            assert 'another SDO client asks node 1' in remark
            assert not rig.told(Cause.LOST_IN_USE)
