# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The Structured Text of IEC 61131-3 in which the program of a PLC is shipped, run as Python.

It knows what that program uses: structures of words, function blocks, assignments, IF, calls of
the timer TON, AND, OR, NOT, comparisons, sums, and some functions of the standard. Each structure
and function block becomes a class, with the names of its variables as Python writes them:
``RosLife`` is ``ros_life``. Numbers do not wrap.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import re
import struct
from typing import Any, ClassVar

_WORD = re.compile(r'T#\w+|16#\w+|\w+|:=|<>|<=|>=|\.\.|\S')
#: Those that bind least go first.
_OPERATORS = (
    {'OR': '|'},
    {'AND': '&'},
    {'=': '==', '<>': '!='},
    {'<': '<', '>': '>', '<=': '<=', '>=': '>='},
    {'+': '+', '-': '-'},
)
_SECONDS = {'s': 1, 'ms': 1000}
#: How a register holds a type.
_REGISTER = {'WORD': 'H', 'UINT': 'H', 'INT': 'h'}
_BEGINNINGS = {'BOOL': 'False', 'TON': 'Ton(clock)'} | dict.fromkeys(
    (*_REGISTER, 'BYTE', 'TIME'), '0'
)
_FUNCTIONS: dict[str, Callable[..., int]] = {
    'NOT': lambda operand: not operand if isinstance(operand, bool) else operand ^ 0xFFFF,
    'SHL': lambda word, by: word << by & 0xFFFF,
    'SHR': lambda word, by: word >> by,
    'WORD_TO_BYTE': lambda word: word & 0xFF,
    'BYTE_TO_WORD': lambda byte: byte,
    'UINT_TO_BYTE': lambda number: number & 0xFF,
    'BYTE_TO_UINT': lambda byte: byte,
}


class Structure:
    """Variables of a program in holding registers, one after the other."""

    _layout: ClassVar[struct.Struct]
    _names: ClassVar[tuple[str, ...]]

    def registers(self) -> tuple[int, ...]:
        """Return what stands in the registers."""
        data = self._layout.pack(*(getattr(self, name) for name in self._names))
        return struct.unpack(f'>{len(data) // 2}H', data)

    def put(self, offset: int, words: tuple[int, ...]) -> None:
        """Set registers from ``offset`` on, as a Modbus master does."""
        registers = list(self.registers())
        registers[offset : offset + len(words)] = words
        data = struct.pack(f'>{len(registers)}H', *registers)
        for name, value in zip(self._names, self._layout.unpack(data), strict=True):
            setattr(self, name, value)


class Ton:
    """
    The timer TON of IEC 61131-3: ``q`` once its input has been true for the preset time.

    :param clock: returns the time (s).
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._since: float | None = None
        self.q = False

    def __call__(self, input_: bool, preset: float) -> None:
        """Take the input, with the preset time (s)."""
        now = self._clock()
        if not input_:
            self._since = None
        elif self._since is None:
            self._since = now
        # a clock that counts fractions is never exactly at the preset
        self.q = self._since is not None and now - self._since >= preset - 1e-9


def load(text: str, name: str) -> dict[str, Any]:
    """
    Return the classes of the structures and function blocks of a text, by their names.

    A structure is made of nothing; a function block of a clock, which returns the time (s). Inputs
    are set, then it is called, which runs it once.

    :param name: of the text, for messages.
    :raises ValueError: something in it is not known here; with its line.
    """
    found = globals() | _FUNCTIONS
    exec('\n'.join(_Text(text, name).classes()), found)
    return found


def _snake(name: str) -> str:
    return re.sub(r'(?<=[a-z0-9])(?=[A-Z])', '_', name).lower()


class _Text:
    """A text, read from its beginning to its end, as lines of Python."""

    def __init__(self, text: str, name: str) -> None:
        comments = re.compile(r'\(\*.*?\*\)', re.DOTALL)
        lines = comments.sub(lambda comment: '\n' * comment[0].count('\n'), text).split('\n')
        self._name = name
        self._words: list[tuple[str, int]] = [
            (word, at) for at, line in enumerate(lines, 1) for word in _WORD.findall(line)
        ]
        self._words.append(('', len(lines)))
        self._at = 0
        self._beginnings = dict(_BEGINNINGS)
        self._variables: set[str] = set()

    def classes(self) -> Iterator[str]:
        """Return the lines of all classes."""
        while self._next:
            if self._skip('TYPE'):
                yield from self._structure(self._take())
            else:
                self._expect('FUNCTION_BLOCK')
                yield from self._function_block(self._take())

    def _structure(self, name: str) -> Iterator[str]:
        self._expect(':', 'STRUCT')
        self._beginnings[name] = f'{name}()'
        yield f'class {name}(Structure):'
        yield ' def __init__(self):'
        layout, members = '', []
        while not self._skip('END_STRUCT'):
            member, type_, length, beginning = self._declaration()
            layout += f'{2 * length}x' if length else _REGISTER[type_]
            # an array is there for its place alone
            if not length:
                members.append(member)
                yield f'  self.{member} = {beginning}'
        yield f' _layout, _names = struct.Struct(">{layout}"), {tuple(members)}'
        self._expect(';', 'END_TYPE')

    def _function_block(self, name: str) -> Iterator[str]:
        yield f'class {name}:'
        yield ' def __init__(self, clock):'
        self._variables.clear()
        while self._next in ('VAR_INPUT', 'VAR_IN_OUT', 'VAR_OUTPUT', 'VAR'):
            self._take()
            while not self._skip('END_VAR'):
                variable, _, _, beginning = self._declaration()
                self._variables.add(variable)
                yield f'  self.{variable} = {beginning}'
        yield ' def __call__(v):'
        yield from self._statements(' ')
        self._expect('END_FUNCTION_BLOCK')

    def _declaration(self) -> tuple[str, str, int, str]:
        """Return name, type, how long an array is (0: it is none), and beginning of a variable."""
        name, length = _snake(self._take()), 0
        self._expect(':')
        if self._skip('ARRAY'):
            self._expect('[')
            first = int(self._take())
            self._expect('..')
            length = int(self._take()) + 1 - first
            self._expect(']', 'OF')
        type_ = self._take()
        if type_ not in self._beginnings:
            raise self._unknown(type_)
        beginning = self._operand() if self._skip(':=') else self._beginnings[type_]
        self._expect(';')
        return name, type_, length, f'[{beginning}] * {length}' if length else beginning

    def _statements(self, indent: str) -> Iterator[str]:
        """Return statements as far as one that ends what they stand in."""
        indent += ' '
        yield f'{indent}pass'
        while self._next not in ('ELSIF', 'ELSE', 'END_IF', 'END_FUNCTION_BLOCK'):
            if self._skip('IF'):
                yield from self._condition('if', indent)
                while self._skip('ELSIF'):
                    yield from self._condition('elif', indent)
                if self._skip('ELSE'):
                    yield f'{indent}else:'
                    yield from self._statements(indent)
                self._expect('END_IF', ';')
                continue
            target = self._variable(self._take())
            if self._skip('('):
                self._expect('IN', ':=')
                input_ = self._expression()
                self._expect(',', 'PT', ':=')
                yield f'{indent}{target}({input_}, {self._expression()})'
                self._expect(')', ';')
            else:
                self._expect(':=')
                yield f'{indent}{target} = {self._expression()}'
                self._expect(';')

    def _condition(self, word: str, indent: str) -> Iterator[str]:
        yield f'{indent}{word} {self._expression()}:'
        self._expect('THEN')
        yield from self._statements(indent)

    def _expression(self, level: int = 0) -> str:
        if level == len(_OPERATORS):
            return self._operand()
        found = self._expression(level + 1)
        while operator := _OPERATORS[level].get(self._next):
            self._take()
            found = f'({found} {operator} {self._expression(level + 1)})'
        return found

    def _operand(self) -> str:
        word = self._take()
        if number := re.fullmatch(r'(?:16#([0-9A-F]+)|(\d+))', word):
            return str(int(number[1], 16) if number[1] else int(number[2]))
        if time := re.fullmatch(r'T#(\d+)(ms|s)', word):
            return f'{time[1]} / {_SECONDS[time[2]]}'
        if word in ('TRUE', 'FALSE'):
            return word.capitalize()
        if word == '(':
            found = self._expression()
            self._expect(')')
            return found
        if word == 'NOT':
            return f'NOT({self._operand()})'
        if word not in _FUNCTIONS:
            return self._variable(word)
        self._expect('(')
        given = [self._expression()]
        while self._skip(','):
            given.append(self._expression())
        self._expect(')')
        return f'{word}({", ".join(given)})'

    def _variable(self, word: str) -> str:
        """Return a variable of the function block, or what is in it."""
        if _snake(word) not in self._variables:
            raise self._unknown(word)
        found = f'v.{_snake(word)}'
        if self._skip('.'):
            return f'{found}.{_snake(self._take())}'
        if self._skip('['):
            found = f'{found}[{self._expression()}]'
            self._expect(']')
        return found

    @property
    def _next(self) -> str:
        word, _ = self._words[self._at]
        return word

    def _take(self) -> str:
        word = self._next
        self._at += 1
        return word

    def _skip(self, word: str) -> bool:
        """Return whether this word comes next, which is then behind."""
        found = self._next == word
        self._at += found
        return found

    def _expect(self, *words: str) -> None:
        for expected in words:
            word = self._take()
            if word != expected:
                raise self._unknown(word)

    def _unknown(self, word: str) -> ValueError:
        """Return an error with the line of the word that was taken last."""
        line = self._words[self._at - 1][1]
        return ValueError(f'{self._name}, line {line}: {word} is not known here')
