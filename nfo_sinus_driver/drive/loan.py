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

"""A drive in the hands of somebody else, such as a tuning."""

from __future__ import annotations

from nfo_sinus_driver.drive.errors import DriveError


class Loan:
    """
    The drive in the hands of somebody else, such as a tuning.

    :param what: what for.
    """

    def __init__(self, what: str) -> None:
        self.what = what
        #: The drive shall stop what it does, or not begin it.
        self.recalled = False

    def require_wanted(self) -> None:
        """
        See to it that nobody has stopped it meanwhile.

        :raises DriveError: somebody has.
        """
        if self.recalled:
            raise DriveError(f'{self.what} was stopped before it began')
