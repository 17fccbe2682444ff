# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Reads a file into a :class:`Description`; every problem is named with file and line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from nfo_sinus_driver.catalog.declared import schema
from nfo_sinus_driver.catalog.declared.commands import CommandLists, StepReader
from nfo_sinus_driver.catalog.declared.description import (
    Condition,
    Description,
    Direction,
    Fault,
    FaultCodes,
    LineDefaults,
    Requirement,
    SetpointPlace,
    StatusPlace,
    Timeout,
    status_code,
)
from nfo_sinus_driver.catalog.declared.parameter_table import with_parameters
from nfo_sinus_driver.catalog.declared.register_map import (
    FAULT_KEY,
    STATUS_KEY,
    WORD,
    PlacedCondition,
    RegisterMap,
    internal,
    place_of,
)
from nfo_sinus_driver.catalog.declared.registers import Use
from nfo_sinus_driver.catalog.declared.settings import Settings, role_parameters
from nfo_sinus_driver.catalog.declared.simulated import read_simulated
from nfo_sinus_driver.catalog.declared.unused import unused
from nfo_sinus_driver.catalog.declared.yaml_file import Node, Problems, load, number_of, shown
from nfo_sinus_driver.catalog.parameter import Access, Parameter, Value
from nfo_sinus_driver.catalog.profile import Wait, Write
from nfo_sinus_driver.catalog.status import FREQUENCY, SPEED, Role

#: What the name of a file ends with.
SUFFIX = '.vfd.yaml'
SETPOINT_KEY = 'line.setpoint'
SETPOINT_READ_KEY = 'line.setpoint_read'
#: With a number behind it.
IDENTITY_KEY = 'line.identity'
_MODES = {quantity.unit: quantity.mode for quantity in (FREQUENCY, SPEED)}
#: Where faults that are bits begin to be counted.
_FLAGS_FROM = 100
_MOST_FAULTS = 64
_OF_STATUS = ('register', 'block', 'table')
#: What shows that the motor turns beside a frequency, by the unit of set-points.
_TURNS: Mapping[str, Sequence[str]] = {FREQUENCY.unit: (), SPEED.unit: ('actual_speed',)}
#: What a drive cannot be at once; of the rest that holds at once the graver one counts.
_EXCLUSIVE = (('ready', 'inhibited'), ('ready', 'fault'), ('running', 'inhibited'))


def read(path: Path) -> Description:
    """
    Read and check a file.

    :raises DescriptionError: it is no description of a drive; it lists all that is wrong.
    """
    root, problems = load(path)
    schema.check(root, problems)
    problems.require_none()
    root = with_parameters(root, problems)
    problems.require_none()
    made = _Reader(path, root, problems).description()
    problems.require_none()
    return made


class _Reader:
    """Reads one file whose schema is right."""

    def __init__(self, path: Path, root: Node, problems: Problems) -> None:
        self._path = path
        self._root = root
        self._problems = problems
        self._line = self._line_defaults(root.get('line'))
        self._require_format()
        self._map = RegisterMap(root, self._line, problems)
        self._conditions: dict[str, PlacedCondition] = {}

    def description(self) -> Description:
        """Return what the file says; what is wrong goes to the problems."""
        root, control = self._root, self._root['control']
        settings = Settings(root, self._map, self._problems)
        faults = dict(self._faults(root.get('faults')))
        flags = list(self._flags(faults))
        self._conditions = dict(self._facts())
        steps = StepReader(root, self._map, settings, self._problems)
        running = [condition for name, condition in self._conditions.items() if name == 'running']
        of_flags = (condition for condition, _ in flags)
        conditions = [*running, *self._conditions.values(), *of_flags, *steps.awaited()]
        moving = self._moving
        # of two places one is read before and after the other, and has to stand still meanwhile
        conditions.sort(key=lambda condition: condition.register in moving)
        status = self._map.status(conditions, root['status'].get('block'))
        facts = {name: condition.in_place(status) for name, condition in self._conditions.items()}
        self._require_apart(facts)
        self._require_exclusive(facts, status)
        steps.use(status)
        codes = self._codes(root.get('faults'), status)
        setpoint = self._setpoint(settings)
        commands = CommandLists(
            control, steps, setpoint.direction, self._map.made, self._problems
        )
        measured, roles = self._measured(settings)
        self._require_one_holder(control, settings)
        self._require_seen_to_stand(control)
        after_write = tuple(self._after_write(steps, commands))
        identify = dict(self._identify())
        source = root.get('source')
        parameters = {**settings.parameters, **measured, **self._map.made}
        return Description(
            name=self._path.name.removesuffix(SUFFIX),
            path=str(self._path),
            title=root.text('title'),
            source=source.text('text', root.text('source')),
            rung=source.text('rung'),
            tested=root.text('tested'),
            line=self._line,
            parameters=parameters,
            roles={**settings.roles, **roles, **role_parameters(root)},
            status=status,
            facts=facts,
            setpoint=setpoint,
            identify=identify,
            **commands.lists(),
            keeps_run=root.flag('keeps_run') if 'keeps_run' in root else None,
            run_by=control.text('run_by'),
            stop_disturbs_local=control.flag('stop_disturbs_local'),
            after_write=after_write,
            requires=tuple(self._requires(control, settings)),
            holder=settings.holder(control.get('holder')),
            stop_mode=self._stop_mode(control.get('stop_mode'), settings),
            enable_input=control.text('enable_input').removeprefix('the '),
            codes=codes,
            faults=faults,
            flags=tuple((condition.in_place(status), fault) for condition, fault in flags),
            alarm=self._alarm(root.get('alarms')),
            timeout=self._timeout(settings),
            defaults={**{key: first for key, (first, *_) in identify.items()}, **settings.defaults},
            pole_pairs=root.get('motor').integer('pole_pairs'),
            simulated=read_simulated(
                root.get('simulated'), self._map, settings, self._problems
            ),
            unused=unused(root, self._problems),
        )

    def _line_defaults(self, node: Node) -> LineDefaults:
        write = {6: (6,), 16: (16,)}.get(node.integer('write'), (6, 16))
        texts = self._numbered(node.get('exceptions'))
        busy = [item.scalar for item in node.get('busy').items]
        return LineDefaults(
            node.text('protocol', LineDefaults.protocol), node.integer('baud_rate'),
            node.text('char_format'), node.integer('address'), _sentence(node, 'check'), write,
            node.integer('most_registers', 123),
            {code: str(text.scalar).rstrip(' .;:') for code, text in texts},
            frozenset(number for number in busy if isinstance(number, int)),
            float(node.number('gap') or 0), float(node.number('after_write') or 0),
        )

    def _require_format(self) -> None:
        line = self._line
        bits = '7' if line.protocol == 'modbus_ascii' else '8'
        if line.char_format and line.char_format[0] != bits:
            self._problems.add(
                self._root['line']['char_format'].line,
                f'{line.protocol} has {bits} data bits: write {bits}{line.char_format[1:]}',
            )

    # --- status ---

    @property
    def _moving(self) -> set[int]:
        """The registers of measured values."""
        measured = self._root.get('measured').mapping.values()
        return {self._map.register(node['register']) for node in measured if 'register' in node}

    def _facts(self) -> Iterator[tuple[str, PlacedCondition]]:
        for name, node in self._root['status'].mapping.items():
            if name not in _OF_STATUS:
                condition = self._map.condition(node, f'status {name}')
                if condition is not None:
                    yield name, condition

    def _require_apart(self, facts: Mapping[str, Condition]) -> None:
        seen: dict[Condition, str] = {}
        for name, fact in facts.items():
            line = self._conditions[name].line
            other = seen.setdefault(fact, name)
            if other != name:
                self._problems.add(
                    line, f'{name} and {other} mean the same bits: one of both is something else'
                )
            opposite = Condition(fact.mask, fact.values, not fact.inverted)
            bit = fact.mask & (fact.mask - 1) == 0
            turned = Condition(fact.mask, frozenset({fact.mask, 0} - fact.values)) if bit else None
            for contrary in (opposite, turned):
                if contrary in seen and {name, seen[contrary]} != {'remote', 'local'}:
                    self._problems.add(
                        line, f'{name} is true whenever {seen[contrary]} is not: say one of both'
                    )

    def _require_exclusive(self, facts: Mapping[str, Condition], status: StatusPlace) -> None:
        """Make sure that no number of a status is two things that exclude each other."""
        for pair in _EXCLUSIVE:
            for name, other in (pair, pair[::-1]):
                if not facts.keys() >= {name, other}:
                    continue
                fact, at_once = facts[name], facts[other]
                within = not at_once.mask & ~fact.mask
                shared = [value for value in fact.values if within and at_once.holds(value)]
                if shared and fact.names_numbers:
                    first, second = self._conditions[name], self._conditions[other]
                    number = self._written(name, min(shared) >> status.shift(first.register))
                    self._problems.add(
                        first.line,
                        f'{number} is {name}, and {other} (line {second.line}): remove it from '
                        'one of both',
                    )
                    break

    def _written(self, name: str, bits: int) -> str:
        """Return a number of a condition as the file has it."""
        node = self._root['status'][name]
        low = int(node['bits'].items[0].scalar or 0) if 'bits' in node else 0
        listed = [node['value']] if 'value' in node else node['values'].items
        return next(
            item.written for item in listed if (int(item.scalar or 0) & WORD) << low == bits
        )

    def _require_one_holder(self, control: Node, settings: Settings) -> None:
        shown_by = [name for name in ('remote', 'local') if name in self._conditions]
        if 'holder' in control and shown_by:
            self._problems.add(
                control['holder'].line,
                f'who has control is shown by status {shown_by[0]}, too: remove one of both',
            )

    def _require_seen_to_stand(self, control: Node) -> None:
        """Make sure that a motor is seen to stand that no run command runs, or none that shows."""
        measured = self._root.get('measured')
        turns = ('actual_frequency', *_TURNS[self._root['setpoint'].text('unit')])
        running = self._conditions.get('running')
        moves = running is not None and not running.coil and running.register in self._moving
        if not any(name in measured for name in turns):
            shows = f'measured {" or ".join(turns)}, which alone shows that the motor has stopped'
            if control.text('run_by') == 'setpoint':
                self._problems.add(
                    control['run_by'].line,
                    f'run_by: setpoint needs {shows}: a set-point would start it again',
                )
            elif moves and running is not None and 'actual_speed' in measured:
                self._problems.add(
                    running.line,
                    f'a running that is a measured value needs {shows}: it would start again by '
                    'itself',
                )
        if control.text('run_by') != 'terminals':
            return
        shown = 'actual_frequency' in measured
        if not shown or 'stopping' in self._conditions:
            self._problems.add(
                control['run_by'].line,
                'run_by: terminals needs measured actual_frequency, and no status stopping: the '
                'frequency alone shows that a motor stands that its terminals go on running',
            )
        if moves and running is not None:
            self._problems.add(
                running.line,
                'run_by: terminals needs a running that shows the terminals at set-point 0, too: '
                'that of a measured value shows no run then, and each enable would be refused',
            )

    # --- faults ---

    def _codes(self, node: Node, status: StatusPlace) -> FaultCodes | None:
        if 'register' not in node:
            if 'codes' in node:
                self._problems.add(node.line, 'faults has codes, but no register that tells them')
            return None
        none, register_map = node.integer('none') & WORD, self._map
        address = register_map.address(node, 'the fault', use=Use.FAULT)
        if status.holds(address):
            low, high = 0, 15
            if 'bits' in node:
                low, high = (int(item.scalar or 0) for item in node['bits'].items)
            shift = status.shift(address.index) + low
            bits = max(high - low + 1, 0)
            return FaultCodes(((1 << bits) - 1) << shift, shift, none, in_status=True)
        register_map.made[FAULT_KEY] = internal(
            FAULT_KEY, place_of(node, 'fault'), address, Access.READ
        )
        return FaultCodes(address.number.maximum, 0, none, in_status=False)

    def _faults(self, node: Node) -> Iterator[tuple[int, Fault]]:
        none = node.integer('none')
        for number, fault in self._numbered(node.get('codes')):
            if number == none or number > WORD:
                self._problems.add(
                    fault.line, f'fault {fault.name} cannot be: {none} means no fault'
                )
            code = status_code(number)
            yield code, _fault(fault, code)

    def _numbered(self, node: Node) -> Iterator[tuple[int, Node]]:
        """Yield what stands under numbers; one that stands twice, be it in two forms, is wrong."""
        lines: dict[int, int] = {}
        for text, entry in node.mapping.items():
            try:
                number = number_of(text)
            except ValueError as error:
                self._problems.add(entry.line, f'{error}: write it without zeros in front')
                continue
            if number in lines:
                self._problems.add(
                    entry.line, f'{text} stands in line {lines[number]} already: remove one of both'
                )
            lines[number] = entry.line
            yield number, entry

    def _flags(self, faults: Mapping[int, Fault]) -> Iterator[tuple[PlacedCondition, Fault]]:
        flags = self._root.get('faults').get('flags')
        if len(flags.items) > _MOST_FAULTS:
            self._problems.add(flags.line, f'faults has more than {_MOST_FAULTS} flags')
        taken = dict(faults)
        for number, node in enumerate(flags.items):
            text, code = node.text('text'), node.integer('code', _FLAGS_FROM + number)
            condition = self._map.condition(node, f'fault flag {text!r}')
            fault = _fault(node, status_code(code))
            other = taken.setdefault(fault.code, fault)
            if other is not fault:
                self._problems.add(
                    node.line,
                    f'the faults {text!r} and {other.text!r} have the code {code}: give the flag '
                    'one that no other has (code: 301)',
                )
            if condition is not None:
                yield condition, fault

    def _alarm(self, node: Node) -> Fault:
        usual = Description.alarm
        text = _sentence(node, 'text', usual.text)
        return Fault(0, text, usual.description, _sentence(node, 'remedy', usual.remedy))

    # --- set-point ---

    def _setpoint(self, settings: Settings) -> SetpointPlace:
        node = self._root['setpoint']
        what = 'the set-point'
        address = self._map.address(node, what, writable=True, use=Use.SETPOINT)
        write_only = node.text('access') == 'w'
        access = Access.WRITE if write_only or 'read_register' in node else Access.READ_WRITE
        unit, most = node.text('unit'), node.number('most') or Fraction(1)
        made = self._map.made
        name = place_of(node, 'set-point')
        made[SETPOINT_KEY] = settings.scaled(
            node, internal(SETPOINT_KEY, name, address, access, unit)
        )
        read_key = '' if write_only else SETPOINT_KEY
        if 'read_register' in node:
            read_key = SETPOINT_READ_KEY
            index, line = self._map.register(node['read_register']), node['read_register'].line
            count = address.codec.size // 2
            self._map.registers.note_use(Use.VALUE, what, line, 'register', index, count)
            shifted = replace(address, index=index)
            name = f'set-point (register {node["read_register"].written})'
            made[read_key] = settings.scaled(
                node, internal(read_key, name, shifted, Access.READ, unit)
            )
        codec, carried = address.number, most / address.factor
        if carried > codec.maximum and 'scaled_by' not in node:
            self._problems.add(
                node['most'].line,
                f'{shown(most)} {unit} is {shown(carried)} counts: the register carries '
                f'{codec.maximum} at most',
            )
        nominal = node.get('nominal')
        return SetpointPlace(
            SETPOINT_KEY, read_key, _MODES[unit], float(most),
            limit=settings.known(node.get('limit')),
            nominal=settings.known(nominal) if nominal.json_type == 'string' else _float(nominal),
            signed=self._signed(node, signed=codec.signed),
            direction=self._direction(node),
        )

    def _signed(self, node: Node, *, signed: bool) -> bool:
        wanted = node.flag('signed')
        if wanted and not signed:
            self._problems.add(
                node['signed'].line, 'signed: the type of the set-point has to be int16 or int32'
            )
        if wanted and 'direction' in node:
            self._problems.add(
                node['direction'].line, 'the direction is the sign or a word: remove one of both'
            )
        return wanted

    def _direction(self, setpoint: Node) -> Direction | None:
        node = setpoint.get('direction')
        if 'forward' not in node:
            return None
        coil, pulse = 'coil' in node, node.flag('pulse')
        if sum((coil, pulse, 'register' in node)) != 1:
            self._problems.add(
                node.line, 'direction needs a register or a coil, one of both, or pulse: true'
            )
            return None
        if pulse:
            ways = [self._map.pulse('direction', node[name]) for name in ('forward', 'reverse')]
            if ways[0] == ways[1]:
                self._problems.add(node.line, 'forward and reverse have to differ')
            forward, reverse = (int(way.value) for way in ways)
            return Direction(ways[0].key, forward, reverse, node.flag('alone'))
        forward, reverse = node.integer('forward') & WORD, node.integer('reverse') & WORD
        if forward == reverse or (coil and {forward, reverse} != {0, 1}):
            self._problems.add(
                node.line, 'forward and reverse have to differ; of a coil they are 0 and 1'
            )
        if coil:
            key = self._map.coil_key('direction', node['coil'])
            return Direction(key, forward, reverse, node.flag('alone'))
        key = self._map.word('direction', node['register'], forward | reverse)
        return Direction(key, forward, reverse, node.flag('alone'))

    # --- the rest ---

    def _identify(self) -> Iterator[tuple[str, tuple[int, ...]]]:
        for number, node in enumerate(self._root.get('identify').items, 1):
            key = f'{IDENTITY_KEY}_{number}'
            address = self._map.address(node, key)
            name = f'register {node["register"].written}'
            self._map.made[key] = internal(key, name, address, Access.READ)
            given = [node['value']] if 'value' in node else list(node.get('values').items)
            values = tuple(item.scalar for item in given if isinstance(item.scalar, int))
            if ('value' in node) is ('values' in node):
                self._problems.add(node.line, 'identify needs value or values, one of both')
            for value in values:
                if not address.number.fits(value):
                    said = f'identify: {address.number.name} does not carry {value}'
                    self._problems.add(node.line, said)
            if values:
                yield key, values

    def _measured(self, settings: Settings) -> tuple[dict[str, Parameter], dict[Role, str]]:
        made: dict[str, Parameter] = {}
        roles: dict[Role, str] = {Role.STATUS_WORD: STATUS_KEY}
        if FAULT_KEY in self._map.made:
            roles[Role.FAULT_CODE] = FAULT_KEY
        for name, node in self._root.get('measured').mapping.items():
            role, key = Role(name), f'measured.{name}'
            address = self._map.address(node, name)
            unit = _UNITS.get(name, '')
            parameter = internal(key, place_of(node, name), address, Access.READ, unit)
            made[key] = settings.scaled(node, parameter)
            roles[role] = key
        return made, roles

    def _requires(self, control: Node, settings: Settings) -> Iterator[Requirement]:
        for node in control.get('requires').items:
            key = settings.known(node['parameter'])
            if key:
                value = settings.value(key, node['value'])
                if value is not None:
                    yield Requirement(key, value, node.flag('write'), _sentence(node, 'text'))

    def _after_write(self, steps: StepReader, commands: CommandLists) -> Iterator[Write | Wait]:
        node = self._root.get('after_write')
        listed = steps.read(node, 'after_write')
        commands.require_no_run('after_write', listed, node.line)
        commands.check_pauses('after_write', listed, node.line)
        for step in listed:
            if isinstance(step, Wait) or (isinstance(step, Write) and step.key in self._map.made):
                yield step
            else:
                self._problems.add(
                    node.line, 'after_write takes steps with value, values, on or wait'
                )

    @staticmethod
    def _stop_mode(node: Node, settings: Settings) -> tuple[str, Value] | None:
        key = settings.known(node.get('parameter'))
        value = settings.value(key, node['coasts']) if key else None
        return None if value is None else (key, value)

    def _timeout(self, settings: Settings) -> Timeout | None:
        node = self._root.get('timeout')
        key = settings.known(node.get('parameter'))
        if not key:
            return None
        if settings.parameters[key].access is not Access.READ_WRITE:
            self._problems.add(node.line, f'{key} has to be written and read (access: rw)')
        conditions: dict[str, Sequence[Value]] = {}
        action = [node['action']] if 'action' in node else []
        for item in (*action, *node.get('requires').items):
            what = settings.known(item['parameter'])
            if what == key or what in conditions:
                self._problems.add(item.line, f'{what} stands in timeout twice')
            elif what:
                conditions[what] = tuple(self._timeout_values(item, what, settings))
        return Timeout(key, conditions)

    def _timeout_values(self, node: Node, key: str, settings: Settings) -> Iterator[Value]:
        """Yield the values of a condition of the time-out; it has to have some."""
        if settings.parameters[key].access is not Access.READ_WRITE:
            self._problems.add(node.line, f'{key} has to be written and read (access: rw)')
        given = [node[name] for name in ('stops', 'value', 'values') if name in node]
        if len(given) != 1:
            self._problems.add(node.line, f'{key}: one of value and values is needed')
            return
        for item in given[0].items or [given[0]]:
            value = settings.value(key, item)
            if value is not None:
                yield value


_UNITS = {
    'actual_frequency': 'Hz', 'actual_speed': 'rpm', 'actual_torque': '%', 'output_voltage': 'V',
    'output_current': 'A', 'output_power': 'W', 'dc_link_voltage': 'V', 'motor_temperature': '%',
    'operating_time': 'h', 'running_time': 'h', 'energy': 'kWh', 'total_energy': 'kWh',
}


def _fault(node: Node, code: int) -> Fault:
    return Fault(
        code, _sentence(node, 'text'), _sentence(node, 'description'), _sentence(node, 'remedy'),
        node.flag('line'),
    )


def _sentence(node: Node, key: str, default: str = '') -> str:
    """Return a text that becomes a part of a sentence: without its full stop."""
    return node.text(key, default).rstrip(' .;:')


def _float(node: Node) -> float | None:
    found = node.scalar
    return float(found) if isinstance(found, (int, Fraction)) else None
