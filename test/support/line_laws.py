# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What must hold for each motor of a line that stops answering, judged from both ends of the line.

S1: a drive that was asked in vain, and sent no valid frame for ``lost_after`` since that request,
is lost: this is told within 0.3 s, in noise with the end of the request under way, for which the
line is silent first; and ``enabled`` is false. Where no drive of the line answers and
two were asked in vain (one, if the line has one), each that is enabled counts as asked from the
first of these requests on.

S2: a stop for it has been on the wire 0.5 s after that, or 0.3 s after it was called for; besides
there is the rest of the request under way, and the stops of all that are due, one after the other,
each of which waits as long as the drive has ever taken to answer. One that is not answered goes
twice.

S3: or the motor is stopped by the time-out of the drive: whatever the driver still sends does not
keep it from striking. In noise the drives share the time. One that answers is asked before its own
does, whatever becomes of the others. A drive without one is looked for once a second, and stopped
with its first answer. A port that needs a while after it was opened is opened more and more seldom,
until it passes something.

S4: no more goes to a drive before a stop that is due than a short look: what tells whether it is
there, and the same.

S5: nothing is told as stopped, ramping to a stop or following that is not.

What was sent and what answered is known from the link and its port, what the motors do from the
simulated drives, what is told from what the driver publishes. Nothing else of the driver is asked.
"""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass, field
import math
from typing import Any

from nfo_sinus_driver.drive import Cause, Snapshot
from nfo_sinus_driver.link.pairs.movitrac import LONGEST_RESPONSE_TIME
from support.rig import Asked, Rig
from support.said import says
from support.stops import takes_run_away

#: S1: within this a loss is told, s.
_TOLD = 0.3
#: S2: within this a stop is on the wire after a loss, after it was called for, and how long it may
#: take until a port that is back is opened, s.
_AFTER_LOSS, _AFTER_CALL, _OPENED = 0.5, 0.3, 0.6
#: S3: how much longer than its time-out a drive is left in peace, and how seldom one is looked for
#: that has none, s.
_IN_PEACE, _LOOKED_FOR = 0.5, 1.0
#: By what share of damaged bytes the motor of one drive is stopped after how long, s.
_IN_NOISE = {0.02: 2.0, 0.05: 4.0, 0.1: 8.0, 0.2: 20.0}
#: S4: the firmware and a status of two words are three requests, and one may be repeated.
_SHORT_LOOK = 4
#: Another drive may be in the place of one that was silent for longer, s.
_SAME = 3.0
#: How soon a simulated drive carries out what it hears, and a PLC what it is given, s.
_CARRIED_OUT = 0.3
#: How often is looked, s, and what a look may come too late.
_LOOKS, _SLACK = 0.01, 0.02
#: How long a set-point is tried again in noise before it has failed, s.
_TRIED_AGAIN = 2.0
#: A request and its gaps have no more characters than this.
_CHARACTERS = 24
#: How long a gateway waits for a drive, s, and what its answer takes.
_GATEWAY = 0.12
#: By when the motor of a set-point is at least near it, Hz.
_NEAR = 0.3


@dataclass
class _Unit:
    """
    One drive, as it was seen from both ends of the line.

    :ivar asked_at: when the first request in vain was sent since its last valid frame.
    :ivar answered_at: when the last request was sent that it has answered.
    :ivar longest: the longest time from a request to the end of its answer, s.
    :ivar stop_at: when the last request was sent that takes its run command away.
    :ivar due_since: since when a stop is due that was not sent; infinite: none is.
    :ivar due_within: how long after that it has to be sent, s.
    :ivar asked_since_due: how many requests it has got since a stop is due that could be sent.
    :ivar again_by: by then a stop goes a second time that was not answered; infinite: none has to.
    :ivar running: its motor may run by this driver: it did, and no stop was sent since.
    :ivar stopped_with: what was told last when that was sent.
    :ivar to_stand_since: since when its motor has to be stopped, and is not.
    :ivar tried_at: when the newest set-point was first sent to it.
    :ivar strays_since: since when it is told as following, and does not.
    :ivar claims_since: since when it is told as stopped, and is not.
    :ivar ramps_from: when it was told that it ramps to a stop.
    :ivar answers: to the stops that were called for.
    :ivar broken: the laws that it has broken; each is told once.
    """

    asked_at: float = math.inf
    answered_at: float = math.inf
    longest: float = -math.inf
    stop_at: float = -math.inf
    due_since: float = math.inf
    due_within: float = 0.0
    asked_since_due: int = 0
    again_by: float = math.inf
    running: bool = False
    stopped_with: Snapshot | None = None
    to_stand_since: float = math.inf
    tried_at: float = math.inf
    strays_since: float = math.inf
    claims_since: float = math.inf
    ramps_from: float = math.inf
    answers: list[Future[Any]] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)


class LineLaws:
    """
    Watches the drives of a rig whose motors run by its driver, from :meth:`begin` on.

    :ivar broken: what breaks a law, in sentences.
    :ivar heard: what a drive is told reaches it as soon as the line is whole; false: writes do not.
    :ivar noise: this share of the bytes is damaged.
    :ivar heard_again_by: by then something is heard of the line again.
    :ivar began: when something happened first.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig, self._clock, self._line = rig, rig.clock, rig.line
        self._units = {unit: _Unit() for unit in rig.drives}
        self.began = math.inf
        self._looked_at = rig.clock.now
        #: When the first request in vain was sent since the last valid frame of any drive, when
        #: that frame came, and whom it was in vain for since.
        self._asked_at, self._frame_at = math.inf, rig.clock.now
        self._in_vain: set[int] = set()
        #: When a silence ended in which each drive may have become another one.
        self._back_at = -math.inf
        #: Since when the port is there, and since when answers come.
        self._there_since = self._whole_since = -math.inf
        #: What the program gives, Hz, and how many events were seen of each drive.
        self._wanted: float | None = None
        self._events = dict.fromkeys(rig.drives, 0)
        #: From when on the driver stood still, for how long, s, and whether it does.
        self._stood_from, self._stood_for, self._stands = math.inf, 0.0, False
        self._has_ended = False
        self.broken: list[str] = []
        self.heard, self.noise = True, 0.0
        self.heard_again_by = math.inf
        rig.told = self._take
        rig.looked = self._look

    # --- what happens ---------------------------------------------------------------------------

    def begin(self) -> None:
        """Judge from now on: all motors turn."""
        self.began = self._clock.now
        for number, notes in self._rig.notes_of.items():
            self._events[number] = len(notes.events)
            self._units[number].running = self._turns(number)

    def gave(self, hertz: float | None) -> None:
        """Note what the program gives from now on."""
        self._wanted = hertz
        for unit in self._units.values():
            unit.strays_since = unit.tried_at = math.inf

    def called(self, number: int, answer: Future[Any] | None = None) -> None:
        """Note that a stop is called for, and what it is answered by."""
        unit = self._units[number]
        self._due(unit, self._clock.now, _AFTER_CALL)
        if answer is not None:
            unit.answers.append(answer)

    def ended(self) -> None:
        """Note that the driver has ended: what it told last counts no more."""
        self._has_ended = True

    def stands_still(self, seconds: float) -> None:
        """Let the driver not run for so long, s, and all else go on: that is no silence."""
        self._stood_from, self._stands = self._clock.now, True
        self._line.go_to(self._clock.now + seconds)
        self._stood_for, self._stands = seconds, False
        self._asked_at += seconds
        for unit in self._units.values():
            unit.asked_at += seconds
            # what was called for meanwhile is due from now on
            unit.again_by += seconds
            unit.answered_at += seconds
            unit.due_since = min(unit.due_since + seconds, max(unit.due_since, self._clock.now))
            unit.to_stand_since = min(
                unit.to_stand_since + seconds, max(unit.to_stand_since, self._clock.now)
            )
            unit.strays_since = unit.claims_since = math.inf

    def _take(self, asked: Asked) -> None:
        """Take a request that is over."""
        if asked.sent <= self._stood_from < asked.ended:
            asked = asked._replace(sent=asked.sent + self._stood_for)
        stops = asked.sent > -math.inf and takes_run_away(self._rig, asked.key, asked.data)
        unit = self._units.get(asked.unit)
        if unit is None:
            # all obey it
            for number in self._units if stops else ():
                self._stopped(number, asked.sent)
            return
        if asked.answered:
            unit.longest = max(unit.longest, asked.ended - asked.sent)
            unit.answered_at = asked.sent
            unit.asked_at = self._asked_at = math.inf
            if asked.ended - self._frame_at > _SAME:
                self._back_at = asked.ended
            self._frame_at = asked.ended
            self._in_vain.clear()
            for each in self._units.values():
                # the line is not silent
                each.again_by = math.inf
        elif asked.sent > -math.inf:
            unit.asked_at = min(unit.asked_at, asked.sent)
            self._asked_at = min(self._asked_at, asked.sent)
            self._in_vain.add(asked.unit)
        if asked.data is not None and asked.sent > -math.inf:
            unit.tried_at = min(unit.tried_at, asked.sent)
        if stops:
            if not asked.answered:
                self._not_answered(unit, asked.ended)
            self._stopped(asked.unit, asked.sent)
        elif asked.sent > unit.due_since and self._reaches_since < asked.sent:
            # nothing is kept back from one that has stopped by itself
            unit.asked_since_due += self._turns(asked.unit)

    def _stopped(self, number: int, at: float) -> None:
        unit = self._units[number]
        if unit.due_since < math.inf and unit.asked_since_due > _SHORT_LOOK:
            asked = unit.asked_since_due
            self._break('S4', number, f'has got {asked} requests before its stop, due since',
                        unit.due_since)
        unit.stop_at, unit.due_since = at, math.inf
        unit.running = False
        unit.stopped_with = self._rig.notes_of[number].snapshot

    def _not_answered(self, unit: _Unit, at: float) -> None:
        """Note that a stop was not answered."""
        if unit.due_since < math.inf:
            # behind the first and the second of each other, which waits for its whole time-out
            reads = 2 if self._rig.connection.protocol == 'movitrac' else 1
            unit.again_by = at + _AFTER_LOSS + reads * len(self._units) * self._under_way
        else:
            unit.again_by = math.inf

    def _due(self, unit: _Unit, since: float, within: float) -> None:
        """Note that a stop is due for a drive; the earliest counts."""
        if unit.running and since + within < unit.due_since + unit.due_within:
            if unit.due_since == math.inf:
                unit.asked_since_due = 0
            unit.due_since, unit.due_within = since, within

    @property
    def _reaches_since(self) -> float:
        """Since when what is sent reaches the drives, and they answer; infinite: it does not."""
        return self._whole_since if self.heard else math.inf

    # --- the laws -------------------------------------------------------------------------------

    def _look(self) -> None:
        now = self._clock.now
        self._watch_line()
        if now - self._looked_at < _LOOKS or self._stands:
            return
        self._looked_at = now
        if now > self.heard_again_by and not self._has_ended:
            self.heard_again_by = math.inf
            if self._frame_at < self.began + _LOOKED_FOR:
                self.broken.append('S3: nothing is heard of the line any more')
        for number, unit in self._units.items():
            snapshot = self._rig.notes_of[number].snapshot
            # one that was stopped and not enabled again does not run by this driver
            told = snapshot if snapshot is not unit.stopped_with else None
            enabled = told is not None and told.enabled
            unit.running = unit.running or (enabled and self._turns(number))
            if self.began == math.inf:
                continue
            if self._has_ended:
                self._judge_standstill(number, unit)
                continue
            followed = snapshot is None or (snapshot.enabled and snapshot.connected)
            if not followed and self._turns(number):
                self._due(unit, now, _AFTER_LOSS)
            self._judge_loss(number, unit)
            self._judge_stop(number, unit)
            self._judge_standstill(number, unit)
            self._judge_answers(number, unit)
            self._judge_told(number, unit)

    def _watch_line(self) -> None:
        now, line = self._clock.now, self._line
        if line.state == 'gone':
            self._there_since = math.inf
        elif self._there_since == math.inf:
            self._there_since = now
        whole = line.passes and not self.noise
        if not whole:
            self._whole_since = math.inf
        elif self._whole_since == math.inf:
            self._whole_since = now

    def _turns(self, number: int) -> bool:
        """Return whether a drive turns its motor, or is about to; it may coast, or ramp down."""
        motor = self._rig.fars[number].motor
        return bool(motor.driven and motor.demand != 0)

    def lost_at(self, number: int) -> float:
        """Return when a drive is lost by S1; infinite: it is not asked in vain."""
        unit, settings = self._units[number], self._rig.drives[number].settings
        whole_line = len(self._in_vain) >= min(2, len(self._units))
        snapshot = self._rig.notes_of[number].snapshot
        enabled = unit.running or (snapshot is not None and snapshot.enabled)
        asked_at = min(unit.asked_at, self._asked_at if whole_line and enabled else math.inf)
        return asked_at + settings.lost_after

    def _judge_loss(self, number: int, unit: _Unit) -> None:
        """Judge S1."""
        lost_at = self.lost_at(number)
        # an answer that comes before a loss has to be told may be in time
        within = _TOLD + self._waits_longer + (self._under_way if self.noise else 0.0)
        if self._clock.now <= lost_at + within + _SLACK:
            return
        self._due(unit, lost_at, _AFTER_LOSS)
        snapshot = self._rig.notes_of[number].snapshot
        if snapshot is not None:
            told = [name for name in ('connected', 'enabled') if getattr(snapshot, name)]
            if told:
                self._break('S1', number, f'is told as {" and ".join(told)}, lost at', lost_at)

    @property
    def _waits_longer(self) -> float:
        """How much longer than usual a request waits on this line, s: P843 of a MOVITRAC."""
        return LONGEST_RESPONSE_TIME if self._rig.connection.protocol == 'movitrac' else 0.0

    @property
    def _under_way(self) -> float:
        """How long the request under way may take, s."""
        return self._frame + self._line.settings.response_timeout + self._waits_longer

    @property
    def _frame(self) -> float:
        """How long a request takes, s, with the silence that the drives want before it."""
        gap = max(drive.model.profile.gap for drive in self._rig.drives.values())
        return _CHARACTERS * self._line.settings.char_time + gap

    def _round(self, looks: int, since: float) -> float:
        """
        Return how long the stops take that are due, s.

        :param looks: how many requests go before each.
        :param since: those that were sent since then are of the same round.
        """
        least = _GATEWAY if self._rig.connection.protocol == 'modbus_tcp' else 0.0
        return sum(
            (1 + looks) * (self._frame + (max(each.longest, least) if each.longest > 0 else 0.2))
            for each in self._units.values()
            if each.due_since < math.inf or each.stop_at >= since
        )

    def _judge_stop(self, number: int, unit: _Unit) -> None:
        """Judge S2."""
        if self._there_since == math.inf:
            return
        if self._line.plc is not None and not self._turns(number):
            # its program has taken the word of a driver away that it does not hear
            return
        # that it was sent is known when it is over
        again_by = max(unit.again_by, self._there_since + _OPENED + _AFTER_LOSS)
        if self._clock.now > again_by + self._under_way:
            self._break('S2', number, 'gets no second stop, due at', unit.again_by)
        if unit.due_since == math.inf:
            return
        since = max(unit.due_since, self._there_since + _OPENED)
        # the first answer of one drive tells nothing of the others
        may_be_others = since - self._frame_at > _SAME or self._back_at >= since
        looks = _SHORT_LOOK if may_be_others else 0
        until = since + unit.due_within + self._under_way + self._round(looks, unit.due_since)
        if self.noise:
            # what is damaged is waited for until the line is silent, and may be any of the others
            until += len(self._units) * self._under_way
        if self._line.plc is not None:
            # the driver writes to no PLC that has not answered for so long: by then its program
            # stops the drive, and counts from what it heard last, which may be later
            until += self._line.plc.setting.ros_time
        if self._clock.now > until + _SLACK:
            self._break('S2', number, 'has no stop on the wire, due since', unit.due_since)

    def drive_timeout(self, number: int) -> float | None:
        """Return how soon a drive stops its motor by itself, s; ``None``: it does not."""
        settings = self._rig.drives[number].settings
        if self._line.plc is not None:
            # its program stops the drive of a driver that does not live
            return self._line.plc.setting.ros_time
        return settings.wanted_drive_timeout or None

    def _judge_standstill(self, number: int, unit: _Unit) -> None:
        """Judge S3."""
        own = self.drive_timeout(number)
        asked_by = max(unit.answered_at, self._there_since + _OPENED) + (own or math.inf)
        if self.noise:
            # so many requests to others may be in vain before
            asked_by += len(self._units) * self._under_way
        # one that is told as lost may be left in peace
        snapshot = self._rig.notes_of[number].snapshot
        told = snapshot is not None and snapshot.connected
        may_answer = told and unit.running and unit.asked_at == math.inf and not self._has_ended
        if may_answer and self._clock.now >= asked_by:
            self._break('S3', number, 'gets no request in time, the last one at', unit.answered_at)
        if not self._turns(number):
            unit.to_stand_since = math.inf
            return
        if unit.due_since < unit.to_stand_since:
            unit.to_stand_since = unit.due_since
        if unit.to_stand_since == math.inf or not self.heard:
            return
        share = self.noise
        until = math.inf
        if share:
            # all share the time, and each is repeated until its status is read whole
            until = unit.to_stand_since + _IN_NOISE[share] * len(self._units)
        elif own is not None:
            until = unit.to_stand_since + _AFTER_LOSS + own + _IN_PEACE
        elif self._reaches_since < math.inf and not self._has_ended:
            until = max(unit.to_stand_since, self._reaches_since) + _LOOKED_FOR
        until += self._under_way + self._round(_SHORT_LOOK, unit.to_stand_since) + _CARRIED_OUT
        if self._clock.now > until:
            self._break('S3', number, 'turns its motor, to be stopped since', unit.to_stand_since)

    def _judge_answers(self, number: int, unit: _Unit) -> None:
        """Judge S5, of what is answered."""
        for answer in [future for future in unit.answers if future.done()]:
            unit.answers.remove(answer)
            if answer.exception() is None and self._turns(number):
                self._break('S5', number, 'is answered as stopped at', self._clock.now)

    def _judge_told(self, number: int, unit: _Unit) -> None:
        """Judge S5, of what is told."""
        now, drive = self._clock.now, self._rig.drives[number]
        notes, snapshot = self._rig.notes_of[number], self._rig.notes_of[number].snapshot
        if snapshot is None:
            return
        patience = drive.settings.lost_after + _TOLD + self._round(0, now) + _CARRIED_OUT
        if self.noise:
            # before it is sent it waits for those of all others, many of which take all their time,
            # and for a stop, whose status goes ahead of them until it is read whole
            patience += max(2 * len(self._units) * self._under_way, _TRIED_AGAIN) + self._under_way
        stopped = not (snapshot.enabled or drive.stop_owed or drive.stop_waits)
        claims = stopped and self._turns(number)
        unit.claims_since = min(unit.claims_since, now) if claims else math.inf
        if now > unit.claims_since + _CARRIED_OUT:
            self._break('S5', number, 'is told as stopped, and turns since', unit.claims_since)
        follows = snapshot.enabled and snapshot.connected and self._wanted is not None
        motor = self._rig.fars[number].motor
        strays = follows and not (
            motor.driven and abs(motor.demand - (self._wanted or 0.0)) < _NEAR
        )
        unit.strays_since = min(unit.strays_since, now) if strays else math.inf
        # it counts from when it was first sent: before, one request to each other may be in vain
        longest = unit.strays_since + len(self._units) * self._under_way
        since = max(unit.strays_since, min(unit.tried_at, longest))
        if now > since + patience:
            self._break('S5', number, 'is told as following, and does not since',
                        unit.strays_since)
        new = notes.events[self._events[number] :]
        self._events[number] = len(notes.events)
        if any(says(event.text, Cause.SETPOINT_TIMED_OUT) for event in new):
            unit.ramps_from = now
        if any(says(event.text, Cause.SETPOINTS_AGAIN) for event in new) or not self._turns(number):
            unit.ramps_from = math.inf
        if now > unit.ramps_from + patience:
            self._break('S5', number, 'is told as ramping to a stop, and turns since',
                        unit.ramps_from)

    def _break(self, law: str, number: int, what: str, since: float) -> None:
        unit = self._units[number]
        if law in unit.broken:
            return
        unit.broken.add(law)
        now = self._clock.now
        self.broken.append(
            f'{law}: drive {number} {what} {since - self.began:.2f} s, and it is '
            f'{now - self.began:.2f} s'
        )

    def still_turning(self) -> list[int]:
        """Return whose motors the drives turn now."""
        return [number for number in self._units if self._turns(number)]
