# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A line with simulated drives, running in a thread, for programs and for tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import contextlib
import functools
import itertools
import os
import select
import threading
import time
from typing import Any

from nfo_sinus_driver.families import USUAL
from nfo_sinus_driver.simulator.control import ControlServer, control_path, require_free, typed
from nfo_sinus_driver.simulator.drive import SimulatedDrive, describe
from nfo_sinus_driver.simulator.endpoints import GATEWAY_TIMEOUT, Endpoint
from nfo_sinus_driver.simulator.family import load, simulated_drive
from nfo_sinus_driver.simulator.injections import INJECTIONS, Parser, Target, add_verbs
from nfo_sinus_driver.simulator.line import Trace
from nfo_sinus_driver.simulator.plc import Plc, PlcSetting
from nfo_sinus_driver.simulator.timing import sharpen_timers

#: How often every drive catches up with the clock while no request comes (s).
_TICK = 0.05
#: A drive does not catch up when something is due within this time (s).
_HURRY = 0.0005


class Simulator:
    """
    Simulated drives on one line, or on several; a context manager.

    Arguments are the options of the command ``simulator``, which explains them, but for these:

    :param addresses: one drive for each.
    :param baud: of the line and of the drives; by default the protocol's.
    :param control: path of the control channel; ``''`` for the default one, ``None`` for none.
    :param plc: how the PLC is programmed, where one stands before the drives.
    :param options: what else :func:`~nfo_sinus_driver.simulator.family.simulated_drive` takes:
        ``settings``, ``run_input``, ``boot_time``, and what can be chosen of this family.
    :raises ValueError: a wrong address, model, protocol, baud rate, parameter or option.
    :raises PortError: the port or link cannot be had.
    :raises ControlError: another simulator is there.

    :ivar port: what a master opens, of the first line.
    :ivar ports: the same of every line.
    :ivar control: path of the control channel, or ``None``.
    :ivar finished: it serves no more, because it was stopped or because of a failure.
    :ivar failure: what made the thread of the line fail, or ``None``.
    :ivar plc: the PLC before the drives, or ``None``.
    :ivar drives: the drives by the addresses they began with; hold :attr:`lock` to touch them.
    """

    def __init__(
        self,
        addresses: Sequence[int] = (1,),
        *,
        model: str = USUAL,
        protocol: str = 'modbus_rtu',
        link: str | None = None,
        tcp: int | None = None,
        baud: int | None = None,
        char_format: str | None = None,
        also: Sequence[str] = (),
        echo: bool = False,
        gateway_timeout: float = GATEWAY_TIMEOUT,
        paced: bool = False,
        turnaround: float = 0.0,
        trace: str | None = None,
        control: str | None = None,
        serial_numbers: Sequence[str] = (),
        plc: PlcSetting | None = None,
        **options: Any,
    ) -> None:
        first = Endpoint(protocol, link=link, tcp=tcp, baud=baud, char_format=char_format)
        endpoints = [first, *map(Endpoint.parse, also)]
        if echo and not first.can_echo:
            raise ValueError(f'{protocol} has no echo')
        _require_possible(addresses, endpoints)
        if len(serial_numbers) > len(addresses):
            raise ValueError(f'{len(serial_numbers)} serial numbers for {len(addresses)} drives')
        self.drives = {
            address: simulated_drive(model, address, serial_number=number, **options)
            for address, number in itertools.zip_longest(addresses, serial_numbers)
        }
        for drive, endpoint in itertools.product(self.drives.values(), endpoints):
            if endpoint.tables not in drive.servers:
                raise ValueError(f'{model} does not speak {endpoint.protocol}')
        self.plc = _plc_before(self.drives, endpoints, plc)
        self._injections = {**INJECTIONS, **load(model).injections}
        self._parser = _parser_of(model)
        self.lock = threading.RLock()
        self.control: str | None = None
        self.failure: Exception | None = None
        self.finished = threading.Event()
        self._wake_read, self._wake_write = -1, -1
        self._thread: threading.Thread | None = None
        drives = list(self.drives.values())
        with contextlib.ExitStack() as stack:
            if control == '' and first.tcp is None:
                control = control_path(link)
            if control:
                require_free(control)
            self.lines = []
            for number, endpoint in enumerate(endpoints):
                port = endpoint.open()
                stack.callback(port.hang_up)
                line = endpoint.wire(
                    port,
                    drives,
                    drives if self.plc is None else self.plc.units,
                    time.monotonic,
                    gateway_timeout=gateway_timeout,
                    paced=paced,
                    turnaround=turnaround,
                    echo=echo and not number,
                    always_heard=number > 0,
                    trace=_trace(stack, trace, number),
                )
                self.lines.append(line)
            self.line = self.lines[0]
            self.ports = tuple(line.port.name for line in self.lines)
            self.port = self.ports[0]
            if control == '':
                control = control_path(tcp=int(self.port.rpartition(':')[2]))
            if control is not None:
                server = ControlServer(
                    control, {'state': self.state, 'states': self.states, 'inject': self._inject}
                )
                stack.callback(server.close)
                self.control = control
            # nothing went wrong: keep it all until stop()
            self._clean_up = stack.pop_all()
        self.timing = first.timing

    def start(self) -> None:
        """Begin to serve."""
        self._wake_read, self._wake_write = os.pipe()
        now = time.monotonic()
        for moving in self._moving:
            moving.advance_to(now)
        self._thread = threading.Thread(target=self._run, name='simulated line', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop serving and remove everything that was made; a second call does nothing."""
        if self._thread is not None:
            self.finished.set()
            os.write(self._wake_write, b'.')
            self._thread.join()
            with self.lock:
                self._thread = None
                os.close(self._wake_read)
                os.close(self._wake_write)
        self._clean_up.close()

    def __enter__(self) -> Simulator:
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.stop()
        if kind is None and self.failure is not None:
            raise RuntimeError('the simulated line broke down') from self.failure

    def state(self, address: int | None = None) -> dict[str, Any]:
        """Return the state of a drive as it is now; without an address, of the only one."""
        with self.lock:
            at = self._at(address)
            (self.plc or at.drive).advance_to(at.now)
            found = describe(at.drive)
            return found if self.plc is None else {**found, 'plc': at.channel.describe()}

    def states(self) -> dict[int, dict[str, Any]]:
        """Return the states of all drives, by the addresses they began with."""
        return {address: self.state(address) for address in self.drives}

    def inject(
        self, verb: str, *values: object, address: int | None = None, **flags: bool
    ) -> None:
        """Let something happen: a verb of ``simulator inject`` with its arguments."""
        self._inject(typed(verb, *values, **flags), address)

    def _inject(self, words: Sequence[str], address: int | None = None) -> None:
        given = self._parser.parse_args(words)
        with self.lock:
            at = self._at(address)
            if address is not None or len(self.drives) == 1:
                (self.plc or at.drive).advance_to(at.now)
            self._injections[given.verb].do(at, given)
            if self._thread is not None:
                os.write(self._wake_write, b'.')

    @property
    def _moving(self) -> Sequence[SimulatedDrive | Plc]:
        """What has to catch up with the clock; a PLC sees to its drives."""
        return list(self.drives.values()) if self.plc is None else [self.plc]

    def _at(self, address: int | None) -> Target:
        """Return a drive as it is now; without an address, the only one."""
        return Target(self.line, self.drives, self.plc, address, time.monotonic())

    def _run(self) -> None:
        try:
            sharpen_timers()
            self._serve()
        except Exception as error:
            self.failure = error
            raise
        finally:
            self.finished.set()

    def _serve(self) -> None:
        turn = list(self._moving)
        tick = time.monotonic()
        while not self.finished.is_set():
            due = self._due
            ports = {number: line for line in self.lines for number in line.port.filenos()}
            wait = max(0.0, min(due, tick) - time.monotonic())
            ready, _, _ = select.select([*ports, self._wake_read], [], [], wait)
            with self.lock:
                if self._wake_read in ready:
                    os.read(self._wake_read, 4096)
                for number, line in ports.items():
                    data = line.port.receive() if number in ready else b''
                    if data:
                        line.receive(data, time.monotonic())
                now = time.monotonic()
                for line in self.lines:
                    line.act(now)
                if now < tick:
                    continue
                due = self._due
                if due < now + _HURRY:
                    tick = due + _HURRY
                else:
                    # one drive at a time, so that an answer never waits for all of them
                    moving = turn.pop(0)
                    turn.append(moving)
                    moving.advance_to(now)
                    tick = now + _TICK / len(turn)

    @property
    def _due(self) -> float:
        """When one of the lines has something to do."""
        return min(line.due for line in self.lines)


@functools.cache
def _parser_of(model: str) -> Parser:
    """Return what takes the words of an injection; it takes a while to make."""
    parser = Parser()
    add_verbs(parser, {**INJECTIONS, **load(model).injections})
    return parser


def _require_possible(addresses: Sequence[int], endpoints: Sequence[Endpoint]) -> None:
    """Ensure that addresses are there, are different, and can be on all these lines."""
    for address in addresses:
        if addresses.count(address) > 1:
            raise ValueError(f'address {address} is given twice')
        for endpoint in endpoints:
            endpoint.check(address)
    if not addresses:
        raise ValueError('a line needs a drive')


def _plc_before(
    drives: Mapping[int, SimulatedDrive], endpoints: Sequence[Endpoint], setting: PlcSetting | None
) -> Plc | None:
    """Return the PLC before the drives; where there is none they are set to their lines."""
    protocol = endpoints[0].protocol
    if endpoints[0].through_plc:
        if len(endpoints) > 1:
            raise ValueError(f'{protocol}: behind a PLC drives have no other line')
        return Plc(drives, setting or PlcSetting())
    if setting is not None or any(endpoint.through_plc for endpoint in endpoints):
        raise ValueError(f'there is no PLC on a line of {protocol}')
    for drive in drives.values():
        drive.control_unit.set_to([(endpoint.spoken, endpoint.timing) for endpoint in endpoints])
    return None


def _trace(stack: contextlib.ExitStack, path: str | None, number: int) -> Trace | None:
    """Return what writes down the frames of a line, into a file that closes with the stack."""
    if path is None:
        return None
    name = f'{path}.{number + 1}' if number else path
    return Trace(stack.enter_context(open(name, 'w', encoding='utf-8')))
