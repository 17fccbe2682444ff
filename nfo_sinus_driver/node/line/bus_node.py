# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The node of the bus: its settings, its statistics, its diagnostics."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
import contextlib
from dataclasses import replace
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from nfo_sinus_msgs.msg import BusStatistics
from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import InvalidNodeNameException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from std_msgs.msg import Float32

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.link import BusSettings
from nfo_sinus_driver.node.bags import bags
from nfo_sinus_driver.node.bags.black_box import BlackBox
from nfo_sinus_driver.node.drive import diagnostics
from nfo_sinus_driver.node.drive.bus_context import BusContext
from nfo_sinus_driver.node.drive.callers import publish_calls
from nfo_sinus_driver.node.drive.setpoint_checks import Origin
from nfo_sinus_driver.node.line.all_drives import AllDrives
from nfo_sinus_driver.node.line.joint_commands import JointCommands, message_type
from nfo_sinus_driver.node.messages import messages
from nfo_sinus_driver.node.messages.stamps import Stamps
from nfo_sinus_driver.node.parameters.declaring import coerce, declare
from nfo_sinus_driver.node.parameters.factory_settings import line_of
from nfo_sinus_driver.node.parameters.parameter_names import require_parameter
from nfo_sinus_driver.node.parameters.settings import (
    BLACK_BOX,
    BOND,
    BUS_SETTINGS,
    DRIVES,
    INTROSPECTION,
)
from nfo_sinus_driver.node.ros.qos import RELIABLE
from nfo_sinus_driver.node.ros.rclpy_internals import given_to, overrides_of
from nfo_sinus_driver.setting import Setting
from nfo_sinus_driver.state_folder import StateFolder, state_path

_PERIOD = 1.0
#: How long the start waits for the port to open, and how often that is checked, s.
_LONGEST_OPENING = 0.5
_LOOK_PERIOD = 0.005

NAME = 'nfo_sinus_bus'


def _families_of(names: Iterable[str]) -> Mapping[str, object]:
    """Return the ``family`` that was given to the drives of these names, before they exist."""
    found: dict[str, object] = {}
    for name in names:
        # an invalid name is refused when its node is created
        with contextlib.suppress(InvalidNodeNameException):
            given = given_to(name).get('family')
            found[name] = given and given.value
    return found


class BusNode(Node):
    """
    The node of one bus; a ValueError says which settings make no sense.

    :param single_name: the name of the drive, where one was given to the whole process.
    """

    def __init__(self, overrides: Sequence[Parameter] = (), single_name: str = '') -> None:
        super().__init__(NAME, parameter_overrides=list(overrides))
        known = dict(BUS_SETTINGS)
        own = declare(self, {
            setting.name: known.pop(setting.name)
            for setting in (DRIVES, BLACK_BOX, INTROSPECTION, BOND)
        })
        self.drive_names: list[str] = list(own[DRIVES.name])
        names = [single_name] if single_name else self.drive_names
        settings = BusSettings(**self._declare_line(known, _families_of(names)))
        self._port = settings.port
        link = settings.open()
        limit = settings.max_requests if link.protocol.most_requests else 0.0
        memory = StateFolder(settings.port)
        self._whole_name = self.get_fully_qualified_name().lstrip('/')
        box = self._black_box(own[BLACK_BOX.name])
        introspection = own[INTROSPECTION.name]
        self.bus_context = BusContext(
            Bus(link, limit), settings.retries, memory, box, introspection, own[BOND.name]
        )
        AllDrives(self, self.bus_context)
        publish_calls(self, introspection)
        self.bus_context.subscribe(self, {'~/setpoint_all': (Float32, self._on_setpoint_all)})
        if (type_ := message_type()) is not None:
            JointCommands(self, self.bus_context, type_)
        publish_queue = self.bus_context.publish_queue
        self.bus_context.bus.on_mute(
            lambda seconds: publish_queue.put(lambda: self._log_mute(seconds))
        )
        self._stamps = Stamps(lambda: self.get_clock().now().nanoseconds)
        self._logged_port: str | None = ''
        self._logged_remarks: set[str] = set()
        self._diagnosis = diagnostics.Diagnosis()
        self._statistics = self.create_publisher(BusStatistics, '~/statistics', RELIABLE)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', RELIABLE)
        self.bus_context.publish_queue.put_every(_PERIOD, self._report)

    def _black_box(self, seconds: float) -> BlackBox:
        """Return the black box of the line; it is off where no bag can be written."""
        missing = bags.why_none() if seconds and not bags.is_installed() else ''
        if missing:
            self.get_logger().info(f'the black box is off: {missing}')
        name = self._whole_name.replace('/', '_')
        log = self.get_logger()
        return BlackBox(
            0.0 if missing else seconds,
            lambda: state_path() / 'black_box' / name,
            lambda text: log.warning(text),
        )

    def _declare_line(
        self, known: Mapping[str, Setting], families: Mapping[str, object]
    ) -> dict[str, Any]:
        """Declare the settings of the line, as its drives leave the factory where not given."""
        given = {
            name: coerce(parameter, known).value for name, parameter in overrides_of(self).items()
        }
        line = line_of(families, given)
        values = declare(self, {
            name: replace(setting, default=line.get(name, setting.default))
            for name, setting in known.items()
        })
        # a parameter file may say the factory setting, too
        return values | {name: value for name, value in line.items() if not values[name]}

    def start(self) -> None:
        """Open the port and begin to report."""
        bus = self.bus_context.bus
        self.bus_context.publish_queue.start()
        self.bus_context.black_box.start()
        bus.start()
        # the state of the port is logged before that of the drives
        deadline = time.monotonic() + _LONGEST_OPENING
        while bus.port_error is not None and time.monotonic() < deadline:
            time.sleep(_LOOK_PERIOD)
        error = bus.port_error
        self.bus_context.publish_queue.put(
            lambda: self._log_port(None if error is None else str(error))
        )

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters; for an unknown name the reason suggests the closest one."""
        try:
            for parameter in parameter_list:
                require_parameter(self, parameter.name)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return super().set_parameters_atomically(parameter_list)

    def _on_setpoint_all(self, message: Float32, origin: Origin) -> None:
        for take in self.bus_context.on_setpoint_all:
            take(message, origin)

    def _report(self) -> None:
        if not self.bus_context.bus.alive:
            # the driver is ending, and has closed the port
            return
        statistics = self.bus_context.bus.statistics()
        silent = [drive.name for drive in self.bus_context.drives if drive.is_silent]
        stamp = Time(nanoseconds=self._stamps.now()).to_msg()
        self._statistics.publish(messages.bus_statistics(statistics, silent, stamp))
        error = self.bus_context.bus.port_error
        none = not any(drive.drive.ever_responded for drive in self.bus_context.drives)
        status = diagnostics.bus_status(
            self._diagnosis,
            self._whole_name,
            self._port,
            statistics,
            error,
            silent,
            self._check if none else '',
            self.bus_context.bus.remarks,
        )
        every = self.bus_context.diagnoses()
        self._diagnostics.publish(diagnostics.array(stamp, status, *every))
        self._log_port(None if error is None else str(error))
        for remark in self.bus_context.bus.remarks:
            if remark not in self._logged_remarks:
                self._logged_remarks.add(remark)
                self.get_logger().warning(remark)

    @property
    def _check(self) -> str:
        """What to check while no drive answers: of all drives if they agree, else of the line."""
        found = {drive.line_check for drive in self.bus_context.drives}
        return found.pop() if len(found) == 1 else self.bus_context.bus.protocol.check

    def _log_mute(self, seconds: float) -> None:
        """Log for how long no drive has answered, s; 0: one does again."""
        if seconds:
            self.get_logger().warning(
                f'{self._port}: no drive has answered for {seconds:.1f} s: the port is opened '
                'again, in growing pauses until one answers; check power, cable, and adapter or '
                'gateway'
            )
        else:
            self.get_logger().info(f'{self._port}: drives answer again')

    def _log_port(self, error: str | None) -> None:
        """Log whether the port is open, on change."""
        if error == self._logged_port:
            return
        self._logged_port = error
        if error is None:
            self.get_logger().info(f'{self._port} is open')
        else:
            self.get_logger().error(f'{error}; retrying')
