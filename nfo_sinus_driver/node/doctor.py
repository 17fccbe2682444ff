# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What ``ros2 doctor`` reports of lines and drives; only ros2doctor imports this.

It listens to ``/diagnostics`` for a while, and calls nothing.
"""

from __future__ import annotations

import functools
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from ros2doctor.api import DoctorCheck, DoctorReport, Report, Result
from ros2doctor.api.format import doctor_error, doctor_warn

from nfo_sinus_driver.version import VERSION

#: Every node publishes its diagnostics once a second; discovery takes a moment before, s.
_LISTENS = 4.0
#: How the names of the statuses of this driver end.
_ENDS = (': drive', ': line')
_CATEGORY = 'nfo_sinus'
_LEVELS = {
    DiagnosticStatus.OK: 'ok',
    DiagnosticStatus.WARN: 'warning',
    DiagnosticStatus.ERROR: 'error',
    DiagnosticStatus.STALE: 'stale',
}


class DriveReport(DoctorReport):
    """``ros2 doctor --report``: the version, and the state of every line and drive."""

    def category(self) -> str:
        """Return what links report and check."""
        return _CATEGORY

    def report(self) -> Report:
        """Return the report."""
        report = Report('NFO SINUS DRIVER')
        report.add_to_report('version', VERSION)
        statuses = _statuses()
        if not statuses:
            report.add_to_report('drives', 'none found in this ROS_DOMAIN_ID')
        for name, status in sorted(statuses.items()):
            report.add_to_report(name, f'{_LEVELS[status.level]}: {status.message}')
        return report


class DriveCheck(DoctorCheck):
    """``ros2 doctor``: a fault, or a drive or line that does not respond, fails it."""

    def category(self) -> str:
        """Return what links report and check."""
        return _CATEGORY

    def check(self) -> Result:
        """Return the result; it is no error if no driver runs."""
        result = Result()
        for name, status in sorted(_statuses().items()):
            if status.level == DiagnosticStatus.ERROR:
                doctor_error(f'{name}: {status.message}')
                result.add_error()
            elif status.level != DiagnosticStatus.OK:
                doctor_warn(f'{name}: {status.message}')
                result.add_warning()
        return result


@functools.lru_cache(maxsize=1)
def _statuses() -> dict[str, DiagnosticStatus]:
    """Return the newest status of each line and drive, collected once for check and report."""
    found: dict[str, DiagnosticStatus] = {}

    def take_statuses(array: DiagnosticArray) -> None:
        of_driver = [status for status in array.status if status.name.endswith(_ENDS)]
        found.update({status.name: status for status in of_driver})

    context = Context()
    rclpy.init(context=context)
    node = Node('nfo_sinus_doctor', context=context, enable_rosout=False)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        node.create_subscription(DiagnosticArray, '/diagnostics', take_statuses, 100)
        until = time.monotonic() + _LISTENS
        while (left := until - time.monotonic()) > 0:
            executor.spin_once(left)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    return found
