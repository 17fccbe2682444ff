# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One line in virtual time: the port of a real link, and that of the simulated line at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
import heapq
import itertools
import math
from random import Random
from typing import Any

from nfo_sinus_driver.link import BusSettings, PortError
from nfo_sinus_driver.link.canopen.lawicel import LawicelPort
from nfo_sinus_driver.link.canopen.link import CanopenLink
from nfo_sinus_driver.link.interface import Link
from nfo_sinus_driver.link.modbus.tcp import TcpLink
from nfo_sinus_driver.link.pairs.movitrac import LONGEST_RESPONSE_TIME
from nfo_sinus_driver.link.protocols import link_class, protocol_of
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.endpoints import Endpoint
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Trace
from nfo_sinus_driver.simulator.plc import Plc, PlcSetting

_NEVER = float('inf')
#: How much later an answer comes that is late, in response time-outs.
_LATE = 1.5
#: How frames begin that a CANopen node answers, as an adapter takes them: SDO, and guarding.
_ANSWERED = (b't6', b'r7')
#: How long a gateway takes to accept a connection, s.
_ACCEPTS_AFTER = 0.001


class Clock:
    """The steady clock of everything in a rig."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now


class _Frames(Trace):
    """Keeps every frame in place of a file."""

    def __init__(self) -> None:
        self.frames: list[dict[str, Any]] = []
        self._end: float | None = None

    def record(
        self, direction: str, data: bytes, first: float, last: float, note: str = ''
    ) -> None:
        gap = 0.0 if self._end is None else first - self._end
        self._end = last if self._end is None else max(self._end, last)
        self.frames.append({
            'direction': direction, 'hex': data.hex(), 'first': first, 'last': last,
            'gap': gap, 'note': note,
        })


class Line:
    """
    A line, its simulated drives, and what is wrong with it.

    :param protocol: of the simulator; ``telegram1`` has a PLC between.
    :param addresses: one drive for each.
    :param settings: of the drives; :param options: of the family; ``run_input`` and ``boot_time``
        are among them.
    :param plc: how the PLC is programmed.
    :param echo: the adapter returns what is sent.
    :param any_counts: any message on the line counts for the own time-out of each drive [C127].
    :ivar state: ``whole``; ``silent``: nothing is heard; ``deaf``: what is asked is carried out,
        but no answer comes; ``noise``: the answer is damaged; ``late``: it comes after the
        time-out; ``gone``: the port is; ``mute``: nothing passes until it was opened again
        ``mute_for`` more times; ``bus_off``: the CAN adapter refuses frames until it was off the
        bus.
    :ivar opened: when the port was opened.
    :ivar sent_at: when the port took a frame last.
    :ivar boots_for: how long nothing passes after each opening, s, for what is there restarts by
        it; :ivar banner: what it says then at once.
    :ivar place: where it is; a test may plug it in somewhere else.
    :ivar losses: how many answers are still lost; :ivar unheard: how many requests are;
        :ivar doubled: how many answers come twice; ``doubled_at``: when the last one did.
    :ivar plan: called with each request; what it returns goes wrong with it: one of
        :data:`~nfo_sinus_driver.simulator.line_faults.ANSWER_FAULTS` or ``unheard``.
    :ivar passed: called whenever the clock went on.
    :ivar frames: every frame, as :class:`~nfo_sinus_driver.simulator.line.Trace` writes them.
    :ivar drives: the simulated ones, by address.
    """

    name = 'memory'

    def __init__(
        self,
        protocol: str,
        model: str,
        clock: Clock,
        addresses: Iterable[int],
        *,
        settings: Mapping[str, Any],
        options: Mapping[str, Any],
        baud: int | None = None,
        response_timeout: float = 0.2,
        request_gap: float = 0.0,
        gateway_timeout: float = 0.1,
        turnaround: float = 0.002,
        echo: bool = False,
        paced: bool = True,
        plc: Mapping[str, Any] | None = None,
        any_counts: bool = False,
    ) -> None:
        self._end = end = Endpoint(protocol, baud=baud or {'modbus_rtu': 57600}.get(protocol))
        self.clock = clock
        options = {'boot_time': 0.2, **options}
        self.drives: dict[int, SimulatedDrive] = {
            address: simulated_drive(model, address, settings=settings, **options)
            for address in addresses
        }
        self.plc = Plc(self.drives, PlcSetting(**(plc or {}))) if end.through_plc else None
        for far in self.drives.values():
            far.step = 0.02
            if self.plc is None:
                far.control_unit.set_to([(end.spoken, end.timing)])
        self._trace = _Frames()
        self.wire: Any = end.wire(
            self, list(self.drives.values()),  # type: ignore[arg-type]  # port and line in one
            list(self.drives.values()) if self.plc is None else self.plc.units,
            clock.monotonic, gateway_timeout=gateway_timeout, paced=paced, turnaround=turnaround,
            echo=echo, always_heard=False, trace=self._trace,
        )
        if any_counts:
            self.wire.any_counts = True
        self._stations = list(getattr(self.wire, 'stations', ()))
        self._protocol = protocol_of('modbus_tcp' if end.through_plc else protocol)
        self.settings = BusSettings(
            protocol=self._protocol.name,
            baud_rate=end.timing.baud,
            response_timeout=response_timeout,
            request_gap=request_gap,
        ).line
        # a damaged frame of CAN is no frame
        self._damage = 'drop' if protocol == 'canopen' else 'damage'
        self._seldom_at = 0.0
        self.passed: Callable[[], None] = lambda: None
        self.plan: Callable[[bytes], str | None] = lambda frame: None
        self.opened: list[float] = []
        self.sent_at = -_NEVER
        self.mute_for = 1
        self.boots_for = 0.0
        self.banner = b''
        self.place = 'the first socket'
        self.sessions: list[Session] = []
        self.refuses = self.lost = self.closes = False
        self._asking: Session | None = None
        self._come = b''
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._next: list[str] = []
        self.mend()
        self._advance()

    @property
    def frames(self) -> list[dict[str, Any]]:
        return self._trace.frames

    def link(self) -> Link:
        """Return a link on this line, as a driver that begins makes it."""
        now = self.clock.monotonic
        if self._protocol.name == 'modbus_tcp':
            timeout, gap = self.settings.response_timeout, self.settings.request_gap
            return TcpLink('gateway', 502, timeout, self._connect, now, gap)
        if self._protocol.name == 'canopen':
            rate = self.settings.baud_rate
            return CanopenLink(LawicelPort(self, rate, now), self.settings, now)
        return link_class(self._protocol)(self, self.settings, now)  # type: ignore[call-arg]

    # --- what is wrong ---

    def mend(self) -> None:
        """End all that is wrong with the line."""
        self.state = 'whole'
        self.losses = self.unheard = self.doubled = 0
        self.doubled_at = -math.inf
        self.noise = self.byte_noise = self.boots_for = 0.0
        self._random = Random(0)
        self._next.clear()
        self.wire.faults.heal()

    def make_noise(self, share: float, seed: int = 0) -> None:
        """Damage or lose this share of the answers from now on."""
        self.noise = share
        self._random = Random(seed)

    def damage_bytes(self, share: float, seed: int = 0) -> None:
        """Damage this share of all bytes from now on, both ways."""
        self.byte_noise = share
        self._random = Random(seed)

    @property
    def whole(self) -> bool:
        return self.passes and not (self.noise or self.byte_noise)

    @property
    def passes(self) -> bool:
        """Whether requests are carried out and answers come, but for some by chance."""
        broken = self.losses or self.unheard or self.doubled or self.boots
        return self.state == 'whole' and not broken

    @property
    def boots(self) -> bool:
        """Nothing passes yet, for the port was opened just before."""
        return bool(self.opened) and self.clock.now < self.opened[-1] + self.boots_for

    def unit_of(self, frame: bytes) -> int:
        """Return for whom a request is; -1: it is for the adapter."""
        match self._protocol.name:
            case 'canopen':
                return int(frame[1:4], 16) & 0x7F if frame[:2] in _ANSWERED else -1
            case 'classic':
                return frame[1] - 0x20
            case 'movitrac':
                return frame[1]
            case 'modbus_tcp':
                return frame[6]
            case _:
                return frame[0]

    def spoil(self, what: str) -> None:
        """Have the next request go wrong; see ``plan``."""
        self._next.append(what)

    def unplug(self, *addresses: int) -> None:
        """Take drives off the line; all others are on it."""
        self.wire.stations = [
            station for station in self._stations if station.address not in addresses
        ]

    def exchange(self, model: str) -> SimulatedDrive:
        """Put another drive in the place of the only one, switched on and at standstill."""
        (address,) = self.drives
        far = simulated_drive(model, address, boot_time=0.0)
        far.step = 0.02
        far.control_unit.set_to([(self._end.spoken, self._end.timing)])
        far.advance_to(self.clock.now)
        self.drives[address] = far
        self._stations[:] = self.wire.stations = [far]
        return far

    def _fate(self, frame: bytes) -> str | None:
        if self._protocol.name == 'canopen' and frame[:2] not in _ANSWERED:
            return self.plan(frame) or ('unheard' if self.state == 'silent' else None)
        if self._next:
            return self._next.pop(0)
        if (what := self.plan(frame)) is not None:
            return what
        if self.unheard or self.state == 'silent':
            self.unheard -= self.unheard > 0
            return 'unheard'
        if self.losses or self.state == 'deaf':
            self.losses -= self.losses > 0
            return 'drop'
        if self.doubled:
            self.doubled -= 1
            self.doubled_at = self.clock.now
            return 'double'
        # a frame with a damaged byte is none
        if self.byte_noise and self._random.random() > (1 - self.byte_noise) ** len(frame):
            return 'unheard'
        if self.noise and self._random.random() < self.noise:
            return self._damage if self._random.random() < 0.5 else 'drop'
        return {'noise': self._damage, 'late': 'delay'}.get(self.state)

    # --- time ---

    def go_to(self, moment: float) -> None:
        """Let the clock go on to a moment, and do everything that is due until then."""
        while (due := self._due) <= moment:
            self._tick(max(due, self.clock.now))
        if moment > self.clock.now:
            self._tick(moment)

    def later(self, at: float, do: Callable[[], None]) -> None:
        """Have something done at a moment."""
        heapq.heappush(self._events, (at, next(self._order), do))

    def stand_still(self, at: float, seconds: float) -> None:
        """Have the driver do nothing from a moment on, while all else goes on."""
        self.later(at, lambda: self.go_to(self.clock.now + seconds))

    @property
    def _due(self) -> float:
        return min(self.wire.due, self._events[0][0] if self._events else _NEVER)

    def _tick(self, moment: float) -> None:
        self.clock.now = moment
        while self._events and self._events[0][0] <= moment:
            heapq.heappop(self._events)[2]()
        self.wire.act(moment)
        self._advance()
        self.passed()

    def _advance(self) -> None:
        if self.plc is not None:
            self.plc.advance_to(self.clock.now)
            return
        # they need not be looked at whenever a byte comes, and many seldom: one that is asked
        # something catches up at that moment
        if self.clock.now < self._seldom_at:
            return
        self._seldom_at = self.clock.now + (0.02 if len(self.drives) > 2 else 0.01)
        for far in self.drives.values():
            far.advance_to(self.clock.now)

    # --- the port of the link ---

    def open(self) -> None:
        self._require_port()
        self._come = b''
        self.note_opening()

    def note_opening(self) -> None:
        """Note that the port is opened, or a connection: a mute one may end by that."""
        self.opened.append(self.clock.now)
        if self.boots_for:
            self._come += self.banner
            if self._protocol.name == 'canopen':
                self.later(self.clock.now + self.boots_for - 0.001, self._restart_adapter)
        if self.state == 'mute':
            self.mute_for -= 1
            if not self.mute_for:
                self.state, self.mute_for = 'whole', 1

    def _restart_adapter(self) -> None:
        """Take an adapter off the bus that has restarted, unless all is put right meanwhile."""
        if self.boots:
            self.wire.receive(b'C\r', self.clock.now)

    def close(self) -> None:
        self._come = b''

    def write(self, data: bytes) -> None:
        self._require_port()
        self.sent_at = self.clock.now
        if self.state == 'mute' or self.boots:
            return
        if self.state == 'bus_off' and self._bus_off(data):
            return
        fate = self._fate(data)
        if fate == 'unheard':
            if self._protocol.name != 'canopen':
                # what goes to an adapter is no frame
                now = self.clock.now
                self._trace.record('request', data, now, now, 'lost')
            return
        # what nothing answers would spoil a later answer
        if fate is not None and any(far.listening for far in self.drives.values()):
            # a MOVITRAC is waited for as long as P843 may have it wait, too
            more = LONGEST_RESPONSE_TIME if self._protocol.name == 'movitrac' else 0.0
            late = _LATE * (self.settings.response_timeout + more) if fate == 'delay' else 0.0
            self.wire.faults.add(fate, seconds=late)
        self.wire.receive(data, self.clock.now)

    def _bus_off(self, data: bytes) -> bool:
        """Answer as an adapter that has left the bus by itself; return whether it did."""
        if data.startswith((b't', b'r')):
            self._come += b'\a'
        elif data == b'F\r':
            self._come += b'FA4\r'
        elif data == b'C\r':
            self.state = 'whole'
        return self.state == 'bus_off'

    def read(self, until: float) -> bytes:
        self._require_port()
        while not self._come and (due := self._due) <= until:
            self._tick(max(due, self.clock.now))
        if not self._come:
            self.go_to(until)
        data, self._come = self._come, b''
        return data

    def _require_port(self) -> None:
        if self.state == 'gone':
            raise PortError('the port is gone')

    # --- the port of the simulated line ---

    def filenos(self) -> list[int]:
        return []

    def receive(self) -> bytes:
        return b''

    def send(self, data: bytes) -> None:
        if self.state == 'mute' or self.boots:
            return
        if self.byte_noise:
            data = bytes(map(self._damaged, data))
        if self._asking is None:
            self._come += data
        else:
            self._asking.take(data)

    def _damaged(self, byte: int) -> int:
        if self._random.random() >= self.byte_noise:
            return byte
        # a Classic line has seven bits
        return byte ^ 1 << self._random.randrange(7)

    def hang_up(self) -> None:
        self.state = 'gone'

    def come_back(self) -> None:
        self.state = 'whole'

    # --- another master ---

    def another_sends(self, frame: bytes, at: float) -> None:
        """Let another master begin to send a frame at a moment; this end hears it, too."""

        def arrive() -> None:
            # an adapter returns what this end sends, and nothing else
            echo, self.wire._echo = self.wire._echo, False
            self.wire.receive(frame, at)
            self.wire._echo = echo

        self.later(at, arrive)
        for number in range(len(frame)):
            end = at + (number + 1) * self.settings.char_time
            self.later(end, lambda byte=frame[number : number + 1]: self.send(byte))

    def another_asks(self, frame: bytes, every: float) -> None:
        """Let another master send a frame again and again from now on."""

        def again() -> None:
            self.another_sends(frame, self.clock.now)
            self.later(self.clock.now + every, again)

        self.later(self.clock.now, again)

    # --- connections ---

    def _connect(self, host: str, port: int) -> Session:
        self.sessions.append(Session(self))
        return self.sessions[-1]

    def ask(self, session: Session, data: bytes) -> None:
        """Take what a connection carries."""
        self._asking = session
        self.write(data)


class Session:
    """
    A connection to a gateway.

    What is wrong with all of them is said at the line: ``lost``, nothing of a new one arrives;
    ``refuses``, none is accepted; ``closes``, one ends with its first answer.

    :ivar mute: what is sent stays on its way, and nothing comes.
    :ivar stuck: what is on its way.
    """

    def __init__(self, line: Line) -> None:
        self._line = line
        self._is_closed = self._hung_up = False
        self.mute = False
        self.stuck: list[bytes] = []
        self._come = b''

    def open(self) -> None:
        if self._line.refuses or self._line.state == 'gone':
            raise ConnectionRefusedError(111, 'Connection refused')
        self._line.note_opening()

    def connected(self, until: float) -> bool:
        accepted = not self._line.lost
        self._line.go_to(self._line.clock.now + _ACCEPTS_AFTER if accepted else until)
        return accepted

    def write(self, data: bytes) -> None:
        if self._is_closed:
            raise ConnectionError('it is not open')
        if self._hung_up or self._line.state == 'gone':
            raise BrokenPipeError(32, 'Broken pipe')
        if self.mute:
            self.stuck.append(data)
        else:
            self._line.ask(self, data)

    def heal(self) -> None:
        """Let what is stuck arrive, unless it was discarded."""
        self.mute = False
        stuck, self.stuck = self.stuck, []
        for data in stuck:
            self._line.ask(self, data)

    def take(self, data: bytes) -> None:
        """Take bytes from the gateway."""
        if not (self._is_closed or self.mute):
            self._come += data

    def read(self, until: float) -> bytes:
        line = self._line
        if line.state == 'gone':
            raise ConnectionResetError(104, 'Connection reset by peer')
        while not self._come and not self._hung_up and (due := line._due) <= until:
            line._tick(max(due, line.clock.now))
        if self._come:
            data, self._come = self._come, b''
            self._hung_up = line.closes
            return data
        if self._hung_up:
            raise ConnectionAbortedError('the gateway closed it')
        line.go_to(until)
        return b''

    def close(self, *, discard: bool = False) -> None:
        self._is_closed = True
        if discard:
            self.stuck.clear()
