# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Runs of several drives on one line: what happens to the line, and what is called for then.

All motors turn at 20 Hz, and a program goes on with set-points, which are 10 Hz from the moment on
at which something happens. ``line_laws.py`` says what has to hold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
import functools
from typing import Any

from nfo_sinus_driver.drive import Cause, Report
from support.drive_timeout import by_default
from support.line_laws import LineLaws
from support.rig import CONNECTIONS, SLICE, Rig

#: What a program gives before something happens, and from then on, Hz.
_BEFORE, _AFTER = 20.0, 10.0
#: How long an exit waits for a stop, s.
_PATIENCE = 4.0
#: How long all motors have turned before, and within what time something happens, s.
_STEADY, _REQUESTS_FOR = 0.5, 1.0
#: What comes in the middle of a request comes so long after its beginning, s; within what time all
#: has been called for.
_AT_ONCE, _CALLED_BY = 0.001, 2.1
#: By when a port is opened again that is mute, s, besides three times what it needs after that.
_OPENED_AGAIN = 10.0
#: The longest pause of the first minute and a half while a stop is owed, s; and by when even what
#: needs longer to start is heard.
_LONGEST_PAUSE, _HEARD_AT_LAST = 8.0, 130.0
#: For how long a run goes on when all that happens has happened, s, and after the driver has ended:
#: longer than the time-out of any drive.
_GOES_ON = 8.0
_OUTLASTS = 4.0
_TIMES_AWAY = (0.3, 2.0, 4.0)
_TIMES_DEAF = (0.0, 3.0, 8.0, 20.0)
_TIMES_STILL = (1.0, 2.5, 3.5, 10.0)
_SHARES = (0.02, 0.05, 0.1, 0.2)
#: What a drive may refuse to tell, or not answer, by its model: none of it identifies it.
_UNTOLD: Mapping[str, tuple[str, ...]] = {
    'sinus_g2': (
        'control.mode', 'fieldbus.spd_scl_numerator', 'serial.sio_tot', 'serial.auto_stop',
    ),
    'sinus_optimal': ('fieldbus.mode',),
    'movitrac31': ('special.software_system', 'serial.pc_timeout', 'serial.control_mode'),
    CONNECTIONS['described'].model: ('serial.timeout', 'serial.fault'),
    CONNECTIONS['described, by pulses'].model: ('serial.timeout',),
    CONNECTIONS['described, by set-point'].model: ('serial.timeout',),
}
#: On these lines a damaged frame is none, or is sent again: what noise costs there are answers, as
#: if so many bytes had to be whole.
_CHECKED = ('canopen', 'modbus_tcp', 'telegram1')
_BYTES_BEHIND = 16


@dataclass(frozen=True)
class Kind:
    """
    A line, and what is on it.

    :ivar connection: of all its drives, one of :data:`support.rig.CONNECTIONS`.
    :ivar line: how it is.
    :ivar stops_itself: the driver sets the time-out of each drive, where it has one.
    """

    connection: str
    drives: int
    line: Mapping[str, Any] = field(default_factory=dict)
    stops_itself: bool = True

    @property
    def untold(self) -> tuple[str, ...]:
        """The parameters that do not identify a drive, which it may refuse to tell."""
        connection = CONNECTIONS[self.connection]
        return () if connection.protocol == 'telegram1' else _UNTOLD[connection.model]


_SLOW_BUT_USUAL = {'baud': 19200}
#: Any message counts for the time-out of each drive [C127].
_ANY_COUNTS = {**_SLOW_BUT_USUAL, 'any_counts': True}
KINDS: Mapping[str, Kind] = {
    **{f'rtu {number}': Kind('rtu', number, _SLOW_BUT_USUAL) for number in (1, 2, 3, 8, 16)},
    'rtu 3, any counts': Kind('rtu', 3, _ANY_COUNTS),
    'rtu 8, any counts': Kind('rtu', 8, _ANY_COUNTS),
    'rtu 3, no time-out': Kind('rtu', 3, _SLOW_BUT_USUAL, stops_itself=False),
    'tcp 4': Kind('tcp', 4),
    'canopen 4': Kind('canopen', 4),
    'classic 4': Kind('classic', 4),
    'movitrac 4': Kind('movitrac', 4),
    'described 4': Kind('described', 4),
    'by pulses 4': Kind('described, by pulses', 4),
    'by set-point 4': Kind('described, by set-point', 4),
    'optimal 4': Kind('optimal', 4),
    'plc 2': Kind('telegram1 g2', 2),
}


class LineRun:
    """
    One run.

    :param happens: called with each request once all motors turn, as the parameter, and whether it
        is written; returns one of :data:`HAPPENS` and one of :data:`CALLS`, the first time that
        something happens, else ``None``.
    :ivar lasts: how long what happens takes, s; 0: it does not end, or has ended at once.
    """

    def __init__(
        self, kind: Kind, happens: Callable[[str, bool], tuple[str, str] | None]
    ) -> None:
        self.kind = kind
        make = by_default if kind.stops_itself else Rig
        self.rig = rig = make(
            kind.connection,
            drives=kind.drives,
            line=kind.line,
            poll_rate=50.0,
            telemetry_rate=2.0,
            setpoint_timeout=2.5,
        )
        self.laws = LineLaws(rig)
        self._happens, self._has_happened = happens, False
        self.lasts = 0.0
        #: The stops of an end, while what is stopped has not been released.
        self._stops: dict[int, Future[Any]] = {}

    def run(self) -> None:
        """Go through it (AssertionError: a law is broken)."""
        rig = self.rig
        try:
            rig.turn(_BEFORE)
            self._until_told()
            rig.meet = self._meet
            self._go_on()
        except BaseException:
            # what its end would complain of comes from that
            rig.kill()
            raise
        rig.close()
        assert not self.laws.broken, '; '.join(self.laws.broken)

    def _meet(self, key: str, data: bytes | None) -> str | None:
        case = self._happens(key, data is not None)
        if case is not None:
            happens, calls = case
            self.rig.meet = lambda key, data: None
            self.laws.begin()
            self.give(_AFTER)
            HAPPENS[happens](self)
            delay, call = CALLS[calls]
            # in the middle of a request
            self._later(max(delay, _AT_ONCE), lambda: call(self))
            self._has_happened = True
        return None

    def _go_on(self) -> None:
        rig = self.rig
        until = rig.clock.now + _REQUESTS_FOR
        while not self._has_happened and rig.clock.now < until:
            rig.pass_time(SLICE)
        rig.pass_time(_CALLED_BY)
        if self._stops:
            self.outlast_driver()
        elif self._has_happened:
            rig.pass_time(self.lasts + _GOES_ON)

    def _later(self, seconds: float, do: Callable[[], None]) -> None:
        self.rig.line.later(self.rig.clock.now + seconds, do)

    def outlast_driver(self) -> None:
        """Let a driver end that was told to, and then the time-outs of the drives strike."""
        # what is not confirmed by then is not waited for any more
        self.rig.pass_time(2 * _PATIENCE)
        self.rig.kill()
        self.laws.ended()
        self.rig.line.go_to(self.rig.clock.now + _OUTLASTS)

    def begin_again(self) -> None:
        """Put all right, have all motors turn, and judge anew (AssertionError: they do not)."""
        rig = self.rig
        rig.send(None)
        self._mend()
        drives = rig.drives.values()
        for drive in drives:
            drive.on_stop(lambda why: None)
        # what was called for just now comes first
        rig.pass_time(_STEADY)
        rig.wait_until(
            lambda: all(drive.snapshot.connected and not drive.stop_unconfirmed for drive in drives)
        )
        for unit, far in rig.fars.items():
            if far.faults:
                rig.acknowledged += 1
                rig.answer(rig.drives[unit].acknowledge())
        rig.enable()
        self.give(_BEFORE)
        for far in rig.fars.values():
            rig.wait_until(lambda far=far: far.motor.frequency > 0.9 * _BEFORE, 5.0)
        self._until_told()
        self.laws = LineLaws(rig)
        self.laws.gave(_BEFORE)
        self.laws.begin()
        self._stops = {}

    def _mend(self) -> None:
        self.rig.line.mend()
        self.rig.line.plan = lambda frame: None
        self.rig.meet = lambda key, data: None

    def _until_told(self) -> None:
        """Let all motors turn for a while, and until each is told as enabled."""
        self.rig.pass_time(_STEADY)
        drives = self.rig.drives.values()
        self.rig.wait_until(lambda: all(drive.snapshot.enabled for drive in drives))

    def begin_with_another_driver(self) -> None:
        """End the driver, if it has not ended, and begin with another one."""
        self.rig.kill()
        self._mend()
        self.rig.begin()
        self.rig.connect()
        self.begin_again()

    def give(self, hertz: float | None) -> None:
        """Have the program give another set-point, or none any more."""
        self.rig.send(hertz)
        self.laws.gave(hertz)

    # --- what happens to the line ---------------------------------------------------------------

    def lose_answers_of(self, *units: int) -> None:
        """Lose all answers of some drives."""
        line = self.rig.line
        line.plan = lambda frame: 'drop' if line.unit_of(frame) in units else None

    def away(self, seconds: float) -> None:
        """Take the port away, and give it back."""
        line = self.rig.line
        line.state = 'gone'
        self._later(seconds, lambda: setattr(line, 'state', 'whole'))
        self.lasts = seconds

    def mute_and_deaf(self, seconds: float) -> None:
        """Let nothing pass until the port is opened again, and then for so long after each."""
        line = self.rig.line
        line.state, line.boots_for = 'mute', seconds
        # each pause before it is opened again is longer than the one before, but with a stop owed
        # none is longer than 8 s until a minute and a half is over
        self.lasts = _OPENED_AGAIN + 3 * seconds if seconds < _LONGEST_PAUSE else _HEARD_AT_LAST
        self.laws.heard_again_by = self.rig.clock.now + self.lasts

    def stand_still(self, seconds: float) -> None:
        """Let the program stand still."""
        self._later(_AT_ONCE, lambda: self.laws.stands_still(seconds))
        self.lasts = seconds

    def writes_unheard(self) -> None:
        """Let no write arrive from now on."""
        self.rig.meet = lambda key, data: None if data is None else 'unheard'
        self.laws.heard = False

    def damage(self, share: float) -> None:
        """Damage a share of all bytes from now on."""
        line = self.rig.line
        self.laws.noise = share
        if self.rig.connection.protocol in _CHECKED:
            line.make_noise(1 - (1 - share) ** _BYTES_BEHIND)
        else:
            line.damage_bytes(share)

    def fail_reads(self, what: str, seconds: float) -> None:
        """Let every read fail that identifies no drive, and the port be away for a while."""
        keys = self.kind.untold
        self.rig.meet = lambda key, data: what if key in keys and data is None else None
        self.away(seconds)

    # --- what is called for ---------------------------------------------------------------------

    def stop(self, *units: int) -> None:
        """Stop some drives, or all."""
        for unit in units or self.rig.drives:
            self.laws.called(unit, self.rig.drives[unit].stop())

    def stop_with(self) -> None:
        """Stop the last drive; all others stop with it."""
        *others, last = self.rig.drives

        def stop_others(why: Report) -> None:
            why = Report(Cause.STOPPED_WITH, drive='the last', why=why)
            for unit in others:
                self.rig.drives[unit].stop_beside(why)

        self.rig.drives[last].on_stop(stop_others)
        if not self.rig.drives[last].following:
            # they would have stopped with it before
            stop_others(Report(Cause.STOP_REQUESTED, by='the program'))
        for unit in others:
            self.laws.called(unit)
        self.stop(last)

    def end(self) -> None:
        """End the driver as a signal does: stop all, and release each as soon as it is stopped."""
        self.give(None)
        self._stops = {
            unit: drive.stop_for_good(_PATIENCE) for unit, drive in self.rig.drives.items()
        }
        for unit, stop in self._stops.items():
            self.laws.called(unit, stop)
        released: set[int] = set()

        def release() -> None:
            for unit, stop in self._stops.items():
                if unit not in released and stop.done() and stop.exception() is None:
                    released.add(unit)
                    self.rig.drives[unit].disconnect(1.0)

        self.rig.keep(release)


def _set(state: str) -> Callable[[LineRun], None]:
    return lambda run: setattr(run.rig.line, 'state', state)


_PARTIAL = functools.partial
#: What happens to a line.
HAPPENS: Mapping[str, Callable[[LineRun], None]] = {
    'nothing': lambda run: None,
    'all answers lost': _set('deaf'),
    # the second, or the only one; and each second one
    'answers of one lost': lambda run: run.lose_answers_of(min(2, run.kind.drives)),
    'answers of half lost': lambda run: run.lose_answers_of(*range(1, run.kind.drives + 1, 2)),
    'requests lost': _set('silent'),
    **{f'away for {time:g} s': _PARTIAL(LineRun.away, seconds=time) for time in _TIMES_AWAY},
    **{f'mute, then deaf for {time:g} s': _PARTIAL(LineRun.mute_and_deaf, seconds=time)
       for time in _TIMES_DEAF},
    **{f'stood still for {time:g} s': _PARTIAL(LineRun.stand_still, seconds=time)
       for time in _TIMES_STILL},
    'writes unheard': LineRun.writes_unheard,
    **{f'reads {what}, away for 2 s': _PARTIAL(LineRun.fail_reads, what=what, seconds=2.0)
       for what in ('refused', 'unheard')},
    **{f'{share:.0%} of bytes damaged': _PARTIAL(LineRun.damage, share=share)
       for share in _SHARES},
}

#: What is called for, and how long after something happened, s.
CALLS: Mapping[str, tuple[float, Callable[[LineRun], None]]] = {
    'no stop': (0.0, lambda run: None),
    'stop': (0.0, lambda run: run.stop(1)),
    'stop later': (2.0, lambda run: run.stop(1)),
    'stop all': (0.0, LineRun.stop),
    'stop all soon': (0.3, LineRun.stop),
    'stop all later': (2.0, LineRun.stop),
    'no set-points': (0.0, lambda run: run.give(None)),
    'stop with': (0.3, LineRun.stop_with),
    'end': (0.0, LineRun.end),
    'end soon': (0.3, LineRun.end),
    'end later': (2.0, LineRun.end),
}
