# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The operating record of one drive: counted, published, kept in its file, and a new shift.

The bus only puts what it has into a queue. It is counted on the publish queue, once a second; each
access to the disk has a short thread of its own.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
import contextlib
import logging
import threading
import time
from typing import NamedTuple, TypeVar

from nfo_sinus_msgs.msg import OperatingRecord
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from std_srvs.srv import Trigger

from nfo_sinus_driver.drive import Report, Snapshot, Telemetry
from nfo_sinus_driver.node.drive.callers import Call
from nfo_sinus_driver.node.drive.managed_drive import ManagedDrive
from nfo_sinus_driver.node.messages import messages
from nfo_sinus_driver.node.ros.publish_queue import PublishQueue
from nfo_sinus_driver.node.ros.qos import COMMANDS, LATCHED
from nfo_sinus_driver.operating_record.counting import Counting
from nfo_sinus_driver.operating_record.figures import Figures, Record
from nfo_sinus_driver.operating_record.files import DamagedRecord, RecordFile
from nfo_sinus_driver.operating_record.maintenance import Limit, limits
from nfo_sinus_driver.state_folder import in_background

_T = TypeVar('_T')
_log = logging.getLogger(__name__)

#: How often it is counted, and how often published and kept where nothing happens, s.
_PERIOD, _KEEP_PERIOD = 1.0, 60.0
#: So many statuses wait to be counted at most.
_MOST = 30_000
#: A shorter time without a status is no silence, s.
_LEAST_SILENCE = 0.2
#: How long counting waits for a file, s: until then all of it waits.
_LONGEST_LOAD = 10.0
#: How often a file that cannot be used is tried at once before that is a warning: the driver
#: before this one may just be ending.
_TRIES = 5


class _Connected(NamedTuple):
    """
    The drive was connected to.

    :ivar drive: its name.
    :ivar serial: its serial number; ``''``: none can be read.
    """

    drive: str
    serial: str


class OperatingRecorder:
    """
    Keeps the operating record of the drive of one node.

    :param line: names the line, where a drive has no serial number.
    :param managed: returns the drive; not called before the bus works.
    :ivar due: the maintenance that is due; ``''``: none.
    :ivar maintenance: how far each limit of it is.
    """

    def __init__(
        self,
        node: Node,
        queue: PublishQueue,
        line: str,
        managed: Callable[[], ManagedDrive],
    ) -> None:
        self._node = node
        self._log = node.get_logger()
        self._queue = queue
        self._line = line
        self._managed = managed
        #: What the bus has put here, in its order, and whether the drive was connected.
        self._waiting: deque[Snapshot | Telemetry | _Connected | int] = deque(maxlen=_MOST)
        self._connected = False
        self._last_at = 0.0
        #: One thread after the other has what follows.
        self._turn = threading.Lock()
        self._drive = _Connected('', '')
        self._counting: Counting | None = None
        #: Why the drive that was connected before was stopped last.
        self._stop_before: Report | None = None
        self._ended = False
        self._file: RecordFile | None = None
        self._loading: Future[Record | None] | None = None
        self._loading_since = 0.0
        self._saving: Future[None] | None = None
        self._is_loaded = False
        self._failures = 0
        #: What was published last, and what of that is not in the file; when, and after how many
        #: stops and faults.
        self._shown = self._unsaved = b''
        self._shown_at = 0.0
        self._events = 0
        self._logged: set[Limit] = set()
        self.due = self.maintenance = ''
        self._publisher = node.create_publisher(OperatingRecord, '~/operating_record', LATCHED)
        node.create_service(
            Trigger,
            '~/begin_shift',
            self._on_begin_shift,
            qos_profile=COMMANDS,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        queue.put_every(_PERIOD, self._work)

    # --- called by the bus --------------------------------------------------------------------

    def take_status(self, snapshot: Snapshot) -> None:
        """Have a status counted."""
        if snapshot.connected is not self._connected:
            self._connected = snapshot.connected
            self._note_connection()
        elif snapshot.connected and snapshot.at > self._last_at + _LEAST_SILENCE:
            self._waiting.append(self._line_errors())
        self._last_at = snapshot.at
        self._waiting.append(snapshot)

    def take_telemetry(self, telemetry: Telemetry) -> None:
        """Have measured values counted."""
        self._waiting.append(telemetry)

    def _note_connection(self) -> None:
        drive = self._managed().drive
        if self._connected:
            settings, identity = drive.settings, drive.identity
            serial = identity.own_serial if identity else ''
            place = (self._line, settings.address, *filter(None, (settings.block_address,)))
            name = ' '.join(map(str, (drive.model.name, *((serial,) if serial else place))))
            self._waiting.append(_Connected(name, serial))
        self._waiting.append(self._line_errors())

    def _line_errors(self) -> int:
        statistics = self._managed().drive.statistics
        return statistics.timeouts + statistics.damaged

    # --- on the queue's thread, or for a service ----------------------------------------------

    def _work(self) -> None:
        with self._turn:
            self._count()
            if self._counting is not None:
                self._check_maintenance(self._counting.record.total)
                self._show_and_keep(self._counting)

    def _count(self) -> None:
        """Count all that waits, unless a file has to be read first."""
        self._take_from_disk()
        if self._loading is not None and self._counting is None:
            if time.monotonic() < self._loading_since + _LONGEST_LOAD:
                return
            self._failures = _TRIES - 1
            self._fail(TimeoutError(f'the disk has not answered for {_LONGEST_LOAD:g} s'))
            self._begin(None)
        while self._waiting:
            what = self._waiting.popleft()
            if isinstance(what, _Connected):
                if what != self._drive:
                    self._change_drive(what)
                    return
            elif self._counting is None:
                # no drive was connected yet
                continue
            elif isinstance(what, Snapshot):
                self._counting.take_status(what)
            elif isinstance(what, Telemetry):
                self._counting.take_telemetry(what)
            else:
                self._counting.take_line_errors(what)

    def _change_drive(self, drive: _Connected) -> None:
        """Go on with the record of another drive, once it was read."""
        before, file, data = self._counting, self._file, b''
        if before is not None:
            self._stop_before = before.stop
            data = before.record.encoded() if self._is_loaded else b''
        self._drive, self._counting, self._is_loaded = drive, None, False
        self._failures = 0
        self._show_anew()
        if not drive.serial:
            self._log.info(
                f'the operating record is that of {drive.drive}, for no serial number can be read: '
                'what another drive does at this place is counted in it, too'
            )
        saving, self._saving = self._saving, None

        def change() -> Record | None:
            if saving is not None:
                wait((saving,))
            if file is not None:
                if data:
                    with contextlib.suppress(OSError):
                        file.save(data)
                file.close()
            self._file = None
            return self._open()

        self._load(change)

    def _open(self) -> Record | None:
        if self._file is None:
            self._file = RecordFile(self._drive.drive)
        return self._file.load()

    def _load(self, load: Callable[[], Record | None]) -> None:
        self._loading_since = time.monotonic()
        self._loading = _on_thread(load)

    def _begin(self, kept: Record | None) -> None:
        """Count from now on, into the record that was kept if there is one."""
        record = kept or Record.begun(*self._drive, now=time.time())
        self._counting = Counting(
            record, lambda at: time.time() - time.monotonic() + at, self._stop_before
        )

    def _take_from_disk(self) -> None:
        """Take what was read or written meanwhile."""
        if self._loading is not None and self._loading.done():
            loading, self._loading = self._loading, None
            kept = None
            try:
                kept = loading.result()
                self._is_loaded, self._failures = True, 0
            except DamagedRecord as error:
                self._is_loaded, self._failures = True, 0
                self._log.warning(f'a new operating record begins: {error}')
            except OSError as error:
                self._fail(error)
            finally:
                if self._counting is None:
                    self._begin(kept)
                elif kept is not None:
                    self._counting.continue_from(kept)
                    self._show_anew()
        if self._saving is not None and self._saving.done():
            saving, self._saving = self._saving, None
            try:
                saving.result()
                self._failures = 0
            except OSError as error:
                self._failures = max(self._failures, _TRIES - 1)
                self._fail(error)

    def _show_anew(self) -> None:
        """Publish and keep it at once; what was not kept yet is old."""
        self._shown = self._unsaved = b''

    def _fail(self, error: OSError) -> None:
        self._failures += 1
        if self._failures == _TRIES:
            self._log.warning(
                f'the operating record of {self._drive.drive} is kept in memory alone: {error}'
            )

    def _check_maintenance(self, total: Figures) -> None:
        found = self._limits()
        passed = [limit for limit in found if limit.is_passed(total)]
        self.maintenance = ', '.join(limit.shown(total) for limit in found)
        self.due = ', '.join(limit.shown(total) for limit in passed)
        for limit in passed:
            if limit not in self._logged:
                self._logged.add(limit)
                name = self._node.get_fully_qualified_name()
                self._log.warning(
                    f'maintenance is due: {limit.shown(total)}; when it is done, raise its limit '
                    f'in the parameter maintenance of {name}'
                )

    def _limits(self) -> Sequence[Limit]:
        return limits(self._node.get_parameter('maintenance').value)

    def _show_and_keep(self, counting: Counting) -> None:
        """Publish and keep the record after each stop and fault, else once in a minute."""
        record = counting.record
        total = record.total
        events = total.stops.total() + sum(fault.count for fault in total.faults.values())
        is_regular = time.monotonic() >= self._shown_at + _KEEP_PERIOD
        if self._loading is None and not self._is_loaded and (
            is_regular or self._failures < _TRIES
        ):
            self._load(self._open)
        if self._shown and events == self._events and not is_regular:
            self._save()
            return
        if self._connected:
            counting.take_line_errors(self._line_errors())
        self._events, self._shown_at = events, time.monotonic()
        data = record.encoded()
        if data == self._shown:
            return
        self._shown = self._unsaved = data
        stored = self._is_loaded and not self._failures
        stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(messages.operating_record(record, stamp, stored=stored))
        self._save()

    def _save(self) -> None:
        """Have the file replaced, unless that goes on already: then with the next call."""
        file, data = self._file, self._unsaved
        if data and self._is_loaded and file is not None and self._saving is None:
            self._unsaved = b''
            self._saving = _on_thread(lambda: file.save(data))

    # --- any thread ---------------------------------------------------------------------------

    def _on_begin_shift(self, _: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:
        call = Call(self._node, '~/begin_shift')
        try:
            self._begin_shift(answer)
        except Exception as error:
            # an exception that leaves a service callback would end the executor
            name = self._node.get_fully_qualified_name()
            _log.exception('error in a service of %s', name)
            answer.message = f'error in the driver: {error}'
        self._queue.put(self._work)
        call.find()
        call.log(answer.message, success=answer.success)
        return answer

    def _begin_shift(self, answer: Trigger.Response) -> None:
        with self._turn:
            self._count()
            counting = self._counting
            if self._ended:
                answer.message = 'no shift was begun: this driver is ending'
            elif counting is None:
                answer.message = 'no shift was begun: no drive has been connected yet'
            else:
                ended = counting.record.begin_shift(time.time())
                self._show_anew()
                answer.success = True
                answer.message = f'a shift has begun; the one before: {_summary(ended)}'

    def end(self) -> None:
        """Begin to keep all that was counted; the bus and the queue have ended."""
        with self._turn:
            self._ended = True
            self._count()
            counting, file = self._counting, self._file
            if counting is not None:
                counting.take_line_errors(self._line_errors())
            loading, saving = self._loading, self._saving
            is_loaded, self._loading = self._is_loaded, None

        def keep() -> None:
            if saving is not None:
                wait((saving,))
            if counting is None or file is None:
                return
            if loading is not None and not is_loaded:
                kept = None
                with contextlib.suppress(DamagedRecord):
                    kept = loading.result()
                if kept is not None:
                    counting.continue_from(kept)
            if is_loaded or loading is not None:
                file.save(counting.record.encoded())

        self._saving = _on_thread(keep)

    def join(self, timeout: float) -> None:
        """Wait until it is kept, for a limited time (s)."""
        assert self._saving is not None
        wait((self._saving,), timeout)
        self._take_from_disk()


def _on_thread(work: Callable[[], _T]) -> Future[_T]:
    """Do what may wait for a disk on a thread of its own."""
    future: Future[_T] = Future()

    def do() -> None:
        try:
            future.set_result(work())
        except BaseException as error:
            future.set_exception(error)

    in_background(do)
    return future


def _summary(figures: Figures) -> str:
    energy = '' if figures.energy is None else f', {figures.energy_kwh:.2f} kWh'
    faults = sum(fault.count for fault in figures.faults.values())
    return (
        f'{figures.running_time:.2f} h running of {figures.powered_time:.2f} h connected, starts: '
        f'{figures.starts}, stops: {figures.stops.total()}, faults: {faults}{energy}'
    )
