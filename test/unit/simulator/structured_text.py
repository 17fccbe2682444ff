# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The function blocks of config/telegram1/ as they are shipped, run in time that passes when given.

Structured Text (IEC 61131-3) becomes Python word by word, as far as these files go: they have
assignments, IF, calls of timers, AND, OR, NOT, comparisons, arrays and conversions of words and
bytes. No line is understood but those.
"""

from functools import cache
from pathlib import Path
import re
from types import SimpleNamespace

from nfo_sinus_driver.simulator.plc_program import Ton

SHIPPED = Path(__file__).parents[3] / 'config' / 'telegram1'
_WORDS = {
    ':=': '=', '=': '==', '<>': '!=', 'AND': '&', 'OR': '|', 'NOT': '~', 'TRUE': 'Bool(1)',
    'FALSE': 'Bool(0)',
}
_SECONDS = {'s': 1, 'ms': 1000}
#: The functions of the standard that the programs call.
_FUNCTIONS = {
    'shl': lambda word, by: word << by & 0xFFFF,
    'shr': lambda word, by: word >> by,
    'word_to_byte': lambda word: word & 0xFF,
    'byte_to_word': lambda byte: byte,
    'uint_to_byte': lambda number: number & 0xFF,
    'byte_to_uint': lambda byte: byte,
}


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


@cache
def _text():
    text = ''.join((SHIPPED / name).read_text() for name in ('ros_telegram1.st', 'ros_mailbox.st'))
    return re.sub(r'\(\*.*?\*\)', '', text, flags=re.DOTALL)


def _lines(body):
    lines = re.findall(r'(\w+)\s*:\s*([^;:]+?)\s*(?::=\s*([^;]+))?;', body)
    return [(snake(name), type_, value) for name, type_, value in lines]


@cache
def structure(name):
    """Return name, type and beginning of the members of a structure."""
    return _lines(re.search(rf'{name} :\s+STRUCT$(.*?)END_', _text(), re.DOTALL | re.M)[1])


@cache
def _block(name):
    found = re.search(rf'FUNCTION_BLOCK {name}$(.*?)END_FUNCTION_BLOCK', _text(), re.DOTALL | re.M)
    return found[1]


@cache
def declared(name):
    """Return name, type and beginning of the variables of each section of a function block."""
    sections = re.findall(r'^ *(VAR\w*)$(.*?)END_VAR', _block(name), re.DOTALL | re.M)
    return {kind: _lines(body) for kind, body in sections}


def _literal(text):
    if time := re.fullmatch(r'T#(\d+)(ms|s)', text):
        return int(time[1]) / _SECONDS[time[2]]
    return int(text.removeprefix('16#'), 16 if text.startswith('16#') else 10)


def _expression(text):
    text = re.sub(r'16#(\w+)', r'0x\1', text)
    words = r'<>|>=|:=|=|\b(?:AND|OR|NOT|TRUE|FALSE)\b'
    text = re.sub(words, lambda one: _WORDS.get(one[0], one[0]), text)
    return re.sub(
        r'\b[A-Z]\w*(?:\.\w+)*',
        lambda one: one[0] if one[0] == 'Bool' else 'v.' + '.'.join(map(snake, one[0].split('.'))),
        text,
    )


@cache
def _python(name):
    body = re.search(r'END_VAR\s+((?:(?!VAR).)*)$', _block(name), re.DOTALL)[1]
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
            target, value = re.fullmatch(r'([\w.\[\]]+) := (.*);', one).groups()
            line = f'{_expression(target)} = {_expression(value)}'
        lines.append('    ' * depth + line)
        depth += line.endswith(':')
    return compile('\n'.join(lines), name, 'exec')


class FunctionBlock:
    """One function block; ``v`` has its variables, and those of the last call."""

    name: str

    def __init__(self, clock=None, **inputs):
        self.v = SimpleNamespace(**_FUNCTIONS)
        for section in ('VAR_INPUT', 'VAR_OUTPUT', 'VAR'):
            for name, type_, value in declared(self.name)[section]:
                setattr(self.v, name, _beginning(type_, value, clock))
        vars(self.v).update(inputs)

    def run(self, **given):
        """Call it once."""
        truths = {name: Bool(one) for name, one in given.items() if isinstance(one, bool)}
        vars(self.v).update(given | truths)
        exec(_python(self.name), {'v': self.v, 'Bool': Bool, 'bool': bool})

    def __getattr__(self, name):
        return getattr(self.v, name)


def _beginning(type_, value, clock):
    if type_ == 'TON':
        return _Timer(clock)
    if type_.startswith('ARRAY'):
        return [0] * 16
    return _literal(value) if value else Bool(0) if type_ == 'BOOL' else 0


class StRosTelegram1(FunctionBlock):
    """With the inputs and outputs of the program in Python; so are the others."""

    name = 'FB_RosTelegram1'

    def __call__(self, block, zsw1, actual, exchanged, release, more=None):
        words = dict(zip(('more1', 'more2', 'more3'), more or (0, 0, 0), strict=True))
        self.run(
            block=block, zsw1=zsw1, actual=actual, exchanged=exchanged, release=release,
            more_valid=more is not None, **words,
        )
        block.stw1 &= 0xFFFF


class StRosMailbox(FunctionBlock):
    name = 'FB_RosMailbox'

    def __call__(self, mailbox, access, done, result, high, low):
        self.run(
            mailbox=mailbox, access=access, done=bool(done), done_result=result, done_high=high,
            done_low=low,
        )


class StRosParameter(FunctionBlock):
    name = 'FB_RosParameter'

    def __call__(self, mailbox, written, write_failed, came, not_yet, read_failed, response):
        wanted = ('request', 'command', 'pnu', 'sub_index', 'value_high', 'value_low')
        self.run(
            **{name: getattr(mailbox, name) for name in wanted}, written=written,
            write_failed=write_failed, came=came, not_yet=not_yet, read_failed=read_failed,
            response=response,
        )


class _Timer(Ton):
    """A timer whose output is a truth of Structured Text."""

    def __call__(self, input_, preset):
        super().__call__(input_, preset)
        self.q = Bool(self.q)
