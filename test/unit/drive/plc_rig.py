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


"""A drive behind a simulated PLC in virtual time; the registers of the PLC stand for the line."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import struct
from typing import Any

from any_order_rig import FaultyLine
from any_order_rig import Rig
from support import telegram_laws

from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import modbus_pdu
from nfo_sinus_driver.link.interface import NoAnswer
from nfo_sinus_driver.link.interface import PortError
from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.modbus_tcp import TcpLink
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.memory import Refused as FarRefusal
from nfo_sinus_driver.simulator.plc import Plc
from nfo_sinus_driver.simulator.plc import PlcSetting

MODELS = ('sinus_optimal', 'sinus_h', 'sinus_g2')
#: What an answer of the PLC takes, s, and what it is waited for.
_TURNAROUND = 0.002
_TIMEOUT = 0.2
#: Of each model: the settings of its ramps, and the options with which it goes on by what stands in
#: a telegram, as far as its manual allows.
_RAMPS = {
    'sinus_optimal': ('control.accel', 'control.retard'),
    'sinus_g2': ('control.accel', 'control.retard'),
    'sinus_h': ('drv.acc_time', 'drv.dec_time'),
}
LEVELS = {
    'sinus_optimal': {'commands': 'levels'},
    'sinus_g2': {'commands': 'levels'},
    'sinus_h': {'unlisted_exits': 'levels'},
}


class PlcLink(FaultyLine, TcpLink):
    """The link to a PLC: a request is answered at once, from its registers."""

    def __init__(self, rig: PlcRig) -> None:
        FaultyLine.__init__(self, rig)
        TcpLink.__init__(self, 'plc', 502, _TIMEOUT, now=rig.clock.monotonic)
        self.plc_rig = rig
        self._request = 0

    def open(self) -> None:
        self._require_port()
        self._blocks.forget()

    def close(self) -> None:
        pass

    def _ask(self, request: Any) -> tuple[Any, float]:
        rig = self.plc_rig
        self._require_port()
        self._request = self._request % 0xFFFF + 1
        frame = _framed(self._request, modbus_pdu.encode(request))
        self.asked_at = rig.clock.now
        self.frames.append({'direction': 'request', 'first': rig.clock.now, 'hex': frame.hex()})
        rig.elapse(_TURNAROUND / 2)
        if self.state == 'silent':
            rig.elapse(_TIMEOUT)
            raise NoAnswer('no answer')
        try:
            words = rig.answer_request(request)
        except FarRefusal as refusal:
            raise Refused(int(refusal.reason)) from None
        rig.elapse(_TURNAROUND / 2)
        if self.state == 'gone':
            raise PortError('the connection was lost')
        data = struct.pack(f'>{len(words)}H', *words)
        answer = bytes((request.unit, 23, len(data))) + data
        hexed = _framed(self._request, answer).hex()
        self.frames.append({'direction': 'answer', 'first': rig.clock.now, 'hex': hexed})
        return data, rig.clock.now


def _framed(number: int, message: bytes) -> bytes:
    return struct.pack('>HHH', number, 0, len(message)) + message


class PlcRig(Rig):
    """
    A driver, a PLC and a drive.

    :param levels: the drive takes commands by level.
    :param options: of the simulated drive.
    """

    def __init__(
        self,
        model: str,
        *,
        exchange: float = 0.02,
        levels: bool = False,
        plc: dict[str, Any] | None = None,
        options: dict[str, Any] | None = None,
        ramp: float = 1.0,
        **settings: Any,
    ) -> None:
        chosen = {**(LEVELS[model] if levels else {}), **(options or {})}
        parameters = dict.fromkeys(_RAMPS[model], ramp)
        far = simulated_drive(model, settings=parameters, boot_time=0.2, **chosen)
        self.plc = Plc({1: far}, PlcSetting(exchange=exchange, **(plc or {})))
        self.model = model
        usual = {'control_method': 'telegram1', 'setpoint_timeout': 0.0}
        super().__init__(far, DriveSettings(model=model, **{**usual, **settings}), PlcLink)
        self.channel = self.plc.channels[1]
        self.elapse(0.5)

    def answer_request(self, request: Any) -> tuple[int, ...]:
        """Return what the registers of the PLC say to a request."""
        registers = self.plc.units[0].servers['modbus']
        if isinstance(request, modbus_pdu.Read):
            return tuple(registers.read(request.register, request.count))
        words = struct.unpack(f'>{len(request.data) // 2}H', request.data)
        if isinstance(request, modbus_pdu.WriteAndRead):
            where = request.source, request.count
            return tuple(registers.write_and_read(request.register, words, *where))
        registers.write(request.register, words)
        return ()

    def elapse(self, seconds: float) -> None:
        end = self.clock.now + seconds
        while self.clock.now < end:
            self.clock.now = min(end, self.clock.now + 0.005)
            self.plc.advance_to(self.clock.now)
        self.judge(self.looked)

    def connect(self) -> None:
        self.answer(self.drive.connect())
        self.drive.activate()
        self.pass_time(0.2)

    def turn(self, frequency: float = 20.0) -> None:
        """Enable and turn, with a program that keeps on sending the set-point."""
        answer = self.answer(self.drive.enable())
        assert 'enabled' in answer, answer
        self.send(frequency)
        self.pass_time(3.0)
        assert abs(self.far.motor.frequency - frequency) < 0.5, self.far.motor.frequency

    @property
    def turns(self) -> bool:
        """The output stage drives the motor, and not at standstill."""
        return self.far.motor.driven and abs(self.far.motor.frequency) > 0.05

    @property
    def words(self) -> list[int]:
        """The control words that were written, each once in a row."""
        found: list[int] = []
        for one in telegram_laws.exchanges(self.frames, 1):
            if found[-1:] != [one.stw1]:
                found.append(one.stw1)
        return found

    @property
    def frames(self) -> list[dict[str, Any]]:
        return self.link.frames  # type: ignore[no-any-return]

    @contextlib.contextmanager
    def judged(self) -> Iterator[PlcRig]:
        """Close it in the end, and judge all words by the manuals' tables."""
        try:
            yield self
        finally:
            self.close()
        found = telegram_laws.violations(self.frames, self.model)
        assert not found, found
