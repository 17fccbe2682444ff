# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the tests of the drives' parameters share: services, and what arrives at the drives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import contextlib
from dataclasses import dataclass
import functools
import itertools
import json
import re
from typing import Any, TypeAlias

from bench import Bench, Client, Process, wait_until
from connections import UNFRAMED, Connection
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter, parameter_value_to_python
from setting_names import SETTINGS
from support.ends import Ends, of_g2
from support.variants import hardest
from support.wire import understand

from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.simulator import Simulator

Value: TypeAlias = float | int | str | bool

#: The one setting that has no register: Classic alone reaches it.
ANY_BUS = 'control.any_bus'
#: Little else is on the line, so that it is quick.
QUIET = ('-p', 'poll_rate:=10', '-p', 'telemetry_rate:=0')
#: Every write is counted: a drive that has to wait for the processor is not asked twice.
COUNTED = (*QUIET, '-p', 'response_timeout:=2.0')

#: There are very many calls, so each is looked after more often than usual, s.
_PERIOD = 0.001
_READING = (3, 17, 43)
_WRITE_ONE = 6
_WRITE_SEVERAL = 16
_WRITE_AND_READ = 23
#: MODE, SCMD and the set-point: their Classic names [M0 §6.1], and their registers.
_COMMANDS = {'E0029': 0x0294, 'E00AD': 0x0298, 'E001E': 0x03FC}
#: MODE = Bus and Stop, SCMD = Stop, set-point 0: nothing turns by them.
_HARMLESS = frozenset(((0x0294, (3,)), (0x0294, (1,)), (0x0298, (0,)), (0x03FC, (0,))))
#: Register and Classic id of the settings that tests write [M0 table 2, 4]. Of what has none the
#: id stands for the register.
_PLACES = {
    'motor.p_nom': (0x0220, 'E0008'), 'motor.u_nom': (0x0224, 'E0009'),
    'control.accel': (0x027E, 'E001D'), 'control.retard': (0x0282, 'E001C'),
    'control.auto_start': (0x02C8, 'E0033'), 'control.st_mode': (0x0290, 'E0032'),
    ANY_BUS: (-0x38, 'E0038'), 'freque.op_mode': (0x02E4, 'E0031'),
    'freque.f_fix1': (0x02E8, 'E0041'), 'pi_reg.setmin': (0x0380, 'E004B'),
    'pi_reg.reg_amp': (0x0398, 'E0052'), 'serial.address': (0x03D0, 'E00A9'),
    'serial.si_baud': (0x03D4, 'E00A8'), 'serial.si_prot': (0x03D8, 'E00AA'),
    'serial.sio_tot': (0x03DC, 'E00AB'), 'serial.auto_stop': (0x03E4, 'E00D8'),
}
_BY_ID = {id_: name for name, (_, id_) in _PLACES.items()}
#: Those whose steps are others on Classic.
_OTHER_STEPS = {'motor.p_nom', 'control.accel', 'control.retard'}


@dataclass(frozen=True, eq=False)
class Write:
    """
    A request to write that arrived at a drive; its words as on the bus, the low one first.

    Where the steps of a setting are others on Classic, a write by Classic is like any to the same
    register that is given in the words of Modbus.

    :ivar other_steps: the words are of Classic, and on Modbus they would be others.
    """

    unit: int
    register: int
    words: tuple[int, ...]
    other_steps: bool = False

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Write):
            return NotImplemented
        same = (self.unit, self.register) == (other.unit, other.register)
        return same and (self.other_steps != other.other_steps or self.words == other.words)

    def __lt__(self, other: Write) -> bool:
        return (self.unit, self.register) < (other.unit, other.register)


class Wire:
    """Reads what a trace has of requests to write, by hand and without the catalog."""

    def __init__(self, bench: Bench) -> None:
        self._trace = bench.trace
        self._written = _WRITTEN[bench.connection.protocol]
        #: Older firmware takes settings under bus control alone: MODE and a stop go along [C100].
        #: One that is in bus mode when it is found is commanded to stop.
        stopped = bench.connection.dialect == '5.0' or 'local' not in bench.connection.features
        self._aside = _HARMLESS if stopped else frozenset()
        self._read = 0

    def writes(self) -> list[Write]:
        """Return what arrived since the last call, without what went along with settings."""
        return [
            write
            for write in self.every_write()
            if (write.register, write.words) not in self._aside
        ]

    def written(self) -> list[Write]:
        """Return the same, once what was written to a drive again that had not answered in time."""
        return [write for write, _ in itertools.groupby(self.writes())]

    def every_write(self) -> list[Write]:
        """Return what arrived since the last call."""
        with self._trace.open('rb') as stream:
            stream.seek(self._read)
            text = stream.read()
        # the last line may not be complete yet
        text = text[: text.rfind(b'\n') + 1]
        self._read += len(text)
        frames = (json.loads(line) for line in text.splitlines() if b'"request"' in line)
        writes = (self._written(bytes.fromhex(frame['hex'])) for frame in frames)
        return [write for write in writes if write is not None]


def _modbus(data: bytes) -> Write | None:
    unit, function = data[:2]
    if function in _READING:
        return None
    if function == _WRITE_AND_READ:
        # what is read, then a write of several
        data = data[:2] + data[6:]
        function = _WRITE_SEVERAL
    register = data[2] << 8 | data[3]
    if function == _WRITE_ONE:
        payload = data[4:6]
    else:
        assert function == _WRITE_SEVERAL, data.hex()
        payload = data[7 : 7 + data[6]]
        assert len(payload) == data[6] == 2 * (data[4] << 8 | data[5]), data.hex()
    words = (payload[at] << 8 | payload[at + 1] for at in range(0, len(payload), 2))
    return Write(unit, register, tuple(words))


def _classic(data: bytes) -> Write | None:
    select = re.fullmatch(rb'\x04(.)\x02(E....)=(....)\x03.', data, re.DOTALL)
    if select is None:
        return None
    unit, name, word = select[1][0] - 0x20, select[2].decode(), int(select[3], 16)
    if name in _COMMANDS:
        return Write(unit, _COMMANDS[name], (word,))
    if name in _BY_ID:
        return written(_BY_ID[name], (word,), unit, classic=True)
    return Write(unit, -int(name[1:], 16), (word,))


def _movitrac(data: bytes) -> Write | None:
    request = understand(data, 'movitrac')
    assert request is not None
    return None if request.words is None else Write(request.unit, request.place, request.words)


def _canopen(data: bytes) -> Write | None:
    request = understand(data, 'canopen')
    if request is None or request.words is None:
        return None
    return Write(request.unit, request.place, request.words)


_WRITTEN: Mapping[str, Callable[[bytes], Write | None]] = {
    'modbus_rtu': lambda frame: _modbus(UNFRAMED['modbus_rtu'](frame)),
    'modbus_ascii': lambda frame: _modbus(UNFRAMED['modbus_ascii'](frame)),
    'modbus_tcp': lambda frame: _modbus(UNFRAMED['modbus_tcp'](frame)),
    'classic': _classic,
    'movitrac': _movitrac,
    'canopen': _canopen,
}


@functools.cache
def settings(connection: Connection) -> tuple[str, ...]:
    """Return the ROS parameter of every setting that a connection reaches."""
    if 'parameters' not in connection.features:
        return ()
    names = (line.split(',')[2] for line in SETTINGS.splitlines() if line)
    return tuple(name for name in names if name not in connection.beyond)


def ends_of(connection: Connection) -> dict[str, Ends]:
    """Return the same with their ends there; the test is skipped where there is no manual."""
    printed = of_g2(connection.protocol, connection.dialect)
    return {name: printed[name] for name in settings(connection)}


def register(name: str) -> int:
    """Return the register of a setting."""
    return _PLACES[name][0]


def written(
    name: str, words: tuple[int, ...], unit: int = 1, *, classic: bool = False
) -> Write:
    """Return the request that writes words to a setting; those of Modbus, or of Classic."""
    return Write(unit, register(name), words, classic and name in _OTHER_STEPS)


def set_each(client: Client, *settings: tuple[str, Value | None]) -> list[Any]:
    """Set parameters one by one, as ``ros2 param set`` and ``load`` do; return the results."""
    future = set_each_async(client, *settings)
    wait_until(future.done, 'set_parameters answers', period=_PERIOD)
    results: list[Any] = future.result().results
    assert len(results) == len(settings)
    return results


def set_each_async(client: Client, *settings: tuple[str, Value | None]) -> Any:
    """Begin to set parameters one by one; return the future."""
    messages = [Parameter(name, value=value).to_parameter_msg() for name, value in settings]
    return client.call_async('set_parameters', SetParameters, parameters=messages)


def set_one(client: Client, name: str, value: Value | None) -> Any:
    """Set one parameter; return the result."""
    return set_each(client, (name, value))[0]


def values(client: Client, *names: str) -> dict[str, Any]:
    """Return the values of parameters, which must be declared."""
    future = client.call_async('get_parameters', GetParameters, names=names)
    wait_until(future.done, 'get_parameters answers', period=_PERIOD)
    answer = future.result().values
    assert len(answer) == len(names), f'some of {names} are not declared'
    return {
        name: parameter_value_to_python(value)
        for name, value in zip(names, answer, strict=True)
    }


def says_once(driver: Process, text: str) -> None:
    """Wait until a driver has logged something, and see that it is there once."""
    wait_until(lambda: text in driver.text, f'{text!r} in the log')
    assert driver.text.count(text) == 1


def refused(result: Any, *parts: str) -> None:
    """See that a parameter was not set, and that the reason says all of it."""
    assert not result.successful
    missing = [part for part in parts if part not in result.reason]
    assert not missing, f'{missing} not in: {result.reason}'


class Stubborn(contextlib.ExitStack):
    """A simulated drive in this process, so that a test can make it behave as no manual says."""

    def __init__(self, bench: Bench) -> None:
        super().__init__()
        #: What can be set over the connection of the bench.
        self.names = settings(bench.connection)
        self.simulator = Simulator(
            **bench.line, trace=str(bench.trace), **hardest(bench.connection.model)
        )
        self.drive: SimulatedDrive = self.simulator.drives[1]

    def __enter__(self) -> Stubborn:
        self.enter_context(self.simulator)
        return self

    def before_requests(self, happens: Callable[[str, str], None]) -> None:
        """Have a function called with 'read' or 'write' and the name; it may raise `Refused`."""
        read, write = self.drive.read_raw, self.drive.write_raw

        def read_raw(key: str) -> int:
            happens('read', key)
            return read(key)

        def write_raw(key: str, raw: int) -> None:
            happens('write', key)
            write(key, raw)

        with self.simulator.lock:
            self.drive.read_raw = read_raw  # type: ignore[method-assign]
            self.drive.write_raw = write_raw  # type: ignore[method-assign]

    def parameters(self) -> dict[str, Value]:
        """Return what the drive has."""
        shown: dict[str, Value] = self.simulator.state()['parameters']
        return {name: shown[name] for name in self.names}
