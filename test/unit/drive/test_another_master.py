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

"""Another master reads the same drive, against the law of its line: no false value, no loss."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from random import Random
from typing import Any

from memory_rig import MemoryRig
from noise_rig import TimedNotes
import pytest
from support.said import says

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.link import modbus_ascii
from nfo_sinus_driver.link import rtu
from nfo_sinus_driver.link.modbus_pdu import read_of

ENCODE: dict[str, Callable[[Any], bytes]] = {
    'modbus_rtu': lambda address: rtu.encode(read_of(1, address)),
    'modbus_ascii': lambda address: modbus_ascii.encode(read_of(1, address)),
}
SECONDS = 120.0


def question(rig: MemoryRig, protocol: str) -> bytes:
    """Return the frame by which another master reads the voltage of the DC link."""
    return ENCODE[protocol](rig.drive.registers.address('status.dc_link'))


class SharedRig(MemoryRig):
    """A drive on the simulator's line, and all that is published of it."""

    notes: TimedNotes

    def __init__(self, protocol: str, **settings: Any) -> None:
        super().__init__(protocol, address=1, **settings)

    def begin(self) -> None:
        self.notes = TimedNotes(self.clock)
        self.bus = Bus(self.link, now=self.clock.monotonic)
        self.drive = Drive(self.bus, self.settings, self.notes)

    def require_truth(self) -> None:
        """See to it that nothing was published but a motor that runs at 20 Hz, without a break."""
        published = self.notes.published
        assert published
        for (before, _), (at, shown) in pairwise(published):
            assert at - before < 1.0
            assert abs(shown.frequency - 20) < 0.3, shown
            assert abs(shown.actual - 20) < 0.3, shown
            assert shown.enabled and shown.text == published[0][1].text, shown
        assert self.clock.now - published[-1][0] < 1.0
        assert not any(says(text, Cause.LOST_IN_USE) for _, _, text in self.notes.events)


@pytest.mark.parametrize('poll_rate', [50.0, 5.0])
@pytest.mark.parametrize('protocol', ENCODE)
def test_nothing_false_is_published_and_the_drive_is_not_lost(
    protocol: str, poll_rate: float
) -> None:
    rig = SharedRig(protocol, poll_rate=poll_rate)
    rig.run()
    assert rig.bus.remarks == ()
    rig.notes.published.clear()
    rig.port.another_asks(question(rig, protocol), 0.1)
    rig.pass_time(SECONDS)
    rig.require_truth()
    (remark,) = rig.bus.remarks
    assert 'another Modbus master' in remark and 'disconnect it' in remark
    assert rig.bus.statistics().foreign_frames > SECONDS
    rig.close()


@pytest.mark.parametrize('protocol', ENCODE)
def test_no_other_master_is_seen_where_there_is_only_noise_or_an_echo(protocol: str) -> None:
    rig = SharedRig(protocol)
    rig.port.line._echo = True
    rig.run()
    random = Random(34)
    for number in range(100):
        noise = random.randbytes(random.randrange(1, 30))
        rig.port.later(rig.clock.now + number / 5, lambda noise=noise: rig.port.send(noise))
    rig.pass_time(20.0)
    assert rig.bus.remarks == () and rig.bus.statistics().foreign_frames == 0
    rig.close()
