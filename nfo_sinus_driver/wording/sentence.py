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

"""Makes a sentence of a report."""

from __future__ import annotations

from dataclasses import dataclass
import string
from typing import Any

from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.wording.templates import TEMPLATES

#: What stands for a value that is empty, by its name.
_IF_EMPTY = {
    'status': 'its status is not known',
    'mode': '?',
    'unit': 'another unit',
    'firmware': 'an older one',
    'changed': 'none',
    'changes': 'no parameter',
}


@dataclass(frozen=True)
class Calls:
    """
    What an operator calls, types or sets, as parts of sentences; by full names, to be pasted.

    :ivar acknowledge: such as ``call /infeed/fault_ack``.
    :ivar enable: likewise.
    :ivar program: what this is that speaks.
    :ivar drive_timeout: the name of that setting.
    :ivar set_drive_timeout: such as ``set drive_timeout``.
    :ivar set_control_mode: how to expect another control mode.
    :ivar set_model: how to correct the model.
    """

    acknowledge: str
    enable: str
    program: str
    drive_timeout: str
    set_drive_timeout: str
    set_control_mode: str
    set_model: str


class _Formatter(string.Formatter):
    def __init__(self, calls: Calls) -> None:
        self._calls = calls

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        value, name = super().get_field(field_name, args, kwargs)
        return (_IF_EMPTY.get(field_name, value) if value in ('', ()) else value), name

    def format_field(self, value: Any, format_spec: str) -> str:
        if isinstance(value, Report):
            return sentence(value, self._calls)
        if isinstance(value, tuple):
            between = '; ' if isinstance(value[0], Report) else ', '
            return between.join(self.format_field(one, format_spec) for one in value)
        return str(super().format_field(value, format_spec))


def sentence(report: Report, calls: Calls) -> str:
    """Return what an operator reads of a report."""
    values = {**report.values, 'call': calls}
    return _Formatter(calls).vformat(TEMPLATES[report.cause], (), values)
