# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One set-point, or a stop, for all drives of a Classic line by one broadcast [M0 §6.1.4]."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
import dataclasses
import math

from nfo_sinus_driver.bus import Bus, LatestValue, Priority, Transfer
from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.drive.events import Cause, Report
from nfo_sinus_driver.drive.setpoint import Request, Setpoint
from nfo_sinus_driver.link import Address, LinkError


@dataclasses.dataclass(frozen=True)
class Told:
    """What to say of set-points for all: why nobody follows them, or that they are limited."""

    refused: Report | None = None
    limited: Report | None = None


class SetpointAll:
    """
    What all drives of a line are to follow.

    Every drive obeys a broadcast, and none confirms it. So it is sent only where all of them are
    enabled here and it means the same to each; it is a request to each drive as one of its own, of
    which the newest counts; and each is asked afterwards whether it took it.

    :param setpoints: the set-points of all drives of the line, by name.
    :param tell: called on the bus after each request.
    """

    def __init__(
        self,
        bus: Bus,
        setpoints: Callable[[], Mapping[str, Setpoint]],
        tell: Callable[[Told], None],
    ) -> None:
        self._bus = bus
        self._setpoints = setpoints
        self._tell = tell
        self._slot = LatestValue(self._make, self._done)
        #: The newest request; written by any thread, at once.
        self._request = Request(math.nan, -math.inf)

    def request(self, value: float) -> None:
        """Ask for a set-point, from any thread; a :class:`ValueError` if it is not finite."""
        if not math.isfinite(value):
            raise ValueError(f'a set-point of {value} is no number')
        self._request = Request(value, self._bus.now())
        self._bus.request(self._slot)

    def _make(self) -> Transfer | None:
        setpoints = self._setpoints()
        refused = self._why_not(setpoints)
        if refused is not None:
            self._tell(Told(refused=refused))
            return None
        if not all(setpoint.counts(self._request) for setpoint in setpoints.values()):
            return None
        name, least = min(setpoints.items(), key=lambda item: item[1].most)
        request = self._request._replace(most=least.most)
        self._tell(Told(limited=_limited(request, name)))
        members = tuple(setpoints.values())
        if not all(setpoint.is_newest(request) for setpoint in members):
            # one of them was asked for something else since: it must not be given this any more
            for setpoint in members:
                setpoint.follow(request)
            return None
        for setpoint in members:
            setpoint.take(request)
        due = [write for setpoint in members for write in setpoint.due(request)]
        everybody = self._bus.protocol.broadcast
        assert everybody is not None, 'this is one of the reasons why not'
        return self._bus.write(everybody, *due[0], Priority.SETPOINT) if due else None

    def _done(self, transfer: Transfer, error: LinkError | None) -> None:
        for setpoint in self._setpoints().values():
            if error is None:
                assert transfer.data is not None
                setpoint.was_told(transfer.address, transfer.data)
            else:
                setpoint.was_missed(error)

    def _why_not(self, setpoints: Mapping[str, Setpoint]) -> Report | None:
        if self._bus.protocol.broadcast is None:
            return Report(Cause.NO_BROADCAST)
        for name, setpoint in setpoints.items():
            if (refused := setpoint.why_not_shared(name)) is not None:
                return refused
        meanings = {setpoint.quantity: name for name, setpoint in setpoints.items()}
        if len(meanings) > 1:
            told = ', '.join(
                f'{name}: {" ".join(quantity).strip()}' for quantity, name in meanings.items()
            )
            return Report(Cause.MEMBERS_DIFFER, meanings=told)
        places = {setpoint.place: name for name, setpoint in setpoints.items()}
        if len(places) > 1:
            return Report(Cause.MEMBERS_WRITTEN_DIFFERENTLY, names=' and '.join(places.values()))
        return None


def _limited(request: Request, name: str) -> Report | None:
    if abs(request.value) <= request.most:
        return None
    limited = math.copysign(request.most, request.value)
    return Report(Cause.SHARED_SETPOINT_LIMITED, value=request.value, limited=limited, name=name)


async def broadcast_stop(bus: Bus, models: Iterable[Family]) -> None:
    """Release the motors of all drives of a line with a broadcast; nobody confirms it."""
    everybody = bus.protocol.broadcast
    assert everybody is not None, 'the protocol has a broadcast'
    addressing = bus.protocol.addressing
    for model in dict.fromkeys(models):
        stop = model.profile.broadcast_stop
        if stop is not None:
            parameter = model[stop.key]
            address = Address(*parameter.at(addressing).place)
            data = parameter.encode(stop.value, addressing)
            await bus.write(everybody, address, data, Priority.STOP)
