# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Files that describe drives: what is wrong in one is said with its line, and nothing else ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import copy
import json
from pathlib import Path
import re
from typing import Any

from hypothesis import given, settings, strategies as st
import pytest
from support.described import SHIPPED
import yaml

from nfo_sinus_driver.catalog import Role, load_family
from nfo_sinus_driver.catalog.declared import DescriptionError, read, schema
from nfo_sinus_driver.catalog.declared.yaml_file import load
from nfo_sinus_driver.cli.families import check

#: A drive in which nothing is wrong.
GOOD = """
vfd: 1
title: Made up
source: made up
line: {baud_rate: 9600, char_format: '8N1', address: 5, write: 6 and 16}
control:
  requires:
    - {parameter: source.command, value: Bus}
  run: [{register: 10, value: 1}]
  stop: [{register: 10, value: 0}]
  reset: [{register: 10, set: 8}, {wait: 0.1}, {register: 10, clear: 8}]
setpoint: {register: 11, type: int16, factor: 0.1, unit: Hz, most: 60, signed: true}
status:
  register: 20
  running: {bit: 0}
  fault: {bit: 3}
measured:
  actual_frequency: {register: 22, type: int16, factor: 0.1}
faults:
  register: 21
  codes: {1: {text: hot, remedy: Let it cool}}
parameters:
  ramp.accel: {register: 30, factor: 0.1, unit: s, minimum: 0.1, maximum: 60, default: 5}
  source.command: {register: 31, choices: {0: Keypad, 1: Bus}}
  serial.timeout: {register: 32, factor: 0.1, unit: s}
timeout: {parameter: serial.timeout}
simulated: {accel: ramp.accel}
"""


def complaints(tmp_path: Path, text: str) -> list[str]:
    """Return what is wrong in a file."""
    path = tmp_path / 'made_up.vfd.yaml'
    path.write_text(text, encoding='utf-8')
    try:
        read(path)
    except DescriptionError as error:
        return list(error.problems)
    return []


def test_the_good_one_is(tmp_path: Path) -> None:
    assert complaints(tmp_path, GOOD) == []


def test_a_coast_by_a_bit_takes_back_that_of_run_too(tmp_path: Path) -> None:
    coast = 'coast: [{register: 10, set: 4, clear: 1}]\n  reset:'
    assert complaints(tmp_path, GOOD.replace('reset:', coast)) == []


def test_a_stop_by_bits_takes_back_both_directions(tmp_path: Path) -> None:
    text = GOOD.replace('type: int16, factor: 0.1, unit: Hz', 'factor: 0.1, unit: Hz')
    for reverse, clear, right in ((3, 1, True), (2, 1, False), (2, 3, True)):
        direction = f'direction: {{register: 10, forward: 1, reverse: {reverse}}}}}'
        found = complaints(
            tmp_path,
            text.replace('signed: true}', direction).replace(
                'stop: [{register: 10, value: 0}]', f'stop: [{{register: 10, clear: {clear}}}]'
            ),
        )
        assert (found == []) is right, found


MEASURED = 'actual_frequency: {register: 22, type: int16, factor: 0.1}'


@pytest.mark.parametrize(
    ('measured', 'right'),
    [
        ('output_current: {register: 23}', True),
        ('output_current: {register: 22}', False),
        ('output_current: {register: 21, type: uint32}', False),
        ('output_current: {register: 20}', False),
        ('output_current: {register: 22, table: input}', True),
        ('output_current: {register: 20, bits: [8, 15]}', True),
        ('output_current: {register: 23, bits: [0, 7]}\n  output_voltage: {register: 23, bits: '
         '[8, 15]}', True),
    ],
)  # fmt: skip
def test_a_value_has_a_register_of_its_own(tmp_path: Path, measured: str, right: bool) -> None:
    found = complaints(tmp_path, GOOD.replace(MEASURED, f'{MEASURED}\n  {measured}'))
    assert (found == []) is right, found
    assert right or 'stand in the same register' in found[0]


def test_a_status_may_be_the_size_or_the_sign_of_a_value(tmp_path: Path) -> None:
    status = 'running: {register: 22, except: [0]}\n  reverse: {register: 22, bit: 15}'
    assert complaints(tmp_path, GOOD.replace('running: {bit: 0}', status)) == []


#: Two uses of one register or coil that exclude each other: what is replaced, and which two.
_RUN, _PARAMETER = 'run: [{register: 10, value: 1}]', '  ramp.accel: {register: 30'
TWO_USES = {
    'a parameter': (_PARAMETER, '  ramp.accel: {register: 10', 'ramp.accel', 'run'),
    'a parameter, beside another step': (
        _RUN, 'run: [{register: 9, values: [7, 0]}, {register: 10, value: 1}]\n  coast: '
        '[{register: 30, value: 0}, {register: 10, value: 0}]', 'ramp.accel', 'coast',
    ),
    'the second register of a parameter': (
        '{register: 32, factor: 0.1, unit: s}', '{register: 9, type: uint32, unit: s}',
        'serial.timeout', 'run',
    ),
    'the second register of a parameter, with function 16 alone': (
        'write: 6 and 16', 'write: 16', 'other.one', 'ramp.accel',
    ),
    'the set-point': ('setpoint: {register: 11', 'setpoint: {register: 10', 'set-point', 'run'),
    'the second register of the set-point': (
        'setpoint: {register: 11, type: int16', 'setpoint: {register: 9, type: int32',
        'set-point', 'run',
    ),
    'the set-point and a parameter': (_PARAMETER, '  ramp.accel: {register: 11', 'ramp.accel',
                                      'set-point'),
    'the second of several registers': (
        _RUN, 'run: [{register: 10, values: [1, 5]}]', 'run', 'set-point',
    ),
    'a direction on the set-point': (
        'type: int16, factor: 0.1, unit: Hz, most: 60, signed: true',
        'factor: 0.1, unit: Hz, most: 60, direction: {register: 11, forward: 1, reverse: 2}',
        'direction', 'set-point',
    ),
    'a measured value': ('{register: 22, type: int16', '{register: 10, type: int16',
                         'actual_frequency', 'run'),
    'a measured value and a parameter': (_PARAMETER, '  ramp.accel: {register: 22',
                                         'actual_frequency', 'ramp.accel'),
    'the fault': ('register: 21', 'register: 10', 'fault', 'run'),
    'the fault and a measured value': ('register: 21', 'register: 22', 'fault',
                                       'actual_frequency'),
    'the set-point that is read': (
        'signed: true}', 'signed: true, read_register: 22}', 'actual_frequency', 'set-point',
    ),
    'what follows a change': (
        '\ntimeout', '\nafter_write: [{register: 30, value: 1}]\ntimeout', 'after_write',
        'ramp.accel',
    ),
    'a coil': (
        _RUN, 'run: [{register: 10, value: 1}, {coil: 3, on: true}]', 'other.coil', 'run',
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', TWO_USES)
def test_no_register_has_two_uses_that_exclude_each_other(tmp_path: Path, name: str) -> None:
    old, new, first, other = TWO_USES[name]
    more = '  other.one: {register: 29, type: uint32}\n' if first == 'other.one' else ''
    more += '  other.coil: {coil: 3, choices: {0: No, 1: Yes}}\n'
    good = GOOD.replace(_PARAMETER, more + _PARAMETER)
    if not more.startswith('  other.one'):
        assert complaints(tmp_path, good) == []
    assert old in good
    text = good.replace(old, new, 1)
    found = complaints(tmp_path, text)
    (said,) = [line for line in found if 'stand in the same' in line]
    assert first in said and other in said, said
    # both lines are named
    lines = [int(number) for number in re.findall(r'line (\d+)', said)]
    assert len(lines) == 2
    assert all(re.search(r'register|values|coil|run', text.splitlines()[at - 1]) for at in lines)


def test_the_other_line_may_be_in_the_table_of_parameters(tmp_path: Path) -> None:
    (tmp_path / 'own.csv').write_text('parameter,register\nramp.fast_stop,10\n')
    text = re.sub(r'(?s)parameters:.*', 'parameters: own.csv\n', GOOD)
    text = text.replace('  requires:\n    - {parameter: source.command, value: Bus}\n', '')
    (said,) = complaints(tmp_path, text)
    assert 'made_up.vfd.yaml, line 7: run and ramp.fast_stop (own.csv, line 2)' in said


#: Uses of one register that go together, as drives have them.
TOGETHER = {
    'status and fault': ('register: 21', 'register: 20'),
    'status and fault, in bits': ('register: 21', 'register: 20\n  bits: [8, 15]'),
    'status where commands are written': ('register: 20', 'register: 10'),
    'set-point 0 in one message with a command': (
        'stop: [{register: 10, value: 0}]', 'stop: [{register: 10, values: [0, 0]}]',
    ),
    'who has control, by a parameter': (
        'fault: {bit: 3}', 'fault: {bit: 3}\n  block: {register: 20, count: 2}',
    ),
    'some bits of a parameter': (
        _PARAMETER, '  other.bits: {register: 31, bits: [0, 3], access: r}\n' + _PARAMETER,
    ),
    'holding and input registers': (
        '{register: 22, type: int16', '{register: 10, table: input, type: int16',
    ),
    'a coil and a register': (_PARAMETER, '  other.coil: {coil: 10}\n' + _PARAMETER),
}  # fmt: skip


@pytest.mark.parametrize('name', TOGETHER)
def test_uses_that_go_together_are_right(tmp_path: Path, name: str) -> None:
    old, new = TOGETHER[name]
    assert old in GOOD
    assert complaints(tmp_path, GOOD.replace(old, new, 1)) == []


_RESET = 'reset: [{register: 10, set: 8}, {wait: 0.1}, {register: 10, clear: 8}]'


@pytest.mark.parametrize(
    ('run', 'stop', 'reset', 'right'),
    [
        ('value: 1', 'value: 0', '{register: 10, value: 8}, {register: 10, value: 0}', True),
        ('value: 1', 'value: 0', '{register: 10, value: 9}, {register: 10, value: 0}', False),
        ('value: 1', 'value: 0', '{register: 10, value: 8}, {register: 10, value: 9}', False),
        ('value: 1', 'value: 0', '{register: 9, values: [0, 9]}, {register: 10, value: 0}', False),
        ('value: 1', 'value: 0', '{register: 10, set: 9}, {register: 10, clear: 9}', False),
        ('value: 15', 'value: 6', '{register: 10, set: 1}, {register: 10, set: 8}', False),
        ('set: 1', 'clear: 1', '{register: 10, value: 9}, {register: 10, clear: 8}', False),
        ('value: 0x47F', 'value: 0x47E', '{register: 10, value: 0x4FF}', False),
        ('value: 0x47F', 'value: 0x47E', '{register: 10, value: 0x4FE}', True),
        # commands by numbers, and not by bits
        ('value: 1', 'value: 6', '{register: 10, value: 7}', True),
        ('value: 1', 'value: 6', '{register: 10, value: 1}', False),
        ('value: 15', 'value: 6', '{register: 10, value: 0x87}', True),
    ],
)
@pytest.mark.parametrize('name', ['reset', 'prepare', 'release', 'after_write'])
def test_nothing_but_run_gives_the_run_command(
    tmp_path: Path, run: str, stop: str, reset: str, right: bool, name: str
) -> None:
    text = GOOD.replace('{register: 10, value: 1}', f'{{register: 10, {run}}}')
    text = text.replace('{register: 10, value: 0}', f'{{register: 10, {stop}}}', 1)
    text = text.replace(f'  {_RESET}\n', '')
    if name == 'after_write':
        text += f'after_write: [{reset}]\n'
    else:
        text = text.replace('  run:', f'  {name}: [{reset}]\n  run:')
    found = complaints(tmp_path, text)
    assert (found == []) is right, found
    assert right or f'{name} gives the run command' in found[0]


def test_no_setting_is_the_run_command(tmp_path: Path) -> None:
    text = GOOD.replace('run: [{register: 10, value: 1}]', 'run: [{parameter: own.run, to: 1}]')
    text = text.replace('[{register: 10, value: 0}]', '[{parameter: own.run, to: 0}]')
    text = text.replace(_PARAMETER, '  own.run: {register: 33}\n' + _PARAMETER)
    (said,) = complaints(tmp_path, text)
    assert 'own.run' in said and 'any client' in said


#: What is replaced by what, and what is said of it.
BAD = {
    'no YAML': ('vfd: 1', 'vfd: [1', 'is no YAML'),
    'another version': ('vfd: 1', 'vfd: 2', 'choose one of 1'),
    'no title': ('title: Made up', '', "needs 'title'"),
    'unknown key': ('setpoint: {register', 'setpoint: {regsiter: 1, register', "'register' may be"),
    'a key like another': (
        'fault: {bit: 3}', 'fault: {bit: 3}\n  warning: {bit: 5}', 'at_setpoint, alarm',
    ),
    'missing register': ('setpoint: {register: 11, ', 'setpoint: {', "needs 'register'"),
    'register out of range': ('{register: 10, value: 1}', '{register: 70000, value: 1}', 'be sent'),
    'register below the numbering': ('write: 6', 'numbering: 40001, write: 6', 'cannot be sent'),
    'a word too wide': (
        '{register: 10, value: 1}', '{register: 10, value: 70000}', '65535 at most',
    ),
    'a status too wide': ('bit: 3}', 'value: 0x10008}', '65535 at most'),
    'a direction too wide': (
        'signed: true}', 'direction: {register: 10, forward: 1, reverse: 65538}}', '65535 at most',
    ),
    'a pause at a register': (
        '{wait: 0.1}', '{wait: 0.1, register: 10}', 'does one thing',
    ),
    'a register beside a parameter': (
        'run: [{register: 10, value: 1}]',
        'run: [{register: 10, value: 1}, {parameter: ramp.accel, to: 5, register: 12}]',
        'does one thing',
    ),
    'a value in a register and a coil': (
        '{register: 22, type', '{register: 22, coil: 3, type', 'remove one of both',
    ),
    'a measured value scaled by nothing': (
        'actual_frequency: {', 'actual_frequency: {scaled_by: motor.frequency, ',
        'none of the parameters',
    ),
    'a register to write beside one to read': (
        '{register: 30,', '{register: 30, write_register: 33,', 'is no key of',
    ),
    'factor 0': ('signed: true}', 'signed: true}', ''),
    'factor none': ('factor: 0.1, unit: Hz', 'factor: 0, unit: Hz', 'more than 0'),
    'a factor that is text': ('factor: 0.1, unit: Hz', 'factor: ten, unit: Hz', 'a fraction'),
    'zeros in front': ('{register: 30,', '{register: 0030,', 'begins with 0'),
    'twice the same key': ('title: Made up', 'title: Made up\ntitle: Again', 'already'),
    'two meanings of a bit': ('fault: {bit: 3}', 'fault: {bit: 0}', 'mean the same bits'),
    'the contrary': ('fault: {bit: 3}', 'fault: {bit: 3}\n  ready: {bit: 3, is: 0}', 'whenever'),
    'never running': ('running: {bit: 0}', 'running: {mask: 1, value: 2}', 'never be true'),
    'always running': ('running: {bit: 0}', 'running: {mask: 1, values: [0, 1]}', 'the same'),
    'running says nothing': ('running: {bit: 0}', 'running: {mask: 1}', 'add value'),
    'no running': ('running: {bit: 0}', '', "needs 'running'"),
    'bit 16': ('fault: {bit: 3}', 'fault: {bit: 16}', '15 at most'),
    'bit and mask': ('fault: {bit: 3}', 'fault: {bit: 3, mask: 8}', 'is enough'),
    'status in three places': (
        'fault: {bit: 3}', 'fault: {register: 40, bit: 3}\n  alarm: {register: 50, bit: 1}',
        'needs a profile in Python',
    ),
    'register and coil': ('fault: {bit: 3}', 'fault: {register: 1, coil: 2}', 'one of both'),
    'a stop that stops nothing': ('stop: [{register: 10, value: 0}]',
                                  'stop: [{register: 10, value: 1}]', 'leaves the run command'),
    'a stop elsewhere': ('stop: [{register: 10, value: 0}]',
                         'stop: [{register: 12, value: 0}]', 'leaves the run command'),
    'an empty stop': ('stop: [{register: 10, value: 0}]', 'stop: []', 'writes nothing'),
    'a coast that runs': (
        '  reset:', '  coast: [{register: 10, value: 1}]\n  reset:', 'leaves the run',
    ),
    'a coast by a bit beside that of run': (
        '  reset:', '  coast: [{register: 10, set: 4}]\n  reset:', 'the motor may start again',
    ),
    'a stop that waits': ('stop: [{register', 'stop: [{wait: 0.1}, {register', 'never delayed'),
    'a stop that awaits': ('stop: [{register', 'stop: [{until: {bit: 1}}, {register', 'delayed'),
    'a pause too long': ('{wait: 0.1}', '{wait: 30}', 'pauses for more than'),
    'a step of two things': ('{register: 10, value: 1}', '{register: 10, value: 1, set: 2}',
                             'does one thing'),
    'a step nowhere': ('run: [{register: 10, value: 1}]', 'run: [{value: 1}]', 'needs a register'),
    'the same bits set and cleared': ('{register: 10, set: 8}', '{register: 10, set: 8, clear: 8}',
                                      'the same bits'),
    'more than the line carries': ('write: 6 and 16', 'write: 6', ''),
    'two registers without 16': (
        '{register: 32, factor: 0.1, unit: s}', '{register: 32, type: uint32, unit: s}', '',
    ),
    'unsigned and signed': ('type: int16, factor: 0.1, unit: Hz', 'factor: 0.1, unit: Hz', 'int16'),
    'direction twice': (
        'signed: true}', 'signed: true, direction: {register: 10, forward: 1, reverse: 2}}',
        'remove one of both',
    ),
    'a direction that is none': (
        'signed: true}', 'direction: {register: 10, forward: 1, reverse: 1}}', 'have to differ',
    ),
    'a prepare that runs': (
        '  run:', '  prepare: [{register: 10, value: 1}]\n  run:', 'prepare gives the run command',
    ),
    'a reset that runs': ('{register: 10, clear: 8}]', '{register: 10, value: 1}]', 'would turn'),
    'a run that is not forward': (
        'signed: true}', 'direction: {register: 10, forward: 3, reverse: 2}}', 'has to run forward',
    ),
    'a set-point too great': ('most: 60', 'most: 6000', 'carries 32767 at most'),
    'a unit of another kind': ('unit: Hz, most', 'unit: km/h, most', 'choose one of Hz, rpm'),
    'a parameter that is none': ('timeout: {parameter: serial.timeout}',
                                 'timeout: {parameter: serial.tiemout}', 'none of the parameters'),
    **{
        name: (
            'timeout: {parameter: serial.timeout}',
            'timeout: {parameter: serial.timeout, ' + more + '}',
            said,
        )
        for name, more, said in (
            ('a time-out that requires what is no parameter',
             'requires: [{parameter: source.bus, value: Bus}]', 'none of the parameters'),
            ('a time-out that requires no value',
             'requires: [{parameter: source.command}]', 'one of value and values'),
            ('a time-out that requires a value twice',
             'requires: [{parameter: source.command, value: Bus, values: [Bus]}]', 'one of value'),
            ('a time-out that requires a value that is none',
             'requires: [{parameter: source.command, values: [Panel]}]', 'none of Keypad, Bus'),
            ('a time-out that requires one thing twice',
             'action: {parameter: source.command, stops: Bus}, '
             'requires: [{parameter: source.command, value: Bus}]', 'stands in timeout twice'),
            ('a time-out that requires itself',
             'requires: [{parameter: serial.timeout, value: 2}]', 'stands in timeout twice'),
            ('a time-out that stops by nothing',
             'action: {parameter: source.command, stops: []}', 'it needs 1 or more'),
            ('a time-out that stops by a list of lists',
             'action: {parameter: source.command, stops: [[Bus]]}', 'has to be'),
        )
    },
    'a choice that is none': ('value: Bus}', 'value: Panel}', 'none of Keypad, Bus'),
    'minimum above maximum': ('minimum: 0.1, maximum: 60', 'minimum: 60, maximum: 1', 'below'),
    'a maximum too great': ('maximum: 60', 'maximum: 7000', 'does not fit'),
    'a default out of range': ('default: 5', 'default: 500', 'out of range'),
    'two in one register': ('{register: 31,', '{register: 30,', 'in the same register'),
    'a name that is none': ('ramp.accel: {register', 'Ramp: {register', 'group.name'),
    'a group that is taken': ('  ramp.accel: {', '  line.speed: {register: 90}\n  ramp.accel: {',
                              'are taken'),
    'choices with a factor': ('{register: 31, choices', '{register: 31, factor: 0.1, choices',
                              'numbers that the register carries'),
    'a choice twice': ('{0: Keypad, 1: Bus}', '{0: Bus, 1: Bus}', 'stands twice'),
    'fault 0': ('codes: {1: {', 'codes: {0: {', 'means no fault'),
    'codes nowhere': ('faults:\n  register: 21', 'faults:', 'no register that tells them'),
    'a list for a mapping': ('status:\n  register: 20', 'status:\n  - register: 20', 'no YAML'),
    'a text for a number': ('most: 60', 'most: fast', 'a number'),
    'a loop': ('line: {', 'line: &line {check: *line, ', 'leads to itself'),
    'a parity that is none': ("char_format: '8N1'", 'char_format: 8N7', 'choose one of'),
    'data bits of another protocol': (
        'address: 5', 'address: 5, protocol: modbus_ascii', 'write 7N1',
    ),
    'address 0': ('address: 5', 'address: 0', '1 at least'),
    'a number that is ready and inhibited': (
        '  running: {bit: 0}',
        '  ready: {bits: [4, 6], value: 3}\n  inhibited: {bits: [4, 6], values: [3, 6]}\n'
        '  running: {bit: 0}',
        '3 is ready, and inhibited (line 16)',
    ),
    'a number that is ready and a fault': (
        '  running: {bit: 0}\n  fault: {bit: 3}',
        '  ready: {bits: [0, 3], values: [2, 9]}\n  running: {bits: [0, 3], value: 1}\n'
        '  fault: {bit: 3}',
        '9 is ready, and fault (line 17)',
    ),
    'a number that runs and is none of those in which it can': (
        '  running: {bit: 0}',
        '  running: {mask: 0x00F0, values: [0x10, 0x30]}\n'
        '  inhibited: {mask: 0x0030, except: [0x10]}',
        '0x30 is running, and inhibited (line 16)',
    ),
    'an identity without a number': (
        'control:', 'identify: [{register: 1}]\ncontrol:', 'value or values',
    ),
    'an identity with two': (
        'control:', 'identify: [{register: 1, value: 2, values: [3]}]\ncontrol:', 'one of both',
    ),
    'an identity too great': (
        'control:', 'identify: [{register: 1, value: 70000}]\ncontrol:', 'does not carry 70000',
    ),
    'read-only time-out': ('{register: 32, factor: 0.1, unit: s}',
                           '{register: 32, factor: 0.1, unit: s, access: r}', 'access: rw'),
}


@pytest.mark.parametrize('name', [name for name, (_, _, said) in BAD.items() if said])
def test_a_bad_file_is_refused_with_its_line_and_a_sentence(tmp_path: Path, name: str) -> None:
    old, new, said = BAD[name]
    assert old in GOOD
    text = GOOD.replace(old, new, 1)
    found = complaints(tmp_path, text)
    assert any(said in complaint for complaint in found), found
    for complaint in found:
        assert re.match(r'.*made_up\.vfd\.yaml(, line \d+)?: \S.*', complaint), complaint
    # all of them are named at once, at the right place
    right = '\n'.join(complaint for complaint in found if said in complaint)
    line = int(re.findall(r', line (\d+):', right)[0])
    assert 1 <= line <= text.count('\n') + 1


#: What is replaced by what, and which key has no effect then.
WITHOUT_EFFECT = {
    'a quick stop beside a coast': (
        '  reset:',
        '  coast: [{register: 10, value: 4}]\n  quick_stop: [{register: 10, value: 2}]\n  reset:',
        'quick_stop',
    ),
    'a limit of a wait': (
        'run: [{', 'run: [{until: {bit: 1}, within: 0.5}, {', 'within',
    ),
    'a stop that disturbs nothing': ('  run:', '  stop_disturbs_local: true\n  run:',
                                     'stop_disturbs_local'),
    'the text of no alarm': ('\nfaults:', '\nalarms: {text: Hot}\nfaults:', 'alarms'),
    'what is no fault, nowhere': (
        'faults:\n  register: 21\n  codes: {1: {text: hot, remedy: Let it cool}}',
        'faults: {none: 3}', 'none',
    ),
    'a block of coils': (
        'status:\n  register: 20\n  running: {bit: 0}\n  fault: {bit: 3}',
        'status:\n  block: {register: 20, count: 2}\n  running: {coil: 0}\n  fault: {coil: 3}',
        'block',
    ),
    'the speed of a line without one': (
        'address: 5', 'address: 5, protocol: modbus_tcp', 'baud_rate',
    ),
    'the type of a coil': (
        '  ramp.accel:', '  other.coil: {coil: 3, type: int16}\n  ramp.accel:', 'type',
    ),
    'when what is read may be written': (
        'factor: 0.1, unit: s}\ntimeout', 'factor: 0.1, unit: s}\n  other.value: {register: 40, '
        'access: r, while_running: false}\ntimeout', 'while_running',
    ),
    'the range of choices': ('choices: {0', 'maximum: 3, choices: {0', 'maximum'),
    'what follows a change of nothing': (
        '\nparameters:', '\nafter_write: [{register: 50, value: 1}]\nparameters:', 'after_write',
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', WITHOUT_EFFECT)
def test_check_names_what_has_no_effect(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new, key = WITHOUT_EFFECT[name]
    assert old in GOOD
    text = GOOD.replace(old, new, 1)
    if key == 'after_write':
        text = re.sub(r'(?s)\nparameters:.*', '\n', text)
        text = text.replace('  requires:\n    - {parameter: source.command, value: Bus}\n', '')
    path = tmp_path / 'made_up.vfd.yaml'
    path.write_text(text, encoding='utf-8')
    assert check(str(path))
    said = [text for text in capsys.readouterr().out.splitlines() if 'has no effect' in text]
    (line,) = re.findall(rf'line (\d+): {key} has no effect: ', '\n'.join(said))
    assert key in text.splitlines()[int(line) - 1]


def test_all_keys_of_the_good_one_and_of_shipped_files_have_an_effect(tmp_path: Path) -> None:
    (tmp_path / 'good.vfd.yaml').write_text(GOOD, encoding='utf-8')
    for path in (tmp_path / 'good.vfd.yaml', *SHIPPED.values()):
        assert not read(path).unused


def test_registers_may_be_printed_from_400001(tmp_path: Path) -> None:
    text = re.sub(r'register: (\d+)', lambda found: f'register: {400001 + int(found[1])}', GOOD)
    text = text.replace('write: 6', 'numbering: 400001, write: 6')
    assert complaints(tmp_path, text) == []
    assert read(tmp_path / 'made_up.vfd.yaml').status.registers == (20,)


def test_a_file_says_what_tells_its_drive_from_others(tmp_path: Path) -> None:
    path = tmp_path / 'known.vfd.yaml'
    second = '{register: 65, bits: [4, 7], values: [1, 2]}'
    identify = f'identify: [{{register: 0x40, value: 7}}, {second}]'
    path.write_text(GOOD.replace('control:', f'{identify}\ncontrol:'), encoding='utf-8')
    family = load_family(str(path))
    first, second = family.profile.identify
    assert family.profile.identify == {first: (7,), second: (1, 2)}
    assert (family[first].name, family[second].name) == ('register 0x40', 'register 65')
    assert not {first, second} & {parameter.key for parameter in family.settings}


def test_all_that_is_wrong_is_reported_at_once(tmp_path: Path) -> None:
    text = GOOD.replace('bit: 3', 'bit: 0').replace('default: 5', 'default: 500')
    text = text.replace('value: Bus}', 'value: Panel}')
    assert len(complaints(tmp_path, text)) == 3


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match='No such file'):
        read(tmp_path / 'nothing.vfd.yaml')
    (tmp_path / 'empty.vfd.yaml').write_text('')
    with pytest.raises(DescriptionError, match='is empty'):
        read(tmp_path / 'empty.vfd.yaml')
    (tmp_path / 'bytes.vfd.yaml').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(DescriptionError):
        read(tmp_path / 'bytes.vfd.yaml')


@pytest.mark.parametrize(
    'text', ['[' * 65536, 'a: "\\U00110000"', 'a: "\\UFFFFFFFF"', '%YAML 1.' + '9' * 5000]
)
def test_a_file_that_its_reader_cannot_bear(tmp_path: Path, text: str) -> None:
    (tmp_path / 'spoilt.vfd.yaml').write_text(text)
    with pytest.raises(DescriptionError, match=str(tmp_path)):
        read(tmp_path / 'spoilt.vfd.yaml')


# --- what is right ---


def test_the_lines_of_yaml_are_kept() -> None:
    for path in SHIPPED.values():
        root, _ = load(path)
        lines = path.read_text(encoding='utf-8').splitlines()
        for key, node in root.mapping.items():
            assert key in lines[node.line - 1] or key in lines[node.line - 2], (path, key)


def test_shipped_files_are_short_and_say_where_from() -> None:
    for path in SHIPPED.values():
        text = path.read_text(encoding='utf-8')
        body = text.split('\nparameters:')[0]
        assert body.count('\n') <= 60, path
        assert 'not yet on a drive.' in text.splitlines()[0], path
        assert read(path).source and read(path).rung in ('manual', 'master'), path


def test_a_shipped_file_that_does_not_identify_its_drive_says_so_and_what_was_looked_for() -> None:
    for path in SHIPPED.values():
        (comment, *_) = path.read_text(encoding='utf-8').splitlines()
        assert ('Nothing identifies it: ' in comment) is not bool(read(path).identify), path


def test_a_shipped_file_without_a_time_out_says_where_the_drive_has_it() -> None:
    without = [drive for drive in map(read, SHIPPED.values()) if drive.timeout is None]
    assert without
    for drive in without:
        assert 'time-out' in drive.line.check, drive.title


def test_the_schema_is_one_that_editors_understand() -> None:
    found = json.loads(schema.PATH.read_text(encoding='utf-8'))
    assert found['$schema'].endswith('2020-12/schema')
    refs = set(re.findall(r'"\$ref": "#/\$defs/(\w+)"', json.dumps(found)))
    assert refs == set(found['$defs'])


def test_what_the_file_does_not_give_the_drive_does_not_have(tmp_path: Path) -> None:
    path = tmp_path / 'bare.vfd.yaml'
    text = GOOD[: GOOD.index('measured:')].replace('  requires:\n', '')
    path.write_text(text.replace('    - {parameter: source.command, value: Bus}\n', ''))
    family = load_family(str(path))
    assert set(family.roles) == {Role.STATUS_WORD}
    assert family.settings == () and family.name == 'bare'
    assert not family.profile.status_word.by_frequency


#: Where a number stands in the good file, and what may be mistaken for one.
NUMBERS = (
    'baud_rate: 9600', 'address: 5', 'value: 1', 'wait: 0.1', 'unit: Hz, most: 60', 'bit: 0',
    'register: 20', 'minimum: 0.1', 'maximum: 60', 'default: 5', 'codes: {1', 'register: 30',
    'type: int16, factor: 0.1',
)
NO_NUMBERS = (
    '0x' + 'f' * 400, '9' * 5000, '-' + '9' * 99, '0b' + '1' * 5000, '1.0e99', '1.0e400',
    '0.' + '0' * 98 + '1', '1/' + '9' * 5000, '9' * 5000 + '/1', '.5', '5.', '!!int "7"',
    '2001-01-01', '1:30', '~', '"\\0"', '{}', '[]',
)


@pytest.mark.parametrize('number', NUMBERS)
def test_whatever_stands_for_a_number_nothing_but_a_sentence_comes(
    tmp_path: Path, number: str
) -> None:
    assert number in GOOD
    for other in NO_NUMBERS:
        key = re.sub(r'[\d.]+$', '', number)
        for complaint in complaints(tmp_path, GOOD.replace(number, key + other, 1)):
            assert re.match(r'.*made_up\.vfd\.yaml(, line \d+)?: \S.*', complaint), complaint


# --- fuzz ---

_SCALARS = st.one_of(
    st.none(), st.booleans(), st.integers(-70000, 70000), st.sampled_from([0, 1, 8, 10, 0xFFFF]),
    st.floats(allow_nan=True), st.text(max_size=8),
    st.sampled_from(['ramp.accel', 'Bus', 'int16', 'Hz', '1/0', '1/3', 'register', 'rw', 'w']),
)


def _spots(node: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return where something stands in a document."""
    found = [path] if path else []
    if isinstance(node, Mapping):
        for key, value in node.items():
            found += _spots(value, (*path, key))
    elif isinstance(node, list):
        for number, value in enumerate(node):
            found += _spots(value, (*path, number))
    return found


def _words() -> list[str]:
    """Return every key that the schema has."""
    return sorted(set(re.findall(r'"(\w+)": \{', schema.PATH.read_text(encoding='utf-8'))))


WHOLE = yaml.safe_load(GOOD)
SPOTS = _spots(WHOLE)


def _changed(change: Callable[[Any, Any], None], spot: tuple[Any, ...], document: Any) -> None:
    *way, last = spot
    for key in way:
        try:
            document = document[key]
        except (KeyError, IndexError, TypeError):
            return
    if isinstance(document, (dict, list)):
        try:
            change(document, last)
        except (KeyError, IndexError, TypeError):
            return


@settings(max_examples=400, deadline=None)
@given(st.data())
def test_whatever_is_changed_nothing_but_a_sentence_comes(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    document = copy.deepcopy(WHOLE)
    for _ in range(data.draw(st.integers(1, 4))):
        spot = data.draw(st.sampled_from(SPOTS))
        value = data.draw(
            st.one_of(
                _SCALARS,
                st.lists(_SCALARS, max_size=3),
                st.dictionaries(st.sampled_from(_words()), _SCALARS, max_size=3),
                st.sampled_from(SPOTS).map(lambda other: _at(WHOLE, other)),
            )
        )
        what = data.draw(st.sampled_from(['put', 'remove', 'add']))
        key = data.draw(st.sampled_from(_words()))

        def change(
            found: Any, last: Any, what: str = what, value: Any = value, key: str = key
        ) -> None:
            if what == 'remove':
                del found[last]
            elif what == 'add' and isinstance(found[last], dict):
                found[last][key] = value
            else:
                found[last] = value

        _changed(change, spot, document)
    path = tmp_path_factory.mktemp('fuzz') / 'fuzzed.vfd.yaml'
    path.write_text(yaml.safe_dump(document, allow_unicode=True), encoding='utf-8')
    try:
        family = load_family(str(path))
    except DescriptionError as error:
        place = re.compile(r'fuzzed\.vfd\.yaml(, line \d+)?: \S')
        assert all(place.search(problem) for problem in error.problems)
    else:
        assert family.profile.methods


def _at(document: Any, spot: tuple[Any, ...]) -> Any:
    for key in spot:
        document = document[key]
    return document


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet='ab:{}[]-&*!|>\n \t"\'%@#0x1.', max_size=80))
def test_any_text_is_refused_with_a_sentence(
    tmp_path_factory: pytest.TempPathFactory, text: str
) -> None:
    path = tmp_path_factory.mktemp('text') / 'text.vfd.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(DescriptionError):
        read(path)
