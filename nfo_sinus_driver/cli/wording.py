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

"""What the drive layer reports, in sentences that name what can be typed here."""

from __future__ import annotations

from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import Report
from nfo_sinus_driver.wording import Calls
from nfo_sinus_driver.wording import sentence

_CALLS = Calls(
    acknowledge='type nfo-sinus ack',
    enable='run it again',
    program='command',
    drive_timeout='--drive-timeout',
    set_drive_timeout='give --drive-timeout',
    set_control_mode='give another --control-mode',
    set_model='give the right --model',
)


def say(what: Report | Exception | None) -> str:
    """Return what there is to say; an error that is no drive's speaks for itself."""
    if what is None:
        return ''
    if isinstance(what, DriveError):
        what = what.report
    return sentence(what, _CALLS) if isinstance(what, Report) else str(what)
