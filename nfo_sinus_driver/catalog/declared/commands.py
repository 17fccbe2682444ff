# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The commands of a description: lists of steps, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, TypeGuard

from nfo_sinus_driver.catalog.declared.description import (
    Await,
    Direction,
    SetBits,
    StatusPlace,
    Step,
    Steps,
)
from nfo_sinus_driver.catalog.declared.register_map import WORD, PlacedCondition, RegisterMap
from nfo_sinus_driver.catalog.declared.registers import PULSES, Place, place_of
from nfo_sinus_driver.catalog.declared.settings import Settings
from nfo_sinus_driver.catalog.declared.yaml_file import Node, Problems
from nfo_sinus_driver.catalog.parameter import Parameter
from nfo_sinus_driver.catalog.profile import Wait, Write

#: All of them, in the order in which a drive is used.
NAMES = ('prepare', 'run', 'stop', 'coast', 'quick_stop', 'reset', 'release')
#: Without a run command, what a file may have of them.
_WITHOUT_RUN = ('reset',)
#: Those that wait for nothing: no stop is delayed.
_AT_ONCE = ('stop', 'coast', 'quick_stop', 'release')
#: Those that stop the motor.
_STOPS = ('stop', 'coast', 'quick_stop')
#: How long a stop may pause between two of its steps in all, s.
_LONGEST_PAUSE = 0.5
#: Longer than a start may take no other pauses, s.
_LONGEST = 3.0
#: How long it is waited for a condition where nothing is said, s.
_WITHIN = 1.0
#: What runs the motor where there is no run command.
_RUN_BY = 'setpoint or terminals'
#: What each kind of step has.
_KINDS = {
    'value': {'register', 'value'}, 'values': {'register', 'values'},
    'set': {'register', 'set', 'clear'}, 'clear': {'register', 'set', 'clear'},
    'on': {'coil', 'on'}, 'pulse': {'pulse'}, 'to': {'parameter', 'to'}, 'wait': {'wait'},
    'until': {'until', 'within'},
}


class StepReader:
    """Reads steps; :meth:`use` says where the status stands, for those that wait for it."""

    def __init__(
        self, root: Node, register_map: RegisterMap, settings: Settings, problems: Problems
    ) -> None:
        self._root = root
        self._map = register_map
        self._settings = settings
        self._problems = problems
        self._awaited: dict[int, PlacedCondition] = {}
        self._status = StatusPlace((0,))

    def awaited(self) -> Iterator[PlacedCondition]:
        """Yield the conditions that steps wait for."""
        for name in NAMES:
            for node in self._root['control'].get(name).items:
                if 'until' in node:
                    condition = self._map.condition(node['until'], f'until of {name}')
                    if condition is not None:
                        self._awaited[id(node)] = condition
                        yield condition

    def use(self, status: StatusPlace) -> None:
        """Take where the status stands."""
        self._status = status

    def read(self, node: Node, name: str) -> Steps:
        """Return the steps of a list."""
        found = [self._step(item, name) for item in node.items]
        return tuple(step for step in found if step is not None)

    def _step(self, node: Node, name: str) -> Step | None:
        kinds = [kind for kind in _KINDS if kind in node]
        if 'coil' in node and 'value' in node:
            self._problems.add(
                node.line, f'a step of {name} writes a value to a coil: say on: true or on: false'
            )
            return None
        if not kinds or not set(node.mapping) <= _KINDS[kinds[0]]:
            self._problems.add(
                node.line,
                f'a step of {name} does one thing: value, values, set and clear, on, pulse, to, '
                'wait or until',
            )
            return None
        make = {
            'value': self._put, 'values': self._put_several, 'set': self._change,
            'clear': self._change, 'on': self._switch, 'pulse': self._pulse, 'to': self._assign,
            'wait': self._pause, 'until': self._await,
        }
        return make[kinds[0]](node, name)

    def _place(self, node: Node, name: str) -> Node | None:
        if 'register' in node:
            return node['register']
        self._problems.add(node.line, f'a step of {name} needs a register to write to')
        return None

    def _put(self, node: Node, name: str) -> Step | None:
        place = self._place(node, name)
        if place is None:
            return None
        word = node.integer('value') & WORD
        return Write(self._map.word(name, place, word), word)

    def _put_several(self, node: Node, name: str) -> Step | None:
        place = self._place(node, name)
        if place is None:
            return None
        words = [int(item.scalar or 0) & WORD for item in node['values'].items]
        if len(words) > 1 and 16 not in self._map.functions:
            self._problems.add(
                node.line, f'{name} writes several registers, and the line has no function 16'
            )
        if len(words) > self._map.most_registers:
            self._problems.add(node.line, f'{name} writes more than most_registers in a message')
        if self._map.register(place) + len(words) > WORD + 1:
            self._problems.add(node.line, f'{name} writes beyond the last register')
            return None
        raw = 0
        for word in words:
            raw = raw << 16 | word
        return Write(self._map.word(name, place, *words), raw)

    def _change(self, node: Node, name: str) -> Step | None:
        place = self._place(node, name)
        if place is None:
            return None
        bits, cleared = node.integer('set') & WORD, node.integer('clear') & WORD
        if bits & cleared or not bits | cleared:
            self._problems.add(node.line, f'{name} sets and clears the same bits, or none')
        return SetBits(self._map.word(name, place, bits | cleared), bits, cleared)

    def _switch(self, node: Node, name: str) -> Step | None:
        if 'coil' not in node:
            self._problems.add(node.line, f'a step of {name} needs the coil that is on or off')
            return None
        return Write(self._map.coil_key(name, node['coil']), int(node.flag('on')))

    def _pulse(self, node: Node, name: str) -> Step:
        return self._map.pulse(name, node['pulse'])

    def _assign(self, node: Node, name: str) -> Step | None:
        key = self._settings.known(node.get('parameter'))
        if not key:
            if 'parameter' not in node:
                self._problems.add(node.line, f'a step of {name} needs the parameter to write')
            return None
        value = self._settings.value(key, node['to'])
        return None if value is None else Write(key, value)

    def _pause(self, node: Node, name: str) -> Step:
        return Wait(float(node.number('wait') or 0))

    def _await(self, node: Node, name: str) -> Step | None:
        if name in (*_AT_ONCE, 'after_write'):
            why = 'it does not wait for a status' if name == 'after_write' else (
                'a stop is never delayed'
            )
            self._problems.add(node.line, f'{name} cannot have until: {why}')
            return None
        condition = self._awaited.get(id(node))
        within = node.number('within')
        seconds = _WITHIN if within is None else float(within)
        return Await(condition.in_place(self._status), seconds) if condition is not None else None


#: What is written as it is sent; or a parameter.
_Place = Place | str


class _RunWord(NamedTuple):
    """
    A word by which run, or the direction, runs the motor; a coil has one bit.

    :ivar bits: those of it that a stop clears; 0: words are numbers here, or known in part.
    """

    word: int
    bits: int


class CommandLists:
    """
    The commands of one file, checked beside each other.

    :param made: the parameters that write their registers and coils, by key.
    """

    def __init__(
        self,
        control: Node,
        reader: StepReader,
        direction: Direction | None,
        made: Mapping[str, Parameter],
        problems: Problems,
    ) -> None:
        self._control = control
        self._made = made
        self._problems = problems
        self._direction = direction
        self._lists = {name: reader.read(control.get(name), name) for name in NAMES}
        self._run = self._left_by('run')
        for name in NAMES:
            self.check_pauses(name, self._lists[name], control.get(name).line)
        if self._control.text('run_by'):
            self._require_no_command()
            return
        for name in ('run', 'stop'):
            if name not in control:
                problems.add(control.line, f'control needs {name!r}, or run_by: {_RUN_BY}')
        for name in _STOPS:
            if name in control:
                self._check_stop(name)
        for name in NAMES:
            if name != 'run':
                self.require_no_run(name, self._lists[name], control.get(name).line)
        self._check_settings()
        self._check_direction()

    def lists(self) -> dict[str, Any]:
        """Return them by name, and whether no run command stands behind prepare."""
        run, left = self._run, self._left_by('prepare')
        stops = bool(run) and all(
            place in left and self._ends(place, run[place], left[place]) for place in run
        )
        return {**self._lists, 'prepare_stops': stops}

    def _ends(self, place: _Place, run: tuple[int, int], left: tuple[int, int]) -> bool:
        """Return whether a word ends the run: where each is a command by itself, the stop alone."""
        if place == PULSES or (self._is_alone and place == self._direction_place):
            return left == self._left_by('stop').get(place)
        return takes_back(run, left)

    def require_no_run(self, name: str, steps: Steps, line: int) -> None:
        """
        Ensure that no step of what is no run command gives one, not for a moment.

        Those of a stop may have the bits of run, for another one stops the motor meanwhile.
        """
        for place, word, known in self._states(steps):
            for run in self._run_words(place):
                bits = 0 if name in _STOPS else run.bits
                by_bits = bits and word & known & bits == bits
                if by_bits or (known == -1 and word == run.word):
                    what = f'the bits {run.bits:X}h' if by_bits else f'{word:X}h'
                    self._problems.add(
                        line,
                        f'{name} gives the run command: it writes {what} where run does (line '
                        f'{self._control["run"].line}), and the motor would turn',
                    )

    def _require_no_command(self) -> None:
        """Ensure that the set-point alone runs and stops the motor."""
        control = self._control
        for name in NAMES:
            if name in control and name not in _WITHOUT_RUN:
                self._problems.add(
                    control[name].line,
                    f'{name} cannot stand beside run_by: there is no run command, and set-point 0 '
                    'is the stop: remove one of both',
                )
        for required in control.get('requires').items:
            if required.flag('write'):
                self._problems.add(
                    required.line,
                    'write: true cannot stand beside run_by: the motor would follow a set-point '
                    'that is left in the drive; say with text how it is set',
                )
        if 'stop_mode' in control:
            self._problems.add(
                control['stop_mode'].line,
                'stop_mode cannot stand beside run_by: it says how a stop ends a run command, and '
                'set-point 0 is the stop: remove it',
            )
        if self._direction is not None:
            self._problems.add(
                control['run_by'].line,
                'run_by goes with a set-point alone: remove direction, and have the sign give it '
                '(signed: true), if the drive has one',
            )

    def _is_setting(self, step: Step) -> TypeGuard[Write]:
        """Return whether a step writes to a parameter of the table."""
        return isinstance(step, Write) and step.key not in self._made

    def _words(self, step: Step) -> Iterator[tuple[_Place, int, int]]:
        """Yield what a step writes: where, the word, and which bits of it are known then."""
        if self._is_setting(step):
            yield step.key, hash(step.value), -1
        elif isinstance(step, (Write, SetBits)):
            address = self._made[step.key].at('modbus')
            kind, first = place_of(address)
            if isinstance(step, SetBits):
                yield (kind, first), step.set, step.set | step.clear
                return
            count = max(address.codec.size // 2, 1)
            for number in range(count):
                word = int(step.value) >> 16 * (count - 1 - number) & WORD
                yield (kind, first + number), word, -1

    def _states(self, steps: Steps) -> Iterator[tuple[_Place, int, int]]:
        """Yield what stands after each word of some steps: where, the bits, and which are known."""
        left: dict[_Place, tuple[int, int]] = {}
        for step in steps:
            for place, word, known in self._words(step):
                before, sure = left.get(place, (0, 0))
                left[place] = before & ~known | word, sure | known
                yield place, *left[place]

    def _left_by(self, name: str) -> dict[_Place, tuple[int, int]]:
        """Return what a command leaves in registers and coils: the bits, and which are known."""
        return {place: (word, known) for place, word, known in self._states(self._lists[name])}

    @property
    def _runs_by(self) -> Direction | None:
        """The direction whose words run the motor, too."""
        return None if self._is_alone else self._direction

    @property
    def _is_alone(self) -> bool:
        """The direction is a word of its own, which neither runs nor stops the motor."""
        return self._direction is not None and self._direction.alone

    @property
    def _direction_place(self) -> _Place | None:
        if self._direction is None:
            return None
        return place_of(self._made[self._direction.key].at('modbus'))

    def _run_words(self, place: _Place) -> Iterator[_RunWord]:
        """Yield the words that run the motor there."""
        stop, left, direction = self._left_by('stop').get(place), self._run.get(place), None
        if self._runs_by is not None and place == self._direction_place:
            direction = self._runs_by
            left = left or (direction.forward, -1)
        if left is None or isinstance(place, str):
            return
        if stop is None or not takes_back(left, stop):
            # the last word of an edge is 0
            steps = self._lists['run'] if left[0] == 0 else ()
            written = (written_word for step in steps for written_word in self._words(step))
            yield from (_RunWord(word, 0) for at, word, _ in written if at == place and word)
            return
        words = [left]
        if direction is not None:
            words += [(direction.forward, -1), (direction.reverse, -1)]
        for word, known in words:
            sure = known & stop[1]
            # where a stop sets bits that a run does not have, words are numbers
            numbers = stop[0] & ~word & sure or place == PULSES
            yield _RunWord(word, 0 if numbers else word & ~stop[0] & sure)

    def _check_settings(self) -> None:
        """Ensure that no setting is the run command."""
        run, stop = (
            {step.key for step in self._lists[name] if self._is_setting(step)}
            for name in ('run', 'stop')
        )
        for key in sorted(run & stop):
            self._problems.add(
                self._control['run'].line,
                f'run and stop write {key}, a setting that any client may set, and the motor '
                'would turn: write its register, and leave it out of the parameters',
            )

    def check_pauses(self, name: str, steps: Steps, line: int) -> None:
        """Make sure that a list does not pause for too long."""
        pauses = [step.seconds for step in steps if isinstance(step, Wait)]
        most = _LONGEST_PAUSE if name in _AT_ONCE else _LONGEST
        if sum(pauses) > most:
            self._problems.add(line, f'{name} pauses for more than {most:g} s in all')
        if name in _AT_ONCE and steps and isinstance(steps[0], Wait):
            self._problems.add(line, f'{name} begins with a pause: a stop is never delayed')

    def _check_direction(self) -> None:
        """Ensure that run leaves the direction that it is said to: forward."""
        if self._direction is None or self._direction_place is None:
            return
        value, _ = self._run.get(self._direction_place, (None, 0))
        if self._direction.alone:
            if value in (None, self._direction.forward, self._direction.reverse):
                self._problems.add(
                    self._control['run'].line,
                    'alone says that run writes another word to the register of the direction, '
                    'and it writes none: remove alone, or the direction from run',
                )
            self._check_alone(self._direction, self._direction_place)
        elif value not in (None, self._direction.forward):
            self._problems.add(
                self._control['run'].line,
                f'run leaves {value:X}h where the direction has forward: '
                f'{self._direction.forward:X}h; it has to run forward',
            )

    def _check_alone(self, direction: Direction, place: _Place) -> None:
        """Ensure that a direction of its own is no command, and does not end one."""
        run, stop = self._run.get(place, (0, 0)), self._left_by('stop').get(place, (WORD, 0))
        if run[0] and not stop[0] & ~run[0]:
            self._problems.add(
                self._control['stop'].line,
                'stop has no bit of its own, so that a direction that is alone, which clears the '
                'bits of run as stop does, would stop the motor: add the run bits to forward and '
                'reverse, and remove alone',
            )
        for name in NAMES:
            written = [word for step in self._lists[name] for word in self._words(step)]
            for word, known in ((word, known) for at, word, known in written if at == place):
                if known != -1:
                    said = 'sets or clears bits, and a direction that is alone clears all others'
                elif word in (direction.forward, direction.reverse):
                    said = f'writes {word:X}h, and a direction that is alone is no command'
                else:
                    continue
                self._problems.add(
                    self._control[name].line,
                    f'{name} {said}: give it a word of its own, or remove alone',
                )

    def _check_stop(self, name: str) -> None:
        """Ensure that a stop removes what run has left."""
        line = self._control[name].line
        run, stop, place = dict(self._run), self._left_by(name), self._direction_place
        way = self._runs_by
        if way is not None and place is not None:
            run.setdefault(place, (way.forward, WORD))
        if not run or not stop:
            what = 'run' if not run else name
            self._problems.add(line, f'{what} writes nothing: add a step with a value')
            return
        if all(value == 0 for value, _ in run.values()):
            # edges, which the drive keeps
            return
        runs = [run]
        if way is not None and place is not None:
            runs.append({**run, place: (way.reverse, WORD)})
        # a direction by pulses runs whatever stands in a register
        pulsed = way is not None and place == PULSES
        if (pulsed and PULSES not in stop) or not all(
            any(takes_back(left[key], stop[key]) for key in left if key in stop) for left in runs
        ):
            self._problems.add(
                line,
                f'{name} leaves the run command standing, so that the motor may start again by '
                'itself: have it clear what run has written there, too (such as clear, with '
                'the bits that run sets)',
            )


def takes_back(run: tuple[int, int], stop: tuple[int, int]) -> bool:
    """
    Return whether what a stop leaves differs from what run does.

    A whole word may be a number. Where a stop only sets and clears bits, it has to clear one that
    run has set: with another one set the motor stands, and starts again when that one is cleared.
    """
    changed = (run[0] ^ stop[0]) & run[1] & stop[1]
    return (changed if stop[1] == -1 else changed & (run[0] or -1)) != 0
