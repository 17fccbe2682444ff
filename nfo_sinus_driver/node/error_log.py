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


"""The services of one drive that look after its error log and its kWh counter."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
import math

from builtin_interfaces.msg import Time
from nfo_sinus_msgs.srv import GetErrorLog
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import LogEntry
from nfo_sinus_driver.node import messages
from nfo_sinus_driver.node.commands import Commands
from nfo_sinus_driver.node.managed_drive import ManagedDrive

#: A busy line has many other things to do, s.
_LONGEST = 60.0


class ErrorLogServices:
    """
    Offers ``~/get_error_log``, ``~/erase_error_log`` and ``~/reset_energy``.

    :param stamp: gives the node's time of a moment of ``time.monotonic``.
    """

    def __init__(
        self,
        node: Node,
        managed: ManagedDrive,
        commands: Commands,
        stamp: Callable[[float], Time],
    ) -> None:
        self._managed = managed
        self._commands = commands
        self._stamp = stamp
        node.create_service(
            GetErrorLog,
            '~/get_error_log',
            self._on_get,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        commands.offer('~/erase_error_log', Drive.erase_error_log, _LONGEST)
        commands.offer('~/reset_energy', Drive.reset_energy, _LONGEST)

    def _on_get(
        self, request: GetErrorLog.Request, response: GetErrorLog.Response
    ) -> GetErrorLog.Response:
        def fill_in(entries: Sequence[LogEntry]) -> str:
            response.entries = [
                messages.error_log_entry(entry, self._stamp(entry.at)) for entry in entries
            ]
            return self._summary(entries)

        return self._commands.answer(
            response,
            lambda: self._managed.drive.error_log(request.max_entries),
            _LONGEST,
            fill_in,
        )

    def _summary(self, entries: Sequence[LogEntry]) -> str:
        undated = sum(math.isnan(entry.at) for entry in entries)
        if not undated:
            return f'{len(entries)} entries'
        if all(math.isnan(entry.operating_time) for entry in entries):
            return f'{len(entries)} entries; the drive does not tell when they came'
        since = self._managed.drive.powered_since
        return (
            f'{len(entries)} entries, {undated} of them without the wall time: it is only known '
            f'since the driver has seen the drive with power, from operating hour {since:.1f} on'
        )
