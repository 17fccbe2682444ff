# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The function block of config/telegram1/ as it is shipped, run in time that passes when it is given.

Structured Text (IEC 61131-3) becomes Python word by word, as far as this file goes: it has
assignments, IF, calls of timers, AND, OR, NOT and comparisons. No line is understood but those.
"""

from functools import cache
from pathlib import Path
import re
from types import SimpleNamespace

from nfo_sinus_driver.simulator.plc_program import Ton

SHIPPED = Path(__file__).parents[3] / 'config' / 'telegram1' / 'ros_telegram1.st'
_WORDS = {
    ':=': '=', '=': '==', '<>': '!=', 'AND': '&', 'OR': '|', 'NOT': '~', 'TRUE': 'Bool(1)',
    'FALSE': 'Bool(0)',
}
_SECONDS = {'s': 1, 'ms': 1000}


def snake(name):
    """Return a name of Structured Text as Python writes it."""
    return re.sub(r'(?<=[a-z0-9])(?=[A-Z])', '_', name).lower()


class Bool(int):
    """A truth, whose NOT is one, too; words have another."""

    def __invert__(self):
        return Bool(not self)

    def __and__(self, other):
        return Bool(int(self) & int(other))

    def __or__(self, other):
        return Bool(int(self) | int(other))


def _text():
    return re.sub(r'\(\*.*?\*\)', '', SHIPPED.read_text(), flags=re.DOTALL)


@cache
def declared():
    """Return name, type and beginning of the variables of each section, the structure's too."""
    found = {}
    for kind, body in re.findall(r'^ *(VAR\w*|STRUCT)$(.*?)END_', _text(), re.DOTALL | re.M):
        lines = re.findall(r'(\w+)\s*:\s*([^;:]+?)\s*(?::=\s*([^;]+))?;', body)
        found[kind] = [(snake(name), type_, value) for name, type_, value in lines]
    return found


def _literal(text):
    if time := re.fullmatch(r'T#(\d+)(ms|s)', text):
        return int(time[1]) / _SECONDS[time[2]]
    return int(text.removeprefix('16#'), 16 if text.startswith('16#') else 10)


def _expression(text):
    text = re.sub(r'16#(\w+)', r'0x\1', text)
    text = re.sub(r'<>|:=|=|\b(?:AND|OR|NOT|TRUE|FALSE)\b', lambda one: _WORDS[one[0]], text)
    return re.sub(
        r'\b[A-Z]\w*(?:\.\w+)*',
        lambda one: one[0] if one[0] == 'Bool' else 'v.' + '.'.join(map(snake, one[0].split('.'))),
        text,
    )


@cache
def _python():
    body = re.search(r'END_VAR\s+((?:(?!VAR).)*)END_FUNCTION_BLOCK', _text(), re.DOTALL)[1]
    lines, depth = [], 0
    for one in filter(None, map(str.strip, body.splitlines())):
        if match := re.fullmatch(r'(IF|ELSIF) (.*) THEN', one):
            depth -= match[1] == 'ELSIF'
            line = f'{"if" if match[1] == "IF" else "elif"} {_expression(match[2])}:'
        elif one == 'ELSE':
            depth -= 1
            line = 'else:'
        elif one == 'END_IF;':
            depth -= 1
            continue
        elif match := re.fullmatch(r'(\w+)\(IN := (.*), PT := (\w+)\);', one):
            line = f'v.{snake(match[1])}(bool({_expression(match[2])}), v.{snake(match[3])})'
        else:
            target, value = re.fullmatch(r'([\w.]+) := (.*);', one).groups()
            line = f'{_expression(target)} = {_expression(value)}'
        lines.append('    ' * depth + line)
        depth += line.endswith(':')
    return compile('\n'.join(lines), str(SHIPPED), 'exec')


class StRosTelegram1:
    """The function block, with the inputs and outputs of the program in Python."""

    def __init__(self, clock, **inputs):
        self._code = _python()
        self.v = SimpleNamespace()
        for section in ('VAR_INPUT', 'VAR_OUTPUT', 'VAR'):
            for name, type_, value in declared()[section]:
                usual = _literal(value) if value else Bool(0) if type_ == 'BOOL' else 0
                setattr(self.v, name, _Timer(clock) if type_ == 'TON' else usual)
        vars(self.v).update(inputs)

    def __call__(self, block, zsw1, actual, exchanged, release):
        given = {'exchanged': Bool(exchanged), 'release': Bool(release)}
        vars(self.v).update(block=block, zsw1=zsw1, actual=actual, **given)
        exec(self._code, {'v': self.v, 'Bool': Bool, 'bool': bool})
        block.stw1 &= 0xFFFF

    def __getattr__(self, name):
        return getattr(self.v, name)


class _Timer(Ton):
    """A timer whose output is a truth of Structured Text."""

    def __call__(self, input_, preset):
        super().__call__(input_, preset)
        self.q = Bool(self.q)
