# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``make exhaustive``: one run, and at each of its requests in turn each thing that can go wrong.

A campaign finds by luck what is found here by counting. The run is the same each time: connect,
enable, forward, reverse, set-points that cease, stop, a fault and its acknowledgement, quick stop,
release, the end of the driver; the laws of ``test_any_order`` judge it, by all that is on the line
and in the drive. With ``--pairs`` a second thing goes wrong later in it.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
import functools
import os
from pathlib import Path
import sys
from typing import Any

_TEST = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(_TEST.parent), str(_TEST), str(_TEST / 'unit' / 'drive')]

from any_order_machine import AnyOrder  # noqa: E402, the tests are no package
from any_order_machines import MACHINES  # noqa: E402

#: At which request what goes wrong; the first is 0.
Case = tuple[tuple[int, str], ...]
#: The steps that begin with all put right again, connected or not.
_CONNECTS = ('forward', 'forward again', 'fault', 'last run')
#: Of the requests of a step that are the same, as in polls, so many are spoiled.
_OF_EQUAL = 2


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
#: What the drive answers instead.
REFUSALS = ('refused', 'busy')


def faults_of(machine: type[AnyOrder]) -> Iterator[str]:
    """Yield the names of all that can go wrong on a drive of one kind."""
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

    :ivar asked: each request, as the step of the run, the parameter, and whether it is written.
    """

    def __init__(self, machine: type[AnyOrder], case: Case) -> None:
        self._state: Any = type(machine.__name__, (_Instant, machine), {})()
        self._due = dict(case)
        self._step = ''
        self.asked: list[tuple[str, str, bool]] = []

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
        wrong = self._due.get(len(self.asked))
        status = self._state.rig.far.memory.model.key_of_status
        # one setting or measured value is read in the background like another
        matters = key == status or key.startswith('fieldbus.') or data is not None
        self.asked.append((self._step, key if matters else 'a value', data is not None))
        usual = meet(key, data)
        if self._state.rig.line.state in ('noise', 'late'):
            # for one answer
            self._state.rig.line.mend()
        if wrong is None:
            return usual
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


def try_case(name: str, case: Case) -> str:
    """Return what was wrong with a run, ``''`` if nothing."""
    try:
        Run(_machine(name), case).run()
    except Exception as error:
        # a mistake in the driver or in a law must not end the others
        return f'{type(error).__name__}: {error}'.splitlines()[0]
    return ''


def moments_of(name: str) -> list[int]:
    """Return the requests of a run that differ: of equal ones in a step the first few."""
    whole = Run(_machine(name), ())
    whole.run()
    met = Counter[tuple[str, str, bool]]()
    moments = []
    for at, request in enumerate(whole.asked):
        met[request] += 1
        if met[request] <= _OF_EQUAL:
            moments.append(at)
    return moments


def _machine(name: str) -> type[AnyOrder]:
    return next(machine for machine in MACHINES if machine.__name__ == name)


def cases_of(name: str, pairs: bool) -> Iterator[Case]:
    """Yield all cases of one kind of drive, in order."""
    moments, faults = moments_of(name), tuple(faults_of(_machine(name)))
    for number, at in enumerate(moments):
        for fault in faults:
            if not pairs:
                yield ((at, fault),)
            for then in moments[number + 1:] if pairs else ():
                yield from (((at, fault), (then, second)) for second in faults)


def main() -> int:
    """Try all cases of this part; return 1 where one breaks a law."""
    parser = argparse.ArgumentParser(description=__doc__)
    names = [machine.__name__ for machine in MACHINES]
    parser.add_argument('--machine', action='append', choices=names, help='default: all')
    parser.add_argument('--part', default='1/1', metavar='I/N', help='every Nth case only')
    parser.add_argument('--pairs', action='store_true', help='two things go wrong')
    parser.add_argument('--case', action='append', metavar='AT:FAULT', help='this one alone')
    parser.add_argument('--jobs', type=int, default=os.cpu_count(), metavar='N')
    options = parser.parse_args()
    failures = 0
    for name in options.machine or names:
        failures += _try_all(name, options)
    return 1 if failures else 0


def _try_all(name: str, options: argparse.Namespace) -> int:
    if options.case:
        split = (one.partition(':') for one in options.case)
        cases = [tuple((int(at), fault) for at, _, fault in split)]
    else:
        part, parts = map(int, options.part.split('/'))
        cases = [case for at, case in enumerate(cases_of(name, options.pairs))
                 if at % parts == part % parts]
    failures = 0
    with ProcessPoolExecutor(options.jobs) as executor:
        tried = executor.map(functools.partial(try_case, name), cases, chunksize=8)
        for case, complaint in zip(cases, tried, strict=True):
            if complaint:
                failures += 1
                again = ' '.join(f"--case '{at}:{fault}'" for at, fault in case)
                print(f'--machine {name} {again}\n    {complaint}', flush=True)
    print(f'{name}: {len(cases)} cases, {failures} break a law', flush=True)
    return failures


if __name__ == '__main__':
    sys.exit(main())
