# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Diagnostics by REP-107: once a second and on change, never used to stop anything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
import re

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from nfo_sinus_driver.bus import Statistics
from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.drive import LogEntry, Snapshot
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.node.drive.managed_drive import ManagedDrive

_LEVELS = {
    Kind.STATUS: DiagnosticStatus.OK,
    Kind.ALARM: DiagnosticStatus.WARN,
    Kind.FAULT: DiagnosticStatus.ERROR,
}


class Diagnosis:
    """The message of one diagnosis, kept: what has not changed is not built again."""

    def __init__(self) -> None:
        self._status = DiagnosticStatus()

    def of(
        self, level: bytes, name: str, message: str, hardware_id: str, values: Mapping[str, str]
    ) -> DiagnosticStatus:
        """Return the message; it is good until the next call."""
        status = self._status
        status.level, status.name, status.message = level, name, message
        status.hardware_id = hardware_id
        if [pair.key for pair in status.values] != [*values]:
            status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        for kept, value in zip(status.values, values.values(), strict=True):
            if kept.value != value:
                kept.value = value
        return status


def array(stamp: Time, *statuses: DiagnosticStatus) -> DiagnosticArray:
    """Wrap diagnoses for ``/diagnostics``."""
    return DiagnosticArray(header=Header(stamp=stamp), status=statuses)


def drive_verdict(managed: ManagedDrive, snapshot: Snapshot, due: str) -> tuple[bytes, str]:
    """
    Return the level of one drive's diagnosis, and its message for the operator.

    :param due: the maintenance that is due.
    """
    if managed.drive.stop_overdue:
        message = 'the stop is NOT confirmed: use the enable input or the emergency stop'
        return DiagnosticStatus.ERROR, message
    if not snapshot.connected:
        if not managed.is_silent:
            # its drive is left alone
            why = 'was shut down' if managed.state == 'finalized' else 'is not configured'
            return DiagnosticStatus.OK, f'not connected: the node {why}'
        why = managed.why_silent or 'the log of the node says what to check'
        return DiagnosticStatus.ERROR, f'not connected: {why}'
    level = _LEVELS[snapshot.kind]
    jammed = managed.drive.jammed
    if jammed and snapshot.kind is not Kind.FAULT:
        return DiagnosticStatus.WARN, f'jammed: {managed.wording.say(jammed)}'
    if snapshot.kind is not Kind.STATUS:
        return level, f'{snapshot.text}: {snapshot.description}. {snapshot.remedy}'
    if drift := managed.drive.parameters.drift:
        message = f'{snapshot.text}; {len(drift)} parameters differ from the parameter file'
        return DiagnosticStatus.WARN, message
    if due:
        return DiagnosticStatus.WARN, f'{snapshot.text}; maintenance is due: {due}'
    return level, snapshot.text


def drive_status(
    kept: Diagnosis,
    name: str,
    managed: ManagedDrive,
    snapshot: Snapshot,
    verdict: tuple[bytes, str],
    maintenance: str,
) -> DiagnosticStatus:
    """
    Return the diagnosis of one drive.

    :param verdict: from :func:`drive_verdict`.
    :param maintenance: how far each limit of it is.
    """
    drive = managed.drive
    identity, parameters = drive.identity, drive.parameters
    code = '' if snapshot.status is None else str(snapshot.status.code)
    serial = identity.serial if identity else ''
    values = {
        'lifecycle state': managed.state,
        'address': str(drive.settings.address),
        'model': identity.model if identity else '',
        'serial number': serial,
        'firmware': identity.versions if identity else '',
        'inverter status': f'{code} {snapshot.text}'.strip(),
        'last error': _logged(drive.last_error),
        'control method': snapshot.control_method,
        'control mode': snapshot.control_mode,
        'parameters': parameters.progress,
        'maintenance': maintenance,
        'differs from the parameter file': ', '.join(str(change) for change in parameters.drift),
        'enabled': str(snapshot.enabled),
        'setpoint': _quantity(snapshot.setpoint, snapshot.unit),
        'actual': _quantity(snapshot.actual, snapshot.unit),
        **_figures(drive.statistics),
    }
    if snapshot.kind is Kind.FAULT:
        # a bridge to a list of faults takes what is there for active
        values['fault'] = re.sub(r'\W+', '_', snapshot.text).strip('_').upper()
    level, message = verdict
    # such a bridge takes what has a slash for the name of a node
    return kept.of(level, f'{name}: drive', message, serial.replace('/', '-'), values)


def _logged(entry: LogEntry | None) -> str:
    if entry is None:
        return ''
    wall_time = f' ({entry.wall_time})' if entry.wall_time else ''
    return f'{entry.code} {entry.text} at {entry.operating_time:.1f} h{wall_time}'


def _quantity(value: float, unit: str) -> str:
    return '' if math.isnan(value) else f'{value:g} {unit}'.strip()


def bus_status(
    kept: Diagnosis,
    name: str,
    port: str,
    statistics: Statistics,
    port_error: PortError | None,
    silent_drives: list[str],
    check: str,
    remarks: Sequence[str],
) -> DiagnosticStatus:
    """
    Return the diagnosis of the line.

    :param check: what to check where no drive has answered; ``''`` where one has.
    :param remarks: what the link has noticed about the line.
    """
    if port_error is not None:
        level, message = DiagnosticStatus.ERROR, str(port_error)
    elif silent_drives:
        level, message = DiagnosticStatus.ERROR, f'no response from {", ".join(silent_drives)}'
        if check:
            message += f': check in this order: {check}'
    elif remarks:
        level, message = DiagnosticStatus.WARN, remarks[-1]
    else:
        level, message = DiagnosticStatus.OK, 'all drives answer'
    values = {'port': port, **_figures(statistics)}
    # /dev/ttyUSB0 is ttyUSB0
    return kept.of(level, f'{name}: line', message, port.rpartition('/')[2], values)


def _figures(statistics: Statistics) -> dict[str, str]:
    return {
        'utilisation': f'{100 * statistics.utilisation:.0f} %',
        'cycle time': _milliseconds(statistics.cycle_time),
        'transactions': str(statistics.transactions),
        'timeouts': str(statistics.timeouts),
        'damaged': str(statistics.damaged),
        'refused': str(statistics.refused),
        'foreign frames': str(statistics.foreign_frames),
        'retries': str(statistics.retries),
        'reconnects': str(statistics.reconnects),
        'round trip min': _milliseconds(statistics.round_trip_min),
        'round trip median': _milliseconds(statistics.round_trip_median),
        'round trip p99': _milliseconds(statistics.round_trip_p99),
        'round trip max': _milliseconds(statistics.round_trip_max),
    }


def _milliseconds(seconds: float) -> str:
    return '' if math.isnan(seconds) else f'{1000 * seconds:.1f} ms'
