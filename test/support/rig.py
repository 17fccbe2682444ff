# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The driver below ROS and the simulated drives on one line, in virtual time and one thread.

Link, bus and drive are the real ones, and so are the simulated line and its drives; what stands
between is :mod:`support.rig_line`. The bus is stepped in place of its worker. So a minute of a
drive takes a second or two, nothing waits, and the same test always goes the same way. At the end
the laws are judged by every frame that was on the line.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future
import dataclasses
from dataclasses import dataclass, field
import math
from pathlib import Path
from typing import Any, NamedTuple

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.catalog import Kind, is_described
from nfo_sinus_driver.drive import (
    Cause,
    Drive,
    DriveSettings,
    Event,
    LogEntry,
    Severity,
    Snapshot,
    Telemetry,
)
from nfo_sinus_driver.drive.change.memory import Memory, ProcessMemory
from nfo_sinus_driver.link import Address, LinkError, Refused, Reply
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from support import golden, telegram_laws, trace_laws
from support.recognition_law import RecognitionLaw
from support.rig_line import Clock, Line
from support.said import Said, said, says
from support.variants import hardest, ramps, shipped

#: How far the clock goes at a time while nothing is due, s.
SLICE = 0.02
#: How many steps of the bus take no time in a row at most, such as those that read what is known.
_MOST_AT_ONCE = 2000
#: How often a program gives its set-point, or does what else it does, s.
_SENDING_PERIOD = 0.1
#: How long a drive takes to refuse something, s.
_TURN = 0.005
_REFUSALS = {
    'refused': Refused.DEVICE_FAILURE,
    'busy': Refused.BUSY,
    'none such': Refused.ILLEGAL_ADDRESS,
}


@dataclass(frozen=True)
class Connection:
    """
    One connection to a drive, and the way it is commanded.

    :ivar protocol: of the line, as the simulator calls it; ``telegram1`` goes through a PLC.
    :ivar options: of the simulated drive; :ivar driver: other settings of the driver.
    :ivar parameters: of the simulated drive, other than factory.
    :ivar hertz: what a set-point is that turns the motor with 1 Hz.
    :ivar closed: the terminals that start it.
    :ivar plc: how the PLC between is programmed.
    """

    protocol: str
    model: str = 'sinus_g2'
    method: str = 'mode_scmd'
    reference: str = 'fieldbus'
    options: Mapping[str, str] = field(default_factory=dict)
    driver: Mapping[str, Any] = field(default_factory=dict)
    parameters: Mapping[str, Any] = field(default_factory=dict)
    hertz: float = 1.0
    closed: tuple[int, ...] = ()
    plc: Mapping[str, Any] = field(default_factory=dict)


def _made_up(name: str) -> str:
    """Return the path of a file that describes a drive, beside this one."""
    return str(Path(__file__).with_name(f'{name}.vfd.yaml'))


_OLD = {'classic_dialect': 'v5.0'}
_DRIVECONTROL = {'telegram_words': 'drivecontrol'}
#: In Speed mode with a motor of four poles.
_SPEED: Mapping[str, Any] = {
    'driver': {'expected_control_mode': 'Speed', 'nominal_speed': 1500.0},
    'parameters': {'control.mode': 'Speed'},
    'hertz': 30.0,
}
_ABSENT = {'canopen_state_machine': 'absent'}
_ALONE = {**_ABSENT, 'canopen_ramp': 'ready', 'canopen_bus_mode': 'free'}
#: A law that is new is tested over all of them, and a connection that is new with every law.
CONNECTIONS: Mapping[str, Connection] = {
    'rtu': Connection('modbus_rtu'),
    'ascii': Connection('modbus_ascii'),
    'tcp': Connection('modbus_tcp'),
    'classic': Connection('classic'),
    'classic v5.0': Connection('classic', options={'dialect': '5.0'}, driver=_OLD),
    'canopen': Connection('canopen'),
    'canopen, no DriveStatus': Connection('canopen', options=_ABSENT),
    'rtu, control word': Connection('modbus_rtu', method='drive_control'),
    'classic, control word': Connection('classic', method='drive_control'),
    'canopen, control word': Connection('canopen', method='drive_control'),
    'canopen, ds402': Connection('canopen', method='ds402', hertz=30.0),
    'canopen, ds402 alone': Connection('canopen', method='ds402', options=_ALONE, hertz=30.0),
    'optimal': Connection('modbus_rtu', 'sinus_optimal'),
    'optimal ascii': Connection('modbus_ascii', 'sinus_optimal'),
    'optimal, control word': Connection('modbus_rtu', 'sinus_optimal', 'drive_control', 'terminal'),
    'movitrac': Connection('movitrac', 'movitrac31', 'function_bits'),
    'movitrac, by terminals': Connection(
        'movitrac', 'movitrac31', 'remote_setpoint', closed=(41,),
        parameters={'serial.control_mode': 'Remote setpoint'},
    ),
    'made up': Connection('modbus_rtu', 'acme', 'drive_control'),
    # drives that files describe: a direction word; a state machine; nothing tells who has control
    'described': Connection('modbus_rtu', shipped('delta_vfd_el'), 'custom'),
    'described, by states': Connection('modbus_rtu', shipped('abb_acs355'), 'custom'),
    'described, no holder': Connection('modbus_rtu', shipped('toshiba_vf_s11'), 'custom'),
    # each command is a coil that is set; and there is none beside the set-point
    'described, by pulses': Connection('modbus_rtu', _made_up('by_pulses'), 'custom'),
    'described, by set-point': Connection('modbus_rtu', _made_up('by_setpoint'), 'custom'),
    'telegram1 g2': Connection('telegram1', method='telegram1'),
    'telegram1 optimal': Connection('telegram1', 'sinus_optimal', 'telegram1'),
    'telegram1 g2, speed': Connection('telegram1', method='telegram1', **_SPEED),
    'telegram1 optimal, speed': Connection('telegram1', 'sinus_optimal', 'telegram1', **_SPEED),
    'telegram1 g2, drivecontrol': Connection(
        'telegram1', method='telegram1', options=_DRIVECONTROL, driver=_DRIVECONTROL
    ),
    'telegram1 sinus_h': Connection('telegram1', 'sinus_h', 'telegram1'),
    'telegram1 g2, mailbox': Connection('telegram1', method='telegram1', plc={'layout': 2}),
    'telegram1 sinus_h, mailbox': Connection(
        'telegram1',
        'sinus_h',
        'telegram1',
        parameters={'com.opt_para_13': 'Vendor Specific Telegram'},
        plc={'layout': 2, 'longer_telegram': True},
    ),
}


class Asked(NamedTuple):
    """
    A request as the link was given it, and what became of it.

    :ivar unit: to whom; one that no drive has is a broadcast.
    :ivar key: the parameter; :ivar data: what was written, ``None``: it was read.
    :ivar sent: when the port took it; minus infinity: it did not.
    :ivar ended: when that was over.
    :ivar answered: a valid frame of the unit came, be it a refusal.
    """

    unit: int
    key: str
    data: bytes | None
    sent: float
    ended: float
    answered: bool


class Noted(NamedTuple):
    """An event, and when it was reported."""

    at: float
    severity: Severity
    text: Said


class Notes:
    """A listener that keeps what is reported of one drive."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.snapshots: list[Snapshot] = []
        self.telemetry: list[Telemetry] = []
        self.events: list[Noted] = []
        self.parameters: list[str] = []
        self.entries: list[LogEntry] = []

    @property
    def snapshot(self) -> Snapshot | None:
        """The newest one."""
        return self.snapshots[-1] if self.snapshots else None

    def on_snapshot(self, snapshot: Snapshot) -> None:
        self.snapshots.append(snapshot)

    def on_telemetry(self, telemetry: Telemetry) -> None:
        self.telemetry.append(telemetry)

    def on_parameters(self, keys: Collection[str]) -> None:
        self.parameters += keys

    def on_log_entry(self, entry: LogEntry) -> None:
        self.entries.append(entry)

    def on_event(self, event: Event) -> None:
        self.events.append(Noted(self._clock.now, event.severity, said(event)))

    def said(self, what: str | Cause, severity: Severity | None = None) -> bool:
        """Return whether an event says this."""
        return any(
            says(event.text, what) for event in self.events if severity in (None, event.severity)
        )


class Rig:
    """
    Drives on one line, and the driver of each.

    A test that has a set-point given again and again, as programs do, calls :meth:`send`.

    :param connection: one of :data:`CONNECTIONS`.
    :param drives: how many, at the addresses from 1 on.
    :param parameters: of the simulated drives, other than factory; their ramps are short.
    :param options: of the simulated drives, beside those that make it hardest for the driver.
    :param line: of :class:`Line`, such as ``baud`` or ``response_timeout``.
    :param own: settings of one drive, by its address.
    :param settings: of every drive, as the driver has them; its own time-out is left alone where
        they do not say otherwise.
    :ivar fars: the simulated drives, by address; :ivar far: the first.
    :ivar drives: the driver's, by address; :ivar drive: the first.
    :ivar looked: called whenever something may have happened; an ``AssertionError`` of it ends the
        test, at the next :meth:`pass_time`, for a driver survives everything.
    :ivar meet: called with each request before it is sent, the parameter and what is written to it
        (``None``: it is read); what it returns goes wrong: ``refused``, ``busy``, ``none such``,
        ``unheard``, ``carried out, refused``,
        ``drop`` (carried out, not answered), ``damage``, ``double``, ``delay``, or ``ignored``.
    :ivar asked: every request, as ``meet`` has it, and its drive; what is read before a write in
        one piece stands as two.
    :ivar told: called with each request when it is over.
    :ivar acknowledged: how often the test itself has a fault acknowledged.
    :ivar excused: words of the complaints that may come as often as it does.
    :ivar memory: what the driver that begins after one that was killed finds.
    """

    def __init__(
        self,
        connection: str | Connection = 'rtu',
        *,
        drives: int = 1,
        parameters: Mapping[str, Any] | None = None,
        options: Mapping[str, Any] | None = None,
        line: Mapping[str, Any] | None = None,
        own: Mapping[int, Mapping[str, Any]] | None = None,
        **settings: Any,
    ) -> None:
        self.connection = connection = (
            CONNECTIONS[connection] if isinstance(connection, str) else connection
        )
        self.clock = Clock()
        quick = ramps(connection.model, 0.3, 0.3)
        line = dict(line or {})
        if connection.plc:
            line['plc'] = {**connection.plc, **line.get('plc', {})}
        if connection.protocol == 'canopen':
            settings = {'setpoint_timeout': 0.0, **settings}
        self.line = Line(
            connection.protocol,
            connection.model,
            self.clock,
            range(1, drives + 1),
            settings={**quick, **connection.parameters, **(parameters or {})},
            options={**hardest(connection.model), **connection.options, **(options or {})},
            **line,
        )
        golden.keep(self.line.frames)
        self.line.passed = self._passed
        self.fars = self.line.drives
        for far in self.fars.values():
            for terminal in connection.closed:
                far.control_unit.switch(terminal, True)
        usual = {
            'model': connection.model,
            'control_method': connection.method,
            'reference': connection.reference,
            'poll_rate': 10.0,
            'telemetry_rate': 0.5,
            'drive_timeout': 0.0,
            **connection.driver,
            **settings,
        }
        self._settings = {
            address: DriveSettings(**{**usual, 'address': address, **(own or {}).get(address, {})})
            for address in self.fars
        }
        self.looked: Callable[[], None] = lambda: None
        self.meet: Callable[[str, bytes | None], str | None] = lambda key, data: None
        self.asked: list[tuple[int, str, bytes | None]] = []
        self.told: Callable[[Asked], None] = lambda asked: None
        self.acknowledged = 0
        self.excused = ['that acknowledges']
        self.memory: Memory = ProcessMemory()
        self.unrecognised: list[str] = []
        self._broken: AssertionError | None = None
        self._program: Callable[[], None] | None = None
        self._program_at = 0.0
        self.begin()

    def begin(self) -> None:
        """Start a driver, as after :meth:`kill`."""
        self.link = self.line.link()
        self.notes_of = {address: Notes(self.clock) for address in self.fars}
        self.bus = Bus(self.link, now=self.clock.monotonic)
        self.law = law = RecognitionLaw(
            self.unrecognised,
            {address: settings.lost_after for address, settings in self._settings.items()},
            lambda: self.line.place,
            self.line.settings.response_timeout,
        )
        lose = self.bus._port.mark_lost

        def lost(*why: Any) -> None:
            law.port_lost()
            lose(*why)

        self.bus._port.mark_lost = lost  # type: ignore[method-assign]
        self.drives = {
            address: Drive(self.bus, settings, self.notes_of[address], self.memory)
            for address, settings in self._settings.items()
        }
        self._keys = {address: self._places(drive) for address, drive in self.drives.items()}
        for name in ('read', 'write', 'write_and_read', 'read_then_write'):
            setattr(self.link, name, self._met(getattr(self.link, name), name))

    def reset(self, **settings: Any) -> None:
        """Have the next driver begin with other settings of the first drive."""
        self._settings[1] = dataclasses.replace(self._settings[1], **settings)

    def kill(self) -> None:
        """End the driver without a word to the drive, as a power cut of the computer does."""
        self._program = None
        self.bus.close()

    def close(self) -> None:
        """End the driver, and judge what was on the line."""
        self.kill()
        found = self.violations()
        assert not self.unrecognised, self.unrecognised
        acknowledged = [
            complaint for complaint in found if any(words in complaint for words in self.excused)
        ]
        assert len(acknowledged) <= self.acknowledged, acknowledged
        assert len(found) == len(acknowledged), found
        # a mistake, be it of a test that replaces a part of the driver, may pass for a lost drive
        for notes in self.notes_of.values():
            assert not notes.said(Cause.DRIVER_ERROR), notes.events

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.kill()

    def violations(self) -> list[str]:
        """Return what breaks the laws of the house in the frames so far."""
        if self.connection.protocol == 'telegram1':
            words = self.connection.options.get('telegram_words', self.connection.model)
            return telegram_laws.violations(self.line.frames, words)
        if is_described(self.connection.model):
            # those laws are about registers of one family
            return []
        return trace_laws.violations(
            self.line.frames,
            -math.inf,
            self.connection.model,
            self.connection.protocol,
            self.connection.method,
        )

    # --- the first drive ---

    @property
    def far(self) -> SimulatedDrive:
        return self.fars[1]

    @property
    def drive(self) -> Drive:
        return self.drives[1]

    @property
    def notes(self) -> Notes:
        return self.notes_of[1]

    @property
    def a_fault(self) -> int:
        """The code of the first fault that a drive of this connection can have."""
        codes = self.far.memory.model.status_codes.values()
        return next(code.code for code in codes if code.kind is Kind.FAULT and code.requires_ack)

    @property
    def turns(self) -> bool:
        """The drive turns the motor, or is about to; it may coast, or ramp to a stop."""
        return self.far.motor.driven and self.far.motor.demand != 0

    # --- time ---

    def pass_time(self, seconds: float) -> None:
        """Let time pass for all."""
        end = self.clock.now + seconds
        self.judge(self.looked)
        steps, moved_at = 0, self.clock.now
        while self.clock.now < end:
            # a mistake in the link is an error that takes no time, and is tried again
            steps, moved_at = steps + 1 if self.clock.now == moved_at else 0, self.clock.now
            assert steps < _MOST_AT_ONCE, 'nothing takes time any more: see the log'
            if self._program is not None and self.clock.now >= self._program_at:
                self._program_at = self.clock.now + _SENDING_PERIOD
                self._program()
            until = min(self.bus.step(), end, self.clock.now + SLICE)
            self._require_consistent()
            if self._broken is not None:
                broken, self._broken = self._broken, None
                raise broken
            self.line.go_to(until)

    def wait_until(self, condition: Callable[[], object], patience: float = 60.0) -> None:
        """Let time pass until a condition holds; fail when it does not in time."""
        end = self.clock.now + patience
        while not condition():
            assert self.clock.now < end, 'it never came true'
            self.pass_time(SLICE)

    def answer(self, future: Future[Any], patience: float = 60.0) -> Said:
        """Let time pass until a command is answered; return what it says, done or not."""
        self.wait_until(future.done, patience)
        return said(future.exception() or future.result())

    def result(self, future: Future[Any], patience: float = 60.0) -> Any:
        """Let time pass until a command is answered; return its result, or raise its error."""
        self.wait_until(future.done, patience)
        return future.result()

    def send(self, value: float | None, *addresses: int) -> None:
        """Have a program give a set-point, Hz, again and again from now on; ``None``: it ends."""
        chosen = addresses or tuple(self.drives)

        def give() -> None:
            for address in chosen if value is not None else ():
                self.drives[address].set_setpoint(self.connection.hertz * value)

        self.keep(give)

    def keep(self, program: Callable[[], None]) -> None:
        """Have a program do something again and again from now on."""
        self._program, self._program_at = program, self.clock.now

    def judge(self, look: Callable[[], None]) -> None:
        """Keep what a look complains of until it can be raised."""
        try:
            look()
        except AssertionError as complaint:
            self._broken = self._broken or complaint

    def _passed(self) -> None:
        self.judge(self.looked)

    def _require_consistent(self) -> None:
        """Ensure that the state of control says what there is of a stop, and who is followed."""
        for drive in self.drives.values():
            controller = drive._controller
            if controller is None:
                continue
            control, sequence = drive.state.control, controller._sequence
            active = sequence._task is not None or sequence._external > 0
            said = f'{control.state.name}, and a stop is {"" if active else "not "}on its way'
            assert control.stopping == active, said
            assert drive.following == control.enabled

    # --- usual steps ---

    def connect(self, *, parameters: bool = False) -> Rig:
        """Connect to all drives and activate them; return the rig."""
        for future in [drive.connect(parameters=parameters) for drive in self.drives.values()]:
            self.result(future)
        for drive in self.drives.values():
            drive.activate()
        self.pass_time(0.2)
        return self

    def enable(self, *addresses: int) -> None:
        """Enable some drives, or all."""
        for future in [self.drives[address].enable() for address in addresses or self.drives]:
            answer = self.answer(future)
            assert 'enabled' in answer, answer
        # what is asked for in the very moment of enabling does not come after it
        self.pass_time(SLICE)

    def turn(self, frequency: float = 20.0) -> Rig:
        """Connect, enable and turn; a program keeps on giving the set-point; return the rig."""
        self.connect()
        self.enable()
        if self.drive.settings.follows_setpoints:
            self.send(frequency)
        for far in self.fars.values():
            self.wait_until(lambda far=far: abs(far.motor.frequency) > 0.98 * frequency, 5.0)
        self.pass_time(0.3)
        for notes in self.notes_of.values():
            notes.events.clear()
        return self

    def assert_only_enable_helps(self, frequency: float = 20.0) -> None:
        """Nothing turns although set-points keep arriving, until enable is called."""
        self.send(frequency)
        self.pass_time(1.0)
        assert not self.drive.following
        assert not self.turns
        self.enable()
        self.wait_until(lambda: abs(self.far.motor.frequency) > 0.9 * frequency, 1.5)

    # --- requests ---

    def spoil(self, what: str, key: str, times: int = 1, *, written: bool = True) -> None:
        """Have the next requests that write a parameter, or read it, go wrong; see ``meet``."""
        left = [times]

        def meet(asked: str, data: bytes | None) -> str | None:
            if not left[0] or asked != key or (data is not None) != written:
                return None
            left[0] -= 1
            return what

        self.meet = meet

    def written(self, key: str, address: int = 1) -> list[int]:
        """Return what was written to a parameter, each as one number of the drive, in order."""
        params = self.drives[address].params
        codec = params.model[key].at(params.protocol).codec
        return [
            codec.decode(data)
            for unit, asked, data in self.asked
            if unit == address and asked == key and data is not None
        ]

    def number(self, data: bytes) -> int:
        """Return what is written as one number, the first word in front as on Modbus."""
        if self.connection.protocol == 'canopen':
            data = b''.join(data[at : at + 2][::-1] for at in range(0, len(data), 2))
        return int.from_bytes(data, 'big')

    def _places(self, drive: Drive) -> dict[tuple[Any, ...], str]:
        params, keys = drive.params, {}
        for key in params.model:
            if params.protocol in params.model[key].addresses:
                for part in self.link.protocol.parts(params.address(key)):
                    keys.setdefault(part[:3], key)
        return keys

    def _met(self, call: Callable[..., Reply], name: str) -> Callable[..., Reply]:
        law = self.law

        def meet(unit: int, address: Address, *data: Any) -> Reply:
            # what all obey is a parameter of each
            keys = self._keys.get(unit, self._keys[min(self._keys)])
            key = keys.get(address[:3], '')
            written = data[0] if name in ('write', 'write_and_read') else None
            self.asked.append((unit, key, written))
            if unit in self.fars:
                law.asked(unit, address, writes=name != 'read', now=self.clock.now)
            begun = self.clock.now
            try:
                reply = send(unit, address, key, written, *data)
            except LinkError as error:
                law.ended(unit, error, reads=False, now=self.clock.now)
                tell(begun, unit, key, written, error.responded or isinstance(error, Refused))
                raise
            law.ended(unit, None, reads=name == 'read', now=self.clock.now)
            tell(begun, unit, key, written, answered=unit in self.fars)
            return reply

        def tell(
            begun: float, unit: int, key: str, written: bytes | None, answered: bool
        ) -> None:
            at = self.line.sent_at
            sent = at if at >= begun else -math.inf
            # what was not sent was answered by the link itself
            answered = answered and sent > -math.inf
            self.told(Asked(unit, key, written, sent, self.clock.now, answered))

        def send(
            unit: int, address: Address, key: str, written: bytes | None, *data: Any
        ) -> Reply:
            wrong = self.meet(key, written)
            if wrong in _REFUSALS:
                self.line.sent_at = self.clock.now
                self.line.go_to(self.clock.now + _TURN)
                raise Refused(_REFUSALS[wrong])
            if wrong == 'carried out, refused':
                call(unit, address, *data)
                raise Refused(Refused.DEVICE_FAILURE)
            if wrong == 'ignored':
                self.line.go_to(self.clock.now + _TURN)
                return Reply(b'', self.clock.now)
            if wrong is not None:
                self.line.spoil(wrong)
            return call(unit, address, *data)

        return meet
