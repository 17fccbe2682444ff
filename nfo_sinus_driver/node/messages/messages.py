# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Turns what a drive and a line report into messages; the joint that a motor turns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math
from typing import Any

from builtin_interfaces.msg import Time
from nfo_sinus_msgs.msg import (
    BusStatistics,
    DriveStatus,
    ErrorLogEntry,
    FaultCount,
    InvSt,
    Measured,
    OperatingFigures,
    OperatingRecord,
    StopCount,
    Telemetry as TelemetryMessage,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from nfo_sinus_driver.bus import Statistics
from nfo_sinus_driver.catalog import Fact, Family, Kind, Role, State
from nfo_sinus_driver.catalog.status import FREQUENCY, QUANTITIES, SPEED
from nfo_sinus_driver.drive import (
    Drive,
    InverterStatus,
    LogEntry,
    Snapshot,
    StopReason,
    Telemetry,
)
from nfo_sinus_driver.node.messages.scale import Scale
from nfo_sinus_driver.operating_record.figures import HIGHEST, Figures, Record

_CONTROL_MODES = {mode: getattr(DriveStatus, mode.upper().replace('-', '_')) for mode in QUANTITIES}
#: A method without a constant is a family's own: CUSTOM.
_METHODS = {
    'mode_scmd': DriveStatus.MODE_SCMD,
    'drive_control': DriveStatus.DRIVE_CONTROL,
    'monitor': DriveStatus.MONITOR,
    'function_bits': DriveStatus.FUNCTION_BITS,
    'telegram1': DriveStatus.TELEGRAM1,
    'ds402': DriveStatus.DS402,
    'remote_setpoint': DriveStatus.REMOTE_SETPOINT,
}
_STATES = {state: getattr(DriveStatus, state.name) for state in State}
#: The facts have the names and the bits of the message; plain numbers, for this is done with every
#: poll, and flags are slow.
_FACTS = tuple((str(fact.name).lower(), int(fact)) for fact in Fact)
_KINDS = {Kind.STATUS: InvSt.STATUS, Kind.ALARM: InvSt.ALARM, Kind.FAULT: InvSt.FAULT}

#: The fields of Telemetry and where they come from.
_TELEMETRY = {
    'output_voltage': Role.OUTPUT_VOLTAGE,
    'output_current': Role.OUTPUT_CURRENT,
    'output_power': Role.OUTPUT_POWER,
    'power_factor': Role.POWER_FACTOR,
    'dc_link_voltage': Role.DC_LINK_VOLTAGE,
    'frequency': Role.ACTUAL_FREQUENCY,
    'speed': Role.ACTUAL_SPEED,
    'torque': Role.ACTUAL_TORQUE,
    'motor_temperature': Role.MOTOR_TEMPERATURE,
    'pt1000_temperature': Role.PT1000_TEMPERATURE,
    'operating_time': Role.OPERATING_TIME,
    'running_time': Role.RUNNING_TIME,
    'brake_time': Role.BRAKE_TIME,
    'energy': Role.ENERGY,
    'total_energy': Role.TOTAL_ENERGY,
}


def drive_status(snapshot: Snapshot, scale: Scale, stop_text: str) -> Mapping[str, Any]:
    """Return the fields of DriveStatus, in the unit of a scale, with why it stopped last."""
    return {
        'connected': snapshot.connected,
        'enabled': snapshot.enabled,
        'control_method': _METHODS.get(snapshot.control_method, DriveStatus.CUSTOM),
        'control_mode': _CONTROL_MODES.get(snapshot.control_mode, DriveStatus.UNKNOWN),
        'unit': scale.unit(snapshot.unit),
        'setpoint': scale.shown(snapshot.setpoint),
        'setpoint_age': snapshot.setpoint_age,
        'setpoint_clamped': snapshot.setpoint_clamped,
        'actual': scale.shown(snapshot.actual),
        'stop_reason': snapshot.stop_reason,
        'stop_text': stop_text,
        **_status_fields(snapshot.status),
    }


def _status_fields(status: InverterStatus | None) -> Mapping[str, int | bool]:
    """Return the fields for the status of the drive itself."""
    if status is None:
        return {'state': DriveStatus.UNKNOWN}
    facts = int(status.facts)
    return {
        'state': _STATES[status.state],
        'status_word': status.shown_word,
        'valid': status.valid.value,
        **{name: bool(facts & bit) for name, bit in _FACTS},
    }


def inv_st(snapshot: Snapshot, stamp: Time, frame_id: str) -> InvSt:
    """Return the InvSt of a poll (ValueError: the drive was not connected)."""
    if snapshot.status is None:
        raise ValueError('no inverter status without a connection')
    return InvSt(
        header=Header(stamp=stamp, frame_id=frame_id),
        # a code that no table has may be greater than one byte: then the text has it
        code=min(snapshot.status.code, 0xFF),
        text=snapshot.text,
        description=snapshot.description,
        kind=_KINDS[snapshot.kind],
        requires_ack=snapshot.requires_ack,
        remedy=snapshot.remedy,
    )


def telemetry(measured: Telemetry, stamp: Time, frame_id: str) -> TelemetryMessage:
    """Return the Telemetry message of measured values."""
    values = {field: measured.values.get(role, math.nan) for field, role in _TELEMETRY.items()}
    return TelemetryMessage(header=Header(stamp=stamp, frame_id=frame_id), **values)


def measured(telemetry: Telemetry, model: Family, stamp: Time, frame_id: str) -> Measured:
    """Return the Measured message of what the setting ``measured`` names."""
    return Measured(
        header=Header(stamp=stamp, frame_id=frame_id),
        name=list(telemetry.measured),
        value=list(telemetry.measured.values()),
        unit=[model[key].unit for key in telemetry.measured],
    )


def error_log_entry(entry: LogEntry, stamp: Time) -> ErrorLogEntry:
    """Return the ErrorLogEntry of an entry (stamp: when it happened; 0 if unknown)."""
    return ErrorLogEntry(
        # as in InvSt
        code=min(entry.code, 0xFF),
        text=entry.full_text,
        operating_time=entry.operating_time,
        age=entry.age,
        stamp=stamp,
    )


def bus_statistics(statistics: Statistics, silent_drives: list[str], stamp: Time) -> BusStatistics:
    """Return the BusStatistics message of a line, or of one drive."""
    return BusStatistics(
        header=Header(stamp=stamp),
        utilisation=statistics.utilisation,
        cycle_time=statistics.cycle_time,
        transactions=statistics.transactions,
        timeouts=statistics.timeouts,
        damaged=statistics.damaged,
        foreign_frames=statistics.foreign_frames,
        refused=statistics.refused,
        retries=statistics.retries,
        reconnects=statistics.reconnects,
        round_trip_min=statistics.round_trip_min,
        round_trip_mean=statistics.round_trip_mean,
        round_trip_p99=statistics.round_trip_p99,
        round_trip_max=statistics.round_trip_max,
        silent_drives=silent_drives,
        round_trip_median=statistics.round_trip_median,
    )


def operating_record(record: Record, stamp: Time, *, stored: bool) -> OperatingRecord:
    """Return the OperatingRecord message of a record."""
    return OperatingRecord(
        header=Header(stamp=stamp),
        drive=record.drive,
        serial_number=record.serial,
        stored=stored,
        energy_source=record.energy_source,
        total=_operating_figures(record.total),
        shift=_operating_figures(record.shift),
    )


def _operating_figures(figures: Figures) -> OperatingFigures:
    stops = [
        StopCount(stop_reason=StopReason[name], name=name, count=count)
        for name, count in sorted(figures.stops.items())
        if name in StopReason.__members__
    ]
    faults = [
        FaultCount(code=code, text=fault.text, count=fault.count, last=_wall_time(fault.last))
        for code, fault in sorted(figures.faults.items())
    ]
    highest = {f'highest_{name}': figures.highest.get(name, math.nan) for name in HIGHEST}
    return OperatingFigures(
        since=_wall_time(figures.since),
        powered_time=figures.powered_time,
        running_time=figures.running_time,
        starts=figures.starts,
        reversals=figures.reversals,
        stops=stops,
        faults=faults,
        energy=figures.energy_kwh,
        line_errors=figures.line_errors,
        longest_silence=figures.longest_silence,
        **highest,
    )


def _wall_time(seconds: float) -> Time:
    whole = math.floor(seconds)
    return Time(sec=whole, nanosec=int((seconds - whole) * 1e9))


_RPM = 2 * math.pi / 60
#: A pause between two polls that is longer says nothing about where the shaft went meanwhile, s;
#: many drives on a slow line, or a machine that stands still for a moment, make one of a second.
_LONGEST_STEP = 5.0


def control_mode(drive: Drive) -> str:
    """Return the control mode of a drive, or a ValueError that says why it is not known."""
    mode = drive.snapshot.control_mode
    if not mode:
        lost = drive.identity is not None and not drive.state.contact.connected
        raise ValueError('the drive is lost' if lost else 'the drive has not been read yet')
    return mode


def require_whole(message: JointState) -> None:
    """
    Make sure that the arrays of a joint command belong together, or raise a ValueError.

    An array has one value for each name, or none [sensor_msgs/JointState], and a name stands once.
    """
    count = len(message.name)
    for array in ('position', 'velocity', 'effort'):
        size = len(getattr(message, array))
        if size not in (0, count):
            raise ValueError(
                f'{count} names, but {size} values of {array}: one for each name, or none'
            )
    twice = [name for name in message.name if message.name.count(name) > 1]
    if twice:
        raise ValueError(f'it names {twice[0]} twice')


class Joint:
    """The joint that a motor turns; its ratio is motor turns per turn, negative inverts."""

    def __init__(self, name: Callable[[], str], ratio: Callable[[], float]) -> None:
        self._name = name
        self._ratio = ratio
        self._position = 0.0
        self._velocity = math.nan
        #: The speed that was measured last while the drive was connected without a break, and when.
        self._known = math.nan, 0.0

    @property
    def name(self) -> str:
        """Its name in messages."""
        return self._name()

    def move(self, snapshot: Snapshot) -> None:
        """Take the speed of a poll; the position is its integral while the drive is connected."""
        self._velocity = math.nan
        if snapshot.connected:
            self._velocity = snapshot.speed * _RPM / self._ratio()
            if math.isnan(self._velocity):
                # one answer that was lost or impossible; the motor turns on
                return
        (before, at), self._known = self._known, (self._velocity, snapshot.at)
        way = (before + self._velocity) / 2 * (snapshot.at - at)
        if 0 < snapshot.at - at < _LONGEST_STEP and not math.isnan(way):
            self._position += way

    def state(self, stamp: Time, frame_id: str) -> JointState:
        """Return where it is and how fast it turns."""
        return JointState(
            header=Header(stamp=stamp, frame_id=frame_id),
            name=[self.name],
            position=[self._position],
            velocity=[self._velocity],
        )

    def setpoint(self, velocity: float, drive: Drive) -> float:
        """Return the set-point for a velocity of the shaft, rad/s, or a ValueError."""
        rpm = velocity * self._ratio() / _RPM
        mode = control_mode(drive)
        if mode == SPEED.mode:
            return rpm
        if mode != FREQUENCY.mode:
            raise ValueError(f'the control mode is {mode}, not Speed or Freque')
        # slip is left out: how much there is depends on the load
        return rpm * _pole_pairs(drive) / 60


def _pole_pairs(drive: Drive) -> float:
    """Return how many the motor has, given or from its nominal speed, or a ValueError."""
    values, key = drive.parameters.values, drive.model.key
    given = float(values.get(key(Role.POLE_PAIRS), drive.model.profile.pole_pairs))
    if given:
        return given
    frequency = float(values.get(key(Role.NOMINAL_FREQUENCY), 0))
    speed = float(values.get(key(Role.NOMINAL_SPEED), 0))
    if not frequency or not speed:
        raise ValueError(
            'the drive has neither pole pairs of the motor nor f-Nom and N-nom, so Hz are no '
            'speed'
        )
    return max(1, round(60 * frequency / speed))
