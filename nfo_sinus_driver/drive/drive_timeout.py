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

"""The drive's own time-out: it stops the motor when the driver dies ([M0 §5.3.5], [C91])."""

from __future__ import annotations

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.link import LinkError


async def set_drive_timeout(registers: Registers, seconds: float) -> str:
    """
    Set SioTot and AutoStop = ON, each only if it is different, and read them back.

    :param seconds: 0 leaves both as they are.
    :returns: what was changed, ``''`` if nothing was.
    :raises DriveError: the drive keeps another value; both are as they were then.
    :raises LinkError: the drive does not answer or refuses.
    """
    if not seconds:
        return ''
    wanted: dict[str, Value] = {'serial.sio_tot': seconds, 'serial.auto_stop': True}
    before = {key: await registers.read(key, Priority.SERVICE) for key in wanted}
    changed = {
        key: value
        for key, value in wanted.items()
        if before[key] != registers.number(key, registers.words(key, value))
    }
    written: list[str] = []
    try:
        for key, value in changed.items():
            written.append(key)
            await registers.write(key, value, Priority.SERVICE)
            kept = await registers.read(key, Priority.SERVICE)
            if kept != registers.number(key, registers.words(key, value)):
                raise DriveError(f'the drive keeps {key} = {kept} where {value} was written')
    except (DriveError, LinkError):
        for key in written:
            await registers.write(key, before[key], Priority.SERVICE)
        raise
    if not changed:
        return ''
    what = ', '.join(f'{key}: {before[key]} -> {value}' for key, value in changed.items())
    return f'drive_timeout set in the drive ({what})'
