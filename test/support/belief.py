# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a driver believes, beside what the drive has said to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nfo_sinus_driver.link.interface import Refused, Reply
from nfo_sinus_driver.link.pairs import classic, movitrac
from support.rig import Rig

#: Whether a parameter was read, which, and the data that were answered, or nothing where it was
#: refused.
_Said = tuple[bool, int, bytes | None]


def _modbus(asked: bytes, said: bytes) -> _Said:
    register = int.from_bytes(asked[1:3], 'big')
    return asked[0] in (3, 4), register, None if said[0] & 0x80 else said[2:]


def _classic(asked: bytes, said: bytes) -> _Said:
    (request,), (answer,) = classic.Reader().feed(asked), classic.Reader().feed(said)
    data = answer.word.to_bytes(2, 'big') if isinstance(answer, classic.Value) else b''
    is_read = isinstance(request, classic.Enquiry)
    return is_read, request.number, None if isinstance(answer, classic.Nak) else data


def _movitrac(asked: bytes, said: bytes) -> _Said:
    (request,), (answer,) = movitrac.Reader().feed(asked), movitrac.Reader().feed(said)
    data = answer.value if isinstance(answer, movitrac.Data) else b''
    is_read = isinstance(request, movitrac.Enquiry)
    return is_read, request.index, None if isinstance(answer, movitrac.Nack) else data


class Judge:
    """
    Compares what a rig's link returns to what its drives answered.

    :ivar false: what this end believes and no drive has said since it was asked, and when that was.
    """

    def __init__(self, rig: Rig) -> None:
        self.false: list[tuple[float, str]] = []
        self._clock = rig.clock
        self._said: list[tuple[float, _Said]] = []
        protocol = rig.line.wire.protocol
        answer, unwrap = protocol.answer, protocol.unwrap
        name = rig.connection.protocol

        def noted(station: Any, request: Any) -> bytes:
            frame: bytes = answer(station, request)
            if frame and name in ('classic', 'movitrac'):
                decode = _classic if name == 'classic' else _movitrac
                self._said.append((self._clock.now, decode(request.body, frame)))
            elif frame:
                self._said.append((self._clock.now, _modbus(request.body, unwrap(frame).body)))
            return frame

        protocol.answer = noted
        for name_of in ('read', 'write'):
            call = getattr(rig.link, name_of)
            setattr(rig.link, name_of, self._judged(call, name_of == 'read'))

    def _judged(self, call: Callable[..., Reply], reads: bool) -> Callable[..., Reply]:
        def judge(unit: int, address: Any, *more: Any) -> Reply:
            begun = self._clock.now

            def said() -> list[bytes | None]:
                place = reads, address.index
                return [data for at, (*to, data) in self._said if (*to,) == place and at >= begun]

            try:
                reply = call(unit, address, *more)
            except Refused as error:
                if None not in said():
                    self.false.append((begun, f'{address.index:04X}h: {error}'))
                raise
            if not said() or (reads and reply.data not in said()):
                self.false.append((begun, f'{address.index:04X}h: {reply.data.hex()}'))
            return reply

        return judge
