# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The driver, with an error in a callback of each kind; a process of its own.

The argument is the command that it stands for.
"""

from __future__ import annotations

import sys
from typing import Any

from rclpy.parameter import Parameter

from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.node.__main__ import main
from nfo_sinus_driver.node.drive.drive_node import DriveNode
from nfo_sinus_driver.node.drive.reporter import Reporter
from nfo_sinus_driver.node.drive.setpoints import Setpoints

#: The parameter that cannot be set.
PARAMETER = 'frame_id'


def _failing(what: str) -> Any:
    def fail(*_: object, **__: object) -> None:
        raise LookupError(what)

    return fail


def _failing_for_one(check: Any) -> Any:
    def fail(node: DriveNode, parameters: list[Parameter]) -> Any:
        if any(parameter.name == PARAMETER for parameter in parameters):
            raise LookupError('a parameter')
        return check(node, parameters)

    return fail


def run() -> int:
    """Run the driver until it ends."""
    sys.argv.pop(1)
    # a subscription, a service, a parameter callback, the publish queue and the bus
    Setpoints._on_setpoint = _failing('a subscription')
    Drive.rapid_stop = _failing('a service')
    DriveNode._check_settings = _failing_for_one(DriveNode._check_settings)
    Reporter._diagnose = _failing('the publish queue')
    Reporter.on_telemetry = _failing('the bus')
    return main()


if __name__ == '__main__':
    sys.exit(run())
