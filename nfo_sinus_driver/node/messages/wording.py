# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The sentences of a node, with the full names of its services."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nfo_sinus_driver.drive import DriveError, Report
from nfo_sinus_driver.drive.known.events import Calls, sentence

if TYPE_CHECKING:
    from rclpy.node import Node


class NodeError(Exception):
    """The node itself refuses; the message says why and what to do."""


class Wording:
    """Makes sentences for the node of one drive; ``enable`` is how to enable it."""

    def __init__(self, node: Node) -> None:
        name = node.get_fully_qualified_name()
        self.enable = f'call {node.resolve_service_name("~/enable")}'
        self._calls = Calls(
            acknowledge=f'call {node.resolve_service_name("~/fault_ack")}',
            enable=self.enable,
            quick_stop=f'call {node.resolve_service_name("~/quick_stop")}',
            program='driver',
            drive_timeout='drive_timeout',
            set_drive_timeout=f'set drive_timeout of {name}',
            set_setpoint_max=f'set setpoint_max of {name}',
            set_control_mode=f'expected_control_mode of {name}',
            set_model=f'set model of {name} to auto or to what it is',
            set_method=f'set control_method of {name} to another one',
        )

    def say(self, what: Report | Exception | None) -> str:
        """Return the sentence of a report or an error; ``''`` for none."""
        if isinstance(what, DriveError):
            what = what.report
        if isinstance(what, Report):
            return sentence(what, self._calls)
        return '' if what is None else str(what)
