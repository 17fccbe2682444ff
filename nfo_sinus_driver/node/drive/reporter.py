# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Publishes what a drive reports: topics, diagnostics and log lines."""

from __future__ import annotations

from collections.abc import Callable, Collection
import math
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nfo_sinus_msgs.msg import (
    BusStatistics,
    DriveStatus,
    ErrorLogEntry,
    InvSt,
    Measured,
    Telemetry as TelemetryMessage,
)
from rcl_interfaces.msg import Log
from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message
from rclpy.time import Time as NodeTime
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.drive import Cause, Event, LogEntry, Report, Severity, Snapshot, Telemetry
from nfo_sinus_driver.node.bags.black_box import BlackBox
from nfo_sinus_driver.node.drive import diagnostics
from nfo_sinus_driver.node.drive.managed_drive import ManagedDrive
from nfo_sinus_driver.node.drive.operating_recorder import OperatingRecorder
from nfo_sinus_driver.node.messages import messages
from nfo_sinus_driver.node.messages.messages import Joint
from nfo_sinus_driver.node.messages.serialized import Stamped, float32
from nfo_sinus_driver.node.messages.stamps import Sequence, Stamps
from nfo_sinus_driver.node.messages.wording import Wording
from nfo_sinus_driver.node.ros.publish_queue import PublishQueue
from nfo_sinus_driver.node.ros.qos import KEPT, LATCHED, RELIABLE, ROSOUT

#: How often the statistics go out and, while the drive is not connected, the status, s.
_PERIOD = 1.0
_LEVELS = {
    Severity.INFO: Log.INFO, Severity.WARNING: Log.WARN, Severity.ERROR: Log.ERROR
}
#: What a bag of the black box tells of: stops that were not asked for, faults, losses.
_TESTIFIES = frozenset((
    Cause.STOPPED_BECAUSE, Cause.STOPPED_BECAUSE_OF_FAULT, Cause.STOPPING_BECAUSE,
    Cause.FAULT_APPEARED, Cause.LOST, Cause.LOST_IN_USE, Cause.CANNOT_STOP,
))


class Reporter:
    """
    The listener of one drive.

    Its ``on_…`` methods are called by the bus and only put something into the queue; everything
    else runs on the queue's thread.

    :param record: the operating record of the drive.
    :param managed: returns the drive; not called before the queue works.
    :param follow: called by the bus with the parameters that have new values.
    """

    def __init__(
        self,
        node: LifecycleNodeMixin,
        queue: PublishQueue,
        black_box: BlackBox,
        wording: Wording,
        joint: Joint,
        record: OperatingRecorder,
        managed: Callable[[], ManagedDrive],
        follow: Callable[[Collection[str]], None],
    ) -> None:
        self._node = node
        self._queue = queue
        self._wording = wording
        self._joint = joint
        self._record = record
        self._managed = managed
        self._follow = follow
        self._log = node.get_logger()
        self._stamps = Stamps(lambda: node.get_clock().now().nanoseconds)
        # the stamp of a poll is when it was answered, that of a drive not connected is the clock
        self._status_stamps = Sequence(self._stamps)
        self._telemetry_stamps = Sequence(self._stamps)
        #: Why it stopped last, and the sentence for it; the caller may be known a moment later.
        self._stop: Report | None = None
        self._stop_text = ''
        self._last_inv_st: tuple[int, Kind] | None = None
        self._verdict: tuple[bytes, str] | None = None
        self._diagnosis = diagnostics.Diagnosis()
        self._whole_name = node.get_fully_qualified_name().lstrip('/')
        self._pack_status = Stamped(DriveStatus).pack
        create = node.create_lifecycle_publisher
        # these are published from the start, in any lifecycle state
        self._status = node.create_publisher(DriveStatus, '~/status', RELIABLE)
        self._inv_st = node.create_publisher(InvSt, '~/inv_st', LATCHED)
        self._log_entries = node.create_publisher(ErrorLogEntry, '~/error_log_entry', KEPT)
        self._statistics = node.create_publisher(BusStatistics, '~/statistics', RELIABLE)
        self._diagnostics = node.create_publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        self._speed = create(Float32, '~/actual_speed', RELIABLE)
        self._frequency = create(Float32, '~/actual_frequency', RELIABLE)
        self._joint_states = create(JointState, '~/joint_states', RELIABLE)
        self._telemetry = create(TelemetryMessage, '~/telemetry', RELIABLE)
        self._measured = create(Measured, '~/measured', RELIABLE)
        self._black_box = black_box
        topic, stream = node.resolve_topic_name, black_box.stream
        # the same messages as those that are published
        self._keep_status = stream(topic('~/status'), DriveStatus, RELIABLE, self._as_status)
        self._keep_speed = stream(
            topic('~/actual_speed'), Float32, RELIABLE, lambda _, speed: float32(speed)
        )
        self._keep_telemetry = stream(
            topic('~/telemetry'), TelemetryMessage, RELIABLE, self._as_telemetry
        )
        self._keep_inv_st = stream(
            topic('~/inv_st'), InvSt, LATCHED, self._as_inv_st, holds=True
        )
        self._keep_diagnosis = stream(
            '/diagnostics', DiagnosticArray, RELIABLE, lambda _, data: data, holds=True
        )
        self._keep_log = stream('/rosout', Log, ROSOUT, self._as_log)
        #: There were subscribers to what each poll gives, when the last one was published.
        self._heard = False
        self._newest: object = None
        self._snapshots = queue.stream(self._publish_snapshot, self._is_urgent)
        queue.put_every(_PERIOD, self._report_regularly)

    # --- called by the bus --------------------------------------------------------------------

    def on_snapshot(self, snapshot: Snapshot) -> None:
        """Publish a poll, or what has changed since."""
        self._snapshots(snapshot)
        self._record.take_status(snapshot)
        self._keep_status(snapshot.at, snapshot)
        if snapshot.polled and not math.isnan(snapshot.speed):
            self._keep_speed(snapshot.at, snapshot.speed)

    def on_telemetry(self, telemetry: Telemetry) -> None:
        """Publish measured values."""
        self._queue.put(lambda: self._publish_telemetry(telemetry))
        self._record.take_telemetry(telemetry)
        self._keep_telemetry(telemetry.at, telemetry)

    def on_parameters(self, keys: Collection[str]) -> None:
        """Have the ROS parameters follow the drive."""
        self._follow(keys)

    def on_log_entry(self, entry: LogEntry) -> None:
        """Publish a new entry of the error log."""
        self._queue.put(lambda: self._publish_log_entry(entry))

    def on_event(self, event: Event) -> None:
        """Log a line."""
        self._queue.put(lambda: self._log_event(event))

    def _is_urgent(self, snapshot: Snapshot) -> bool:
        """Return whether a snapshot is awaited, or shows other things than the one before."""
        before = self._newest
        self._newest = shown = (
            snapshot.connected, snapshot.enabled, snapshot.text, snapshot.kind, snapshot.stop
        )
        return self._heard or shown != before

    # --- on any thread ------------------------------------------------------------------------

    def stamp(self, at: float) -> Time:
        """Return the node's time of a moment of ``time.monotonic``, 0 for NaN."""
        return _message(self._stamps.of(at))

    # --- on the queue's thread ----------------------------------------------------------------

    def _log_event(self, event: Event) -> None:
        text = self._wording.say(event.report)
        self._keep_log(time.monotonic(), (_LEVELS[event.severity], text))
        if event.cause in _TESTIFIES:
            self._black_box.testify(f'{self._whole_name}: {text}')
        # one call site for each level: rclpy forbids another level at the same place
        if event.severity is Severity.ERROR:
            self._log.error(text)
        elif event.severity is Severity.WARNING:
            self._log.warning(text)
        else:
            self._log.info(text)

    def _frame_id(self) -> str:
        frame_id: str = self._node.get_parameter('frame_id').value
        return frame_id

    def _publish_snapshot(self, snapshot: Snapshot) -> None:
        status = snapshot.status
        of_each_poll = (self._status, self._frequency, self._speed, self._joint_states)
        heard = {publisher for publisher in of_each_poll if _is_heard(publisher)}
        self._heard = bool(heard)
        self._diagnose(snapshot)
        if snapshot.polled:
            self._joint.move(snapshot)
        else:
            # nothing was measured
            heard &= {self._status}
        inv_st = self._last_inv_st if status is None else (status.code, snapshot.kind)
        # a message costs as much as a transaction, heard or not; why it stopped goes out always
        stop_is_new = snapshot.stop is not self._stop
        if not (heard or stop_is_new or inv_st != self._last_inv_st):
            return
        stamp = _message(self._status_stamps.next(snapshot.at))
        if self._status in heard or stop_is_new:
            self._publish_status(snapshot, stamp)
        if status is None:
            return
        if self._frequency in heard:
            self._frequency.publish(float32(snapshot.frequency))
        if self._speed in heard:
            self._speed.publish(float32(snapshot.speed))
        if self._joint_states in heard:
            self._joint_states.publish(self._joint.state(stamp, self._frame_id()))
        if inv_st != self._last_inv_st:
            self._last_inv_st = inv_st
            self._inv_st.publish(messages.inv_st(snapshot, stamp, self._frame_id()))
            self._keep_inv_st(snapshot.at, snapshot)

    def _publish_status(self, snapshot: Snapshot, stamp: Time) -> None:
        if snapshot.stop is not self._stop:
            self._say_stop(snapshot)
        scale = self._managed().scale
        fields = messages.drive_status(snapshot, scale, self._stop_text)
        self._status.publish(self._pack_status(stamp, self._frame_id(), fields))

    def _say_stop(self, snapshot: Snapshot) -> None:
        self._stop = snapshot.stop
        self._stop_text = self._wording.say(self._stop)

    def _publish_telemetry(self, telemetry: Telemetry) -> None:
        stamp = _message(self._telemetry_stamps.next(telemetry.at))
        frame_id = self._frame_id()
        if _is_heard(self._telemetry):
            self._telemetry.publish(messages.telemetry(telemetry, stamp, frame_id))
        if _is_heard(self._measured):
            model = self._managed().drive.model
            self._measured.publish(messages.measured(telemetry, model, stamp, frame_id))

    def _publish_log_entry(self, entry: LogEntry) -> None:
        self._log_entries.publish(messages.error_log_entry(entry, self.stamp(entry.at)))

    def _report_regularly(self) -> None:
        snapshot = self._managed().drive.snapshot
        self._say_stop(snapshot)
        if not snapshot.connected:
            stamp = _message(self._status_stamps.next(time.monotonic()))
            self._publish_status(snapshot, stamp)
        self._publish_statistics()

    def _publish_statistics(self) -> None:
        if not _is_heard(self._statistics):
            return
        managed = self._managed()
        silent = [managed.name] if managed.is_silent else []
        stamp = _message(self._stamps.now())
        statistics = managed.drive.statistics
        self._statistics.publish(messages.bus_statistics(statistics, silent, stamp))

    def _diagnose(self, snapshot: Snapshot) -> None:
        """Publish the diagnosis of the drive if it has changed."""
        verdict = diagnostics.drive_verdict(self._managed(), snapshot, self._record.due)
        if verdict != self._verdict:
            stamp = _message(self._stamps.now())
            array = diagnostics.array(stamp, self._diagnosis_of(snapshot))
            self._diagnostics.publish(array)
            if self._black_box.is_on:
                # at once: the next diagnosis is made of the same object
                self._keep_diagnosis(snapshot.at, serialize_message(array))

    def diagnosis(self) -> DiagnosticStatus:
        """Return the present diagnosis of the drive, good until the next call."""
        return self._diagnosis_of(self._managed().drive.snapshot)

    # --- for the black box --------------------------------------------------------------------

    def _as_status(self, at: float, snapshot: Snapshot) -> bytes:
        text = self._wording.say(snapshot.stop)
        fields = messages.drive_status(snapshot, self._managed().scale, text)
        return self._pack_status(self.stamp(at), self._frame_id(), fields)

    def _as_telemetry(self, at: float, telemetry: Telemetry) -> bytes:
        message = messages.telemetry(telemetry, self.stamp(at), self._frame_id())
        return bytes(serialize_message(message))

    def _as_inv_st(self, at: float, snapshot: Snapshot) -> bytes:
        return bytes(
            serialize_message(messages.inv_st(snapshot, self.stamp(at), self._frame_id()))
        )

    def _as_log(self, at: float, line: tuple[int, str]) -> bytes:
        level, text = line
        name = self._whole_name.replace('/', '.')
        return bytes(
            serialize_message(Log(stamp=self.stamp(at), level=level, name=name, msg=text))
        )

    def _diagnosis_of(self, snapshot: Snapshot) -> DiagnosticStatus:
        managed = self._managed()
        self._verdict = diagnostics.drive_verdict(managed, snapshot, self._record.due)
        return diagnostics.drive_status(
            self._diagnosis,
            self._whole_name,
            managed,
            snapshot,
            self._verdict,
            self._record.maintenance,
        )


def _is_heard(publisher: Publisher) -> bool:
    return publisher.get_subscription_count() > 0


def _message(nanoseconds: int) -> Time:
    stamp: Time = NodeTime(nanoseconds=nanoseconds).to_msg()
    return stamp
