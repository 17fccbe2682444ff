# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A ride over any way into a drive, in virtual time, on which one kind of request can go wrong.

The frames of Classic and CANopen matter to nobody here: what is asked is done at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from any_order_rig import RESPONSE_TIMEOUT, DirectLink, Rig
from framed_link import FramedLink
from support.said import says
from support.variants import ramps

from nfo_sinus_driver.drive import Cause, DriveSettings
from nfo_sinus_driver.link import PROTOCOLS, Address, NoAnswer, Refused, Reply, modbus_pdu
from nfo_sinus_driver.link.telegram import Blocks
from nfo_sinus_driver.simulator.classic import Wrong
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.memory import Refused as FarRefusal
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.plc import Plc, PlcSetting
from nfo_sinus_driver.simulator.sdo import Abort

_T = TypeVar('_T')
#: What a transaction takes here, s.
_TURN = 0.005


class _PlainLink(DirectLink):
    """A line without frames, over which a drive is asked in some other way."""

    def _do(self, action: Callable[[SimulatedDrive], _T]) -> Reply:
        self._require_port()
        self._begin_request(b'')
        self._rig.elapse(_TURN)
        if not self._is_heard():
            self._rig.elapse(RESPONSE_TIMEOUT)
            raise NoAnswer('nobody answers')
        try:
            told = action(self._rig.far)
        except (Wrong, Abort, FarRefusal) as error:
            raise Refused(Refused.DEVICE_FAILURE, str(error)) from error
        return Reply(told if isinstance(told, bytes) else b'', self._rig.clock.now)


class ClassicLink(_PlainLink):
    """A line that speaks Classic."""

    protocol = PROTOCOLS['classic']

    def parts(self, address: Address) -> Any:
        if address.sub_index is None:
            return (address,)
        ids = address.index, address.sub_index
        return tuple(Address(address.space, id_, None, 2) for id_ in ids)

    def read(self, unit: int, address: Address) -> Reply:
        return self._do(
            lambda far: far.servers['classic'].enquiry(address.index).to_bytes(2, 'big')  # type: ignore[attr-defined]
        )

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        word = int.from_bytes(data, 'big')
        return self._do(
            lambda far: far.servers['classic'].select(address.index, word, to_all=False)  # type: ignore[attr-defined]
        )


class CanopenLink(_PlainLink):
    """A line that speaks CANopen."""

    protocol = PROTOCOLS['canopen']

    def read(self, unit: int, address: Address) -> Reply:
        place = address.index, address.sub_index or 0
        return self._do(lambda far: far.servers['canopen'].read(*place))  # type: ignore[attr-defined]

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        place = address.index, address.sub_index or 0
        return self._do(lambda far: far.servers['canopen'].write(*place, data))  # type: ignore[attr-defined]


class TelegramLink(_PlainLink):
    """A line to a PLC that has the drive on its fieldbus."""

    protocol = PROTOCOLS['modbus_tcp']

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        self._plc = Plc({1: rig.far}, PlcSetting())
        (self._unit,) = self._plc.units
        self._blocks = Blocks(self._ask, rig.clock.monotonic)

    def _ask(self, request: Any) -> tuple[bytes, float]:
        self._rig.elapse(_TURN)
        self._plc.advance_to(self._rig.clock.now)
        far = server(self._unit)
        if isinstance(request, modbus_pdu.WriteAndRead):
            words = _words(request.data)
            place = request.register, words, request.source, request.count
            told = far.write_and_read(*place)
        elif isinstance(request, modbus_pdu.Write):
            far.write(request.register, _words(request.data))
            told = ()
        else:
            told = far.read(request.register, request.count)
        return b''.join(one.to_bytes(2, 'big') for one in told), self._rig.clock.now

    def read(self, unit: int, address: Address) -> Reply:
        return self._blocks(1, address).read(address)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        return self._blocks(1, address).write(address, data)

    def write_and_read(
        self, unit: int, address: Address, data: bytes, source: Address
    ) -> Reply:
        return self._blocks(1, address).write_and_read(address, data, source)


def _words(data: bytes) -> tuple[int, ...]:
    return tuple(int.from_bytes(data[at : at + 2], 'big') for at in range(0, len(data), 2))


@dataclass(frozen=True)
class Way:
    """One way to command a drive."""

    link: Callable[[Rig], Any]
    model: str = 'sinus_g2'
    method: str = 'mode_scmd'
    reference: str = 'fieldbus'
    options: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)


WAYS: Mapping[str, Way] = {
    'G2, Modbus, MODE': Way(DirectLink),
    'G2, Modbus, control word': Way(DirectLink, method='drive_control'),
    'G2, Classic, MODE': Way(ClassicLink),
    'G2, Classic, control word': Way(ClassicLink, method='drive_control'),
    'G2, CANopen, MODE': Way(CanopenLink),
    'G2, CANopen, control word': Way(CanopenLink, method='drive_control'),
    'G2, telegram 1': Way(TelegramLink, method='telegram1'),
    'Optimal, MODE': Way(DirectLink, 'sinus_optimal'),
    'Optimal, control word': Way(DirectLink, 'sinus_optimal', 'drive_control', 'terminal'),
    'Optimal, telegram 1': Way(TelegramLink, 'sinus_optimal', 'telegram1'),
    'Sinus H, telegram 1': Way(TelegramLink, 'sinus_h', 'telegram1'),
    'MOVITRAC': Way(FramedLink, 'movitrac31', 'function_bits'),
}


class WayRig(Rig):
    """
    The driver of one drive, over one way.

    :ivar meet: called with each request, the parameter and whether it is written; what it returns
        goes wrong: ``refused``, ``busy``, ``lost``, ``late`` or, of a write, ``ignored``.
    """

    def __init__(self, way: Way, **settings: Any) -> None:
        parameters = dict(way.parameters)
        if way.model != 'sinus_h':
            parameters.update(ramps(way.model, 0.5, 0.5))
        far = simulated_drive(way.model, settings=parameters, **way.options)
        chosen = {'poll_rate': 20.0, 'control_method': way.method, 'reference': way.reference}
        super().__init__(far, DriveSettings(model=way.model, **{**chosen, **settings}), way.link)
        self.meet: Callable[[str, bool], str | None] = lambda key, written: None
        registers = self.drive.registers
        self._keys: dict[tuple[Any, ...], str] = {}
        for key in registers.model:
            if registers.reaches(key):
                for part in self.link.parts(registers.address(key)):
                    self._keys.setdefault(part[:3], key)
        for name, is_write in (('read', False), ('write', True), ('write_and_read', True)):
            setattr(self.link, name, self._met(getattr(self.link, name), is_write))

    def _met(self, call: Callable[..., Reply], is_write: bool) -> Callable[..., Reply]:
        def meet(unit: int, address: Address, *data: Any) -> Reply:
            key = self._keys.get(address[:3], '')
            wrong = self.meet(key, is_write)
            if wrong is None:
                return call(unit, address, *data)
            if wrong in ('refused', 'busy'):
                self.elapse(_TURN)
                raise Refused(Refused.BUSY if wrong == 'busy' else Refused.DEVICE_FAILURE)
            if wrong == 'late':
                call(unit, address, *data)
            if wrong == 'ignored':
                self.elapse(_TURN)
                return Reply(b'', self.clock.now)
            self.elapse(RESPONSE_TIMEOUT)
            raise NoAnswer('nobody answers')

        return meet

    @property
    def turns(self) -> bool:
        """Whether the drive turns the motor, or is about to; it may coast, or ramp to a stop."""
        return self.far.motor.driven and self.far.motor.demand != 0

    def ride(self, frequency: float = 20.0) -> None:
        """Connect, enable and turn, with a program that keeps on sending the set-point."""
        self.answer(self.drive.connect())
        self.drive.activate()
        self.pass_time(0.3)
        answer = self.answer(self.drive.enable())
        assert 'enabled' in answer, answer
        if self.settings.follows_setpoints:
            self.send(frequency)
        self.pass_time(2.0)
        assert abs(self.far.motor.frequency) > 5, self.far.motor.frequency
        self.notes.events.clear()

    def said(self, what: str | Cause) -> bool:
        """Whether an event says this."""
        return any(says(text, what) for _, _, text in self.notes.events)
