# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``make exhaustive``: one run, and at each of its requests in turn each thing that can go wrong.

A campaign finds by luck what is found here by counting. The run is the same each time: connect,
enable, forward, reverse, set-points that cease, stop, a fault and its acknowledgement, quick stop,
release, the end of the driver; the laws of ``test_any_order`` judge it, by all that is on the line
and in the drive. With ``--pairs`` a second thing goes wrong, between an enable and a stop.

What comes before the first thing that goes wrong is the same for all cases: the run goes through
it once, and forks at each request for each thing.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
import gc
import math
import os
from pathlib import Path
import signal
import sys
import tempfile
from typing import Any

_TEST = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(_TEST.parent), str(_TEST), str(_TEST / 'unit' / 'drive' / 'any_order'),
                str(_TEST / 'exhaustive')]

from any_order_machine import AnyOrder  # noqa: E402, the tests are no package
from lines import LINES, LineMachine  # noqa: E402
from machines import EVERY_MACHINE  # noqa: E402
from support.line_runs import HAPPENS, LineRun  # noqa: E402
from support.unexpected_errors import unexpected_errors  # noqa: E402

#: At which request what goes wrong; the first is 0.
Case = tuple[tuple[int, str], ...]
#: What a run is of: a drive, or a line of several.
Machine = type[AnyOrder] | LineMachine
#: The steps that begin with all put right again, connected or not.
_CONNECTS = ('forward', 'forward again', 'fault', 'last run')
#: Of the requests of a step that are the same, as in polls, so many are spoiled.
_OF_EQUAL = 2
#: The steps of a pair: from an enable to a confirmed stop.
_OF_PAIRS = ('forward', 'reverse', 'no set-points', 'stop')
#: No run takes longer, s.
_PATIENCE = 300


def _of_line(state: AnyOrder, attribute: str, number: int) -> None:
    setattr(state.rig.line, attribute, number)


def _for_one(state: AnyOrder, line: str) -> None:
    state.rig.line.state = line


#: What can go wrong at a request, beside what ends a run on a drive of this kind.
FAULTS: Mapping[str, Callable[[AnyOrder], object]] = {
    'request lost': lambda state: _of_line(state, 'unheard', 1),
    'answer lost': lambda state: _of_line(state, 'losses', 1),
    'three answers lost': lambda state: _of_line(state, 'losses', 3),
    'answer twice': lambda state: _of_line(state, 'doubled', 1),
    'answer damaged': lambda state: _for_one(state, 'noise'),
    'answer late': lambda state: _for_one(state, 'late'),
    'line silent': lambda state: state.break_line('silent', wait=0.0),
    'port gone': lambda state: state.break_line('gone', wait=0.0),
    'no answer for 0.3 s': lambda state: state.hold_silent(0.3, wait=0.0),
    'power cycle': lambda state: state.power_cycle(state.boot_times[0], wait=0.0),
    'long power cycle': lambda state: state.power_cycle(state.boot_times[-1], wait=0.0),
}
#: What the drive answers instead; the last one to what is written.
REFUSALS = ('refused', 'busy', 'carried out, refused')


def faults_of(machine: Machine) -> Iterator[str]:
    """Yield the names of all that can go wrong on a drive of one kind, or a line."""
    if isinstance(machine, LineMachine):
        yield from HAPPENS
        return
    yield from FAULTS
    yield from REFUSALS
    yield from (event for event in dict.fromkeys(machine.enders) if event != 'stop_unheard')


class _Instant:
    """No time passes while something happens in the middle of a request; for a machine."""

    inside = False

    def let(self, wait: float) -> None:
        """Let time pass, and judge."""
        if not self.inside:
            super().let(wait)  # type: ignore[misc]  # that of the machine

    def until_noticed(self) -> None:
        """Let what has happened last be noticed."""
        if not self.inside:
            super().until_noticed()  # type: ignore[misc]  # that of the machine


class Run:
    """
    One run with what goes wrong in it.

    :param wrong: called with each request, as the step of the run, the parameter, and whether it is
        written; returns what goes wrong with it, ``''`` if nothing.
    """

    def __init__(self, machine: type[AnyOrder], wrong: Callable[[str, str, bool], str]) -> None:
        self._state: Any = type(machine.__name__, (_Instant, machine), {})()
        self._wrong = wrong
        self._step = ''

    def run(self) -> None:
        """Go through it (AssertionError: a law is broken)."""
        state = self._state
        state.begin_for_each_event()
        meet = state.rig.meet
        state.rig.meet = lambda key, data: self._meet(meet, key, data)
        try:
            self._go()
        except BaseException:
            # what its end would complain of comes from that
            state.rig.kill()
            raise
        state.teardown()

    def _go(self) -> None:
        state = self._state
        for self._step, go in {
            'forward': lambda: state.run_motor(20.0, wait=0.4),
            'reverse': lambda: state.send(-20.0, wait=1.0),
            'no set-points': lambda: state.send(None, wait=1.6),
            'stop': lambda: state.stop(wait=0.4),
            'fault': lambda: state.end_run('first_fault', after=0.4, wait=0.4),
            'acknowledge': lambda: state.acknowledge(wait=0.4),
            'forward again': lambda: state.run_motor(20.0, wait=0.4),
            'quick stop': lambda: state.quick_stop(wait=1.0),
            'release': lambda: state.clean_up(wait=0.2),
            'last run': lambda: state.run_motor(20.0, wait=0.4),
            'end': lambda: state.shut_down(wait=1.0),
        }.items():
            if state.laws.watched or self._step in _CONNECTS:
                go()

    def _meet(
        self, meet: Callable[[str, bytes | None], str | None], key: str, data: bytes | None
    ) -> str | None:
        status = self._state.rig.drive.params.model.key_of_status
        # one setting or measured value is read in the background like another
        matters = key == status or key.startswith(('fieldbus.', 'telegram.')) or data is not None
        wrong = self._wrong(self._step, key if matters else 'a value', data is not None)
        usual = meet(key, data)
        if self._state.rig.line.state in ('noise', 'late'):
            # for one answer
            self._state.rig.line.mend()
        if not wrong or (wrong in REFUSALS and key in getattr(self._state, 'not_refused', ())):
            return usual
        self._state.laws.spoiled()
        if wrong in REFUSALS:
            self._state.laws.disturbed()
            return wrong
        self._state.inside = True
        try:
            happen = FAULTS.get(wrong)
            if happen is not None:
                happen(self._state)
            else:
                getattr(self._state, wrong)(wait=0.0)
        finally:
            self._state.inside = False
        return usual


def run_of(machine: Machine, wrong: Callable[[str, str, bool], str]) -> Run | LineRun:
    """Return a run on a drive of one kind, or a line; ``wrong`` is that of :class:`Run`."""
    return machine.begin(wrong) if isinstance(machine, LineMachine) else Run(machine, wrong)


def complaint_of(run: Run | LineRun) -> str:
    """Return what is wrong with a run, ``''`` if nothing."""
    with unexpected_errors() as found:
        try:
            run.run()
        except Exception as error:
            # a mistake in the driver or in a law must not end the others
            return f'{type(error).__name__}: {error}'.splitlines()[0]
    return found[0].splitlines()[-1] if found else ''


class Given:
    """One case."""

    def __init__(self, case: Case) -> None:
        self._due, self._asked = dict(case), -1

    def __call__(self, step: str, key: str, writes: bool) -> str:
        self._asked += 1
        return self._due.get(self._asked, '')


class Tree:
    """
    All cases of one kind of drive: each forks where its first thing goes wrong.

    :param faults: what may go wrong, as :func:`faults_of` has it.
    :param parts: for the first thing, and for the second if there is one: (n, k) tries each nth of
        what may go wrong, from the kth on.
    :param jobs: how many processes at a time.
    :param done: a file to which each process adds a byte.
    """

    def __init__(
        self,
        machine: Machine,
        faults: Iterable[str],
        parts: Sequence[tuple[int, int]],
        jobs: int,
        done: int,
    ) -> None:
        self._machine, self._jobs, self._done = machine, jobs, done
        self._parts, self._pairs = parts, len(parts) > 1
        self._faults = tuple(faults)
        self._faults_of_reads = tuple(fault for fault in self._faults if fault != REFUSALS[-1])
        self._asked, self._number = -1, 0
        self._met = Counter[tuple[str, str, bool]]()
        self._case: Case = ()
        self._running: dict[int, Case] = {}

    def run(self) -> None:
        """Try all."""
        gc.freeze()
        complaint = complaint_of(run_of(self._machine, self))
        while self._running:
            self._wait()
        self._report(self._case, complaint)
        if self._case:
            os._exit(0)

    def __call__(self, step: str, key: str, writes: bool) -> str:
        self._asked += 1
        self._met[step, key, writes] += 1
        if self._met[step, key, writes] > _OF_EQUAL or (self._pairs and step not in _OF_PAIRS):
            return ''
        if len(self._case) < len(self._parts):
            for fault in self._faults if writes else self._faults_of_reads:
                if self._goes_wrong(fault):
                    return fault
        return ''

    def _goes_wrong(self, fault: str) -> bool:
        """Return whether it does in this process, which is the one to go through that case."""
        self._number += 1
        every, first = self._parts[len(self._case)]
        if self._number % every != first:
            return False
        while len(self._running) >= self._jobs:
            self._wait()
        case = (*self._case, (self._asked, fault))
        process = os.fork()
        if process:
            self._running[process] = case
            return False
        self._case, self._jobs, self._number = case, 1, 0
        self._running.clear()
        if len(case) == len(self._parts):
            signal.alarm(_PATIENCE)
        return True

    def _wait(self) -> None:
        process, status = os.wait()
        case = self._running.pop(process)
        if status:
            self._report(case, f'no end after {_PATIENCE} s, or killed: status {status}')

    def _report(self, case: Case, complaint: str) -> None:
        os.write(self._done, b'x' if complaint else b'.')
        if complaint:
            again = ' '.join(f"--case '{at}:{fault}'" for at, fault in case)
            line = f'--machine {self._machine.__name__} {again}\n    {complaint}\n'
            os.write(sys.stdout.fileno(), line.encode())


def main() -> int:
    """Try all cases of this part; return 1 where one breaks a law."""
    parser = argparse.ArgumentParser(description=__doc__)
    every: tuple[Machine, ...] = (*EVERY_MACHINE, *LINES)
    machines = {machine.__name__: machine for machine in every}
    parser.add_argument('--machine', action='append', choices=machines, help='default: all')
    parser.add_argument('--part', default='1/1', metavar='I/N', help='every Nth case only')
    parser.add_argument('--fault', action='append', metavar='FAULT', help='this one alone')
    parser.add_argument('--pairs', action='store_true', help='two things go wrong')
    parser.add_argument('--case', action='append', metavar='AT:FAULT', help='this one alone')
    parser.add_argument('--jobs', type=int, default=os.cpu_count(), metavar='N')
    options = parser.parse_args()
    failures = 0
    for name in options.machine or machines:
        if options.pairs and isinstance(machines[name], LineMachine):
            # a call is the second thing there
            continue
        if options.case:
            split = (pair.partition(':') for pair in options.case)
            case = tuple((int(at), fault) for at, _, fault in split)
            complaint = complaint_of(run_of(machines[name], Given(case)))
            print(f'{name}: {complaint or "nothing is wrong"}')
            failures += bool(complaint)
        else:
            failures += _try_all(machines[name], options)
    return 1 if failures else 0


def _parts_of(options: argparse.Namespace) -> list[tuple[int, int]]:
    part, parts = map(int, options.part.split('/'))
    if not options.pairs:
        return [(parts, part % parts)]
    # an even choice of both things, and all parts together are all pairs
    side = math.isqrt(parts)
    if side * side != parts:
        raise SystemExit(f'pairs are tried in 1, 4, 9, 100, 400 parts and so on, not in {parts}')
    return [(side, part // side % side), (side, part % side)]


def _try_all(machine: Machine, options: argparse.Namespace) -> int:
    with tempfile.TemporaryFile() as done:
        faults = [fault for fault in faults_of(machine) if fault in (options.fault or [fault])]
        Tree(machine, faults, _parts_of(options), options.jobs, done.fileno()).run()
        done.seek(0)
        ends = done.read()
    failures = ends.count(b'x')
    print(f'{machine.__name__}: {len(ends)} cases, {failures} break a law', flush=True)
    return failures


if __name__ == '__main__':
    sys.exit(main())
