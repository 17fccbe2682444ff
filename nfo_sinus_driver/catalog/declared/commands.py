# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The commands of a description: lists of steps, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from nfo_sinus_driver.catalog.declared.description import (
    Assign,
    Await,
    Change,
    Direction,
    Pause,
    Put,
    StatusPlace,
    Step,
    Steps,
)
from nfo_sinus_driver.catalog.declared.places import WORD, PlacedCondition, Places
from nfo_sinus_driver.catalog.declared.settings import Settings
from nfo_sinus_driver.catalog.declared.yaml_file import Node, Problems

#: All of them, in the order in which a drive is used.
NAMES = ('prepare', 'run', 'stop', 'coast', 'quick_stop', 'reset', 'release')
#: Those that wait for nothing: no stop is delayed.
_AT_ONCE = ('stop', 'coast', 'quick_stop', 'release')
#: How long a stop may pause between two of its steps in all, s.
_LONGEST_PAUSE = 0.5
#: Longer than a start may take no other pauses, s.
_LONGEST = 3.0
#: How long it is waited for a condition where nothing is said, s.
_WITHIN = 1.0
#: What each kind of step has beside where it goes.
_KINDS = ('value', 'values', 'set', 'clear', 'on', 'to', 'wait', 'until')


class StepReader:
    """Reads steps; :meth:`use` says where the status stands, for those that wait for it."""

    def __init__(
        self, root: Node, places: Places, settings: Settings, problems: Problems
    ) -> None:
        self._root = root
        self._places = places
        self._settings = settings
        self._problems = problems
        self._awaited: dict[int, PlacedCondition] = {}
        self._status = StatusPlace((0,))

    def awaited(self) -> Iterator[PlacedCondition]:
        """Yield the conditions that steps wait for."""
        for name in NAMES:
            for node in self._root['control'].get(name).items:
                if 'until' in node:
                    condition = self._places.condition(node['until'], f'until of {name}')
                    if condition is not None:
                        self._awaited[id(node)] = condition
                        yield condition

    def use(self, status: StatusPlace) -> None:
        """Take where the status stands."""
        self._status = status

    def read(self, node: Node, name: str) -> Steps:
        """Return the steps of a list."""
        found = [self._step(one, name) for one in node.items]
        return tuple(step for step in found if step is not None)

    def _step(self, node: Node, name: str) -> Step | None:
        kinds = [kind for kind in _KINDS if kind in node]
        if kinds in (['set'], ['clear'], ['set', 'clear']):
            return self._change(node, name)
        if len(kinds) != 1:
            self._problems.add(
                node.line,
                f'a step of {name} does one thing: value, values, set and clear, on, to, wait or '
                'until',
            )
            return None
        make = {
            'value': self._put, 'values': self._put_several, 'on': self._switch,
            'to': self._assign, 'wait': self._pause, 'until': self._await,
        }
        return make[kinds[0]](node, name)

    def _place(self, node: Node, name: str) -> Node | None:
        if 'register' in node and 'coil' not in node and 'parameter' not in node:
            return node['register']
        self._problems.add(node.line, f'a step of {name} needs a register to write to')
        return None

    def _put(self, node: Node, name: str) -> Step | None:
        place = self._place(node, name)
        if place is None:
            return None
        return Put(self._places.word(self._places.register(place)), self._word(node['value']))

    def _put_several(self, node: Node, name: str) -> Step | None:
        place = self._place(node, name)
        if place is None:
            return None
        words = [self._word(one) for one in node['values'].items]
        if len(words) > 1 and 16 not in self._places.functions:
            self._problems.add(
                node.line, f'{name} writes several registers, and the line has no function 16'
            )
        if len(words) > self._places.most_registers:
            self._problems.add(node.line, f'{name} writes more than most_registers in a message')
        register = self._places.register(place)
        if register + len(words) > WORD + 1:
            self._problems.add(node.line, f'{name} writes beyond the last register')
            return None
        raw = 0
        for word in words:
            raw = raw << 16 | word
        return Put(self._places.word(register, len(words)), raw)

    def _change(self, node: Node, name: str) -> Step | None:
        place = self._place(node, name)
        if place is None:
            return None
        bits, cleared = node.integer('set') & WORD, node.integer('clear') & WORD
        if bits & cleared or not bits | cleared:
            self._problems.add(node.line, f'{name} sets and clears the same bits, or none')
        return Change(self._places.word(self._places.register(place)), bits, cleared)

    def _switch(self, node: Node, name: str) -> Step | None:
        if 'coil' not in node or 'register' in node:
            self._problems.add(node.line, f'a step of {name} needs the coil that is on or off')
            return None
        return Put(self._places.coil_key(self._places.coil(node['coil'])), int(node.flag('on')))

    def _assign(self, node: Node, name: str) -> Step | None:
        key = self._settings.known(node.get('parameter'))
        if not key:
            if 'parameter' not in node:
                self._problems.add(node.line, f'a step of {name} needs the parameter to write')
            return None
        value = self._settings.value(key, node['to'])
        return None if value is None else Assign(key, value)

    def _pause(self, node: Node, name: str) -> Step:
        return Pause(float(node.number('wait') or 0))

    def _await(self, node: Node, name: str) -> Step | None:
        if name in (*_AT_ONCE, 'after_write'):
            self._problems.add(node.line, f'{name} waits for nothing: a stop is never delayed')
            return None
        condition = self._awaited.get(id(node))
        within = node.number('within')
        seconds = _WITHIN if within is None else float(within)
        return Await(condition.in_place(self._status), seconds) if condition is not None else None

    def _word(self, node: Node) -> int:
        raw = node.scalar if isinstance(node.scalar, int) else 0
        if not -0x8000 <= raw <= WORD:
            self._problems.add(node.line, f'{raw} is no word of one register')
        return raw & WORD


class Commands:
    """The commands of one file, checked beside each other."""

    def __init__(
        self, control: Node, reader: StepReader, direction: Direction | None, problems: Problems
    ) -> None:
        self._control = control
        self._problems = problems
        self._direction = direction
        self._lists = {name: reader.read(control.get(name), name) for name in NAMES}
        for name in NAMES:
            self._check_pauses(name)
        for name in ('stop', 'coast', 'quick_stop'):
            if name in control:
                self._check_stop(name)
        for name in ('prepare', 'reset', 'release'):
            self._check_runs_nothing(name)
        self._check_direction()

    def lists(self) -> dict[str, Any]:
        """Return them by name, and whether no run command stands behind prepare."""
        run, left = left_by(self._lists['run']), left_by(self._lists['prepare'])
        stops = bool(run) and all(key in left and takes_back(run[key], left[key]) for key in run)
        return {**self._lists, 'prepare_stops': stops}

    def _check_pauses(self, name: str) -> None:
        pauses = [step.seconds for step in self._lists[name] if isinstance(step, Pause)]
        most = _LONGEST_PAUSE if name in _AT_ONCE else _LONGEST
        if sum(pauses) > most:
            self._problems.add(
                self._control[name].line, f'{name} pauses for more than {most:g} s in all'
            )
        if name in _AT_ONCE and self._lists[name] and isinstance(self._lists[name][0], Pause):
            self._problems.add(
                self._control[name].line, f'{name} begins with a pause: a stop is never delayed'
            )

    def _check_runs_nothing(self, name: str) -> None:
        """See to it that what is no run command leaves none."""
        run, left = left_by(self._lists['run']), left_by(self._lists[name])
        for key, (value, known) in run.items():
            if value and key in left and not known & ~left[key][1] and not takes_back(
                run[key], left[key]
            ):
                self._problems.add(
                    self._control[name].line, f'{name} leaves the run command: the motor would turn'
                )

    def _check_direction(self) -> None:
        """See to it that run leaves the direction that it is said to: forward."""
        if self._direction is None:
            return
        value, _ = left_by(self._lists['run']).get(self._direction.key, (None, 0))
        if value not in (None, self._direction.forward):
            self._problems.add(
                self._control['run'].line,
                f'run leaves {value:X}h where the direction has forward: '
                f'{self._direction.forward:X}h; it has to run forward',
            )

    def _check_stop(self, name: str) -> None:
        """See to it that a stop takes back what run has left."""
        line = self._control[name].line
        run = left_by(self._lists['run'])
        stop = left_by(self._lists[name])
        if self._direction is not None:
            run.setdefault(self._direction.key, (self._direction.forward, WORD))
        if not run or not stop:
            what = 'run' if not run else name
            self._problems.add(line, f'{what} writes nothing: add a step with a value')
            return
        if all(value == 0 for value, _ in run.values()):
            # edges, which the drive keeps
            return
        runs = [run]
        if self._direction is not None:
            runs.append({**run, self._direction.key: (self._direction.reverse, WORD)})
        if not all(
            any(takes_back(left[key], stop[key]) for key in left if key in stop) for left in runs
        ):
            self._problems.add(
                line,
                f'{name} leaves the run command standing, so that the motor may start again by '
                'itself: have it clear what run has written there, too (such as clear, with '
                'the bits that run sets)',
            )


def left_by(steps: Sequence[Step]) -> dict[str, tuple[int, int]]:
    """Return what steps leave in registers and coils, by key: the bits, and which are known."""
    left: dict[str, tuple[int, int]] = {}
    for step in steps:
        if isinstance(step, Put):
            left[step.key] = (step.raw, -1)
        elif isinstance(step, Change):
            value, known = left.get(step.key, (0, 0))
            value = (value | step.set) & ~step.clear
            left[step.key] = (value, known | step.set | step.clear)
        elif isinstance(step, Assign):
            left[step.key] = (hash(step.value), -1)
    return left


def takes_back(run: tuple[int, int], stop: tuple[int, int]) -> bool:
    """
    Return whether what a stop leaves differs from what run does.

    A whole word may be a number. Where a stop only sets and clears bits, it has to clear one that
    run has set: with another one set the motor stands, and starts again when that one is cleared.
    """
    changed = (run[0] ^ stop[0]) & run[1] & stop[1]
    return (changed if stop[1] == -1 else changed & (run[0] or -1)) != 0
