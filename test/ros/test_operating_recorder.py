# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The recorder of one drive where the disk is slow or full, or another drive comes; no process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from builtin_interfaces.msg import Time
import pytest
from std_srvs.srv import Trigger

from nfo_sinus_driver.drive import Cause, Identity, Report, Snapshot
from nfo_sinus_driver.node.drive import operating_recorder
from nfo_sinus_driver.node.drive.operating_recorder import OperatingRecorder
from nfo_sinus_driver.operating_record import files
from nfo_sinus_driver.operating_record.figures import Record


class Drive:
    """What a node knows of a drive that stands or runs."""

    def __init__(self, serial: str) -> None:
        self.settings = SimpleNamespace(address=3, block_address=0)
        self.model = SimpleNamespace(name='a_family')
        self.statistics = SimpleNamespace(timeouts=0, damaged=0)
        self.identity = Identity(serial=serial)


class Recorded:
    """A recorder, its node, and a disk that works when the test wants it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 1000.0
        self.drive = Drive('one')
        self.said: list[str] = []
        self.published: list[Any] = []
        #: What waits for the disk; ``None``: it answers at once.
        self.waiting: list[Callable[[], None]] | None = None
        monkeypatch.setattr(operating_recorder, 'in_background', self._in_background)
        monkeypatch.setattr(operating_recorder.time, 'monotonic', lambda: self.now)
        monkeypatch.setattr(operating_recorder, 'Call', lambda *_: SimpleNamespace(
            find=lambda: None, log=lambda *_, **__: None
        ))
        log = SimpleNamespace(info=self.said.append, warning=self.said.append)
        clock = SimpleNamespace(now=lambda: SimpleNamespace(to_msg=Time))
        publisher = SimpleNamespace(publish=self.published.append)
        node = SimpleNamespace(
            get_logger=lambda: log,
            get_clock=lambda: clock,
            get_parameter=lambda _: SimpleNamespace(value=['']),
            create_publisher=lambda *_: publisher,
            create_service=lambda *_, **__: None,
            get_fully_qualified_name=lambda: '/a',
        )
        queue = SimpleNamespace(put_every=lambda *_: None, put=lambda work: work())
        managed = SimpleNamespace(drive=self.drive)
        self.managed = managed
        recorder: Any = OperatingRecorder(
            node, queue, '/dev/ttyUSB0', lambda: managed  # type: ignore[arg-type]
        )
        self.recorder = recorder

    def _in_background(self, work: Callable[[], None]) -> None:
        if self.waiting is None:
            work()
        else:
            self.waiting.append(work)

    def answer(self) -> None:
        """Have the disk do what waits, and answer from now on."""
        waiting, self.waiting = self.waiting or [], None
        for work in waiting:
            work()

    def pass_time(self, seconds: int, *, runs: bool = False, stop: Report | None = None) -> None:
        """Have the drive publish a status each second, and the recorder work as often."""
        status: Any = SimpleNamespace(
            driven=runs, unknown=False, code=0, at=self.now, means=lambda *_: False
        )
        for _ in range(seconds):
            self.now += 1.0
            self.recorder.take_status(
                Snapshot(self.now, True, False, '', status=status, stop=stop)
            )
            self.recorder._work()

    def lose(self, stop: Report | None = None) -> None:
        self.now += 1.0
        self.recorder.take_status(Snapshot(self.now, False, False, '', stop=stop))

    def call_begin_shift(self) -> Trigger.Response:
        answer: Trigger.Response = self.recorder._on_begin_shift(None, Trigger.Response())
        return answer

    def end(self) -> None:
        self.recorder.end()
        self.recorder.join(0.0)

    def close(self) -> None:
        """Leave the file to another program, as the end of this one does."""
        self.recorder._file.close()


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Recorded:
    monkeypatch.setenv('XDG_STATE_HOME', str(tmp_path))
    return Recorded(monkeypatch)


def kept() -> dict[str, Record]:
    return {record.drive: record for record in files.records() if isinstance(record, Record)}


def test_all_is_kept_once_in_a_minute_and_at_the_end(recorded: Recorded) -> None:
    recorded.pass_time(3)
    assert [message.stored for message in recorded.published] == [True]
    recorded.pass_time(50)
    assert len(recorded.published) == 1
    recorded.pass_time(10)
    assert len(recorded.published) == 2
    recorded.pass_time(2, runs=True)
    recorded.pass_time(1)
    # a stop is published and kept at once
    assert len(recorded.published) == 3
    assert dict(kept()['a_family one'].total.stops) == {'NONE': 1}
    recorded.pass_time(5, runs=True)
    recorded.end()
    assert kept()['a_family one'].total.starts == 2
    assert not recorded.call_begin_shift().success


def test_while_the_disk_does_not_answer_it_goes_on_and_nothing_is_lost(
    recorded: Recorded, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded.pass_time(5, runs=True)
    recorded.end()
    recorded.close()
    again = Recorded(monkeypatch)
    again.waiting = []
    again.pass_time(5, runs=True)
    assert again.published == [] and again.said == []
    again.pass_time(20)
    assert not again.published[0].stored
    assert len([text for text in again.said if 'is kept in memory alone' in text]) == 1
    assert again.call_begin_shift().success
    again.pass_time(3)
    again.answer()
    again.pass_time(1)
    # with what was kept before, and at once
    assert again.published[-1].stored
    assert kept()['a_family one'].total.powered == (4 + 28) * 10**9
    again.pass_time(69)
    newest = again.published[-1]
    assert newest.stored and 60 < newest.total.powered_time * 3600 <= 101
    again.end()
    record = kept()['a_family one']
    assert record.total.powered == (4 + 97) * 10**9
    assert record.shift.powered == 73 * 10**9


def test_each_drive_at_one_place_has_its_own(recorded: Recorded) -> None:
    recorded.pass_time(5, runs=True)
    lost = Report(Cause.LOST)
    recorded.lose(lost)
    recorded.drive.identity = Identity(serial='two')
    recorded.pass_time(9, stop=lost)
    recorded.lose(lost)
    recorded.drive.identity = Identity(serial='000')
    recorded.pass_time(3, stop=lost)
    recorded.end()
    found = kept()
    assert {name: record.total.powered / 1e9 for name, record in found.items()} == {
        'a_family one': 4, 'a_family two': 8, 'a_family /dev/ttyUSB0 3': 2,
    }
    # the stop is that of the first
    assert dict(found['a_family one'].total.stops) == {'DRIVE_LOST': 1}
    assert not found['a_family two'].total.stops
    assert found['a_family /dev/ttyUSB0 3'].serial == ''
    (said,) = recorded.said
    assert 'no serial number can be read' in said


def test_what_is_not_written_yet_of_one_drive_never_goes_to_the_file_of_another(
    recorded: Recorded
) -> None:
    recorded.pass_time(3)
    recorded.waiting = []
    # one minute is being written, and the next one waits for that
    recorded.pass_time(130)
    recorded.lose()
    recorded.drive.identity = Identity(serial='two')
    recorded.pass_time(2)
    recorded.answer()
    recorded.pass_time(3)
    found = kept()
    assert found['a_family one'].total.powered == 132 * 10**9
    assert found['a_family two'].total.powered < 5 * 10**9
    assert found['a_family two'].serial == 'two'
    assert recorded.published[-1].serial_number == 'two'


def test_a_disk_that_is_full_is_one_warning_until_it_has_room(
    recorded: Recorded, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded.pass_time(3)

    def full(*_: object) -> None:
        raise OSError(28, 'No space left on device')

    with monkeypatch.context() as patch:
        patch.setattr(files.RecordFile, 'save', full)
        recorded.pass_time(300)
        assert [text for text in recorded.said if 'No space left' in text] == recorded.said
        assert len(recorded.said) == 1 and not recorded.published[-1].stored
    recorded.pass_time(130)
    assert recorded.published[-1].stored and len(recorded.said) == 1
    assert kept()['a_family one'].total.powered > 300 * 10**9


def test_what_has_no_record_yet_begins_no_shift(recorded: Recorded) -> None:
    answer = recorded.call_begin_shift()
    assert not answer.success and 'no drive has been connected' in answer.message
    recorded.end()
    assert not kept()
