# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Structured Text (IEC 61131-3) as far as the function block of config/telegram1/ goes, and Python.

Both become the same plain tuples, so that one can be compared with the other statement by
statement.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from dataclasses import field
import re

_TOKEN = re.compile(
    r"""\s+ | \(\*.*?\*\) |
    (?P<number>T\#\w+|16\#[0-9A-Fa-f]+|\d+) |
    (?P<name>[A-Za-z_][\w.]*) |
    (?P<sign>:=|<>|=>|\.\.|[-+*/=<>();:,\[\]])""",
    re.VERBOSE | re.DOTALL,
)
#: What binds looser first; all that is compared or added binds tighter.
_LEVELS = (('OR',), ('AND',), ('=', '<>'), ('+', '-'))
_OPERATORS = {
    ast.BitOr: 'OR',
    ast.Or: 'OR',
    ast.BitAnd: 'AND',
    ast.And: 'AND',
    ast.Invert: 'NOT',
    ast.Not: 'NOT',
    ast.Eq: '=',
    ast.NotEq: '<>',
    ast.Add: '+',
    ast.Sub: '-',
}


def snake(name):
    """Return a name of Structured Text as Python writes it."""
    return re.sub(r'(?<=[a-z0-9])(?=[A-Z])', '_', name).lower()


def seconds(text):
    """Return what a literal such as T#500ms is (s)."""
    number, unit = re.fullmatch(r'T#(\d+)(ms|s)', text).groups()
    return int(number) / {'s': 1, 'ms': 1000}[unit]


@dataclass
class Variable:
    name: str
    type: str
    initial: object = None


@dataclass
class Unit:
    """A function block, program or structure: its variables by section, and its statements."""

    name: str
    variables: dict[str, list[Variable]] = field(default_factory=dict)
    body: list = field(default_factory=list)


class Parser:
    """Reads a file of Structured Text into its units, by name."""

    def __init__(self, text):
        self.tokens = []
        at = 0
        while at < len(text):
            match = _TOKEN.match(text, at)
            assert match, f'not understood: {text[at:at + 40]!r}'
            if match.lastgroup:
                self.tokens.append(match[match.lastgroup])
            at = match.end()
        self.at = 0

    @property
    def next(self):
        return self.tokens[self.at] if self.at < len(self.tokens) else ''

    def take(self, *expected):
        token = self.next
        assert not expected or token in expected, f'{token} in place of {expected}'
        self.at += 1
        return token

    def taken(self, token):
        if self.next == token:
            self.at += 1
            return True
        return False

    def units(self):
        found = {}
        while self.next:
            kind = self.take('TYPE', 'FUNCTION_BLOCK', 'PROGRAM')
            unit = Unit(self.take())
            if kind == 'TYPE':
                self.take(':')
                self.take('STRUCT')
                unit.variables['STRUCT'] = self.declarations('END_STRUCT')
                self.take(';')
            while self.next.startswith('VAR'):
                section = self.take()
                unit.variables[section] = self.declarations('END_VAR')
            unit.body = self.statements(f'END_{kind}')
            self.take(f'END_{kind}')
            found[unit.name] = unit
        return found

    def declarations(self, end):
        found = []
        while not self.taken(end):
            name = self.take()
            self.take(':')
            type_ = ''
            while self.next not in (':=', ';'):
                type_ += self.take()
            initial = self.expression() if self.taken(':=') else None
            self.take(';')
            found.append(Variable(name, type_, initial))
        return found

    def statements(self, *ends):
        found = []
        while self.next not in ends:
            if self.taken('IF'):
                found.append(self.branches())
            else:
                found.append(self.simple())
            self.take(';')
        return found

    def branches(self):
        condition = self.expression()
        self.take('THEN')
        body = self.statements('ELSIF', 'ELSE', 'END_IF')
        word = self.take()
        if word == 'ELSIF':
            return 'IF', condition, body, [self.branches()]
        other = []
        if word == 'ELSE':
            other = self.statements('END_IF')
            self.take('END_IF')
        return 'IF', condition, body, other

    def simple(self):
        name = self.take()
        if self.taken(':='):
            return 'SET', self.variable(name), self.expression()
        self.take('(')
        arguments = {}
        while not self.taken(')'):
            key = self.take()
            self.take(':=')
            arguments[key] = self.expression()
            self.taken(',')
        return 'CALL', self.variable(name), arguments

    def expression(self, level=0):
        if level == len(_LEVELS):
            return self.operand()
        left = self.expression(level + 1)
        while self.next in _LEVELS[level]:
            left = (self.take(), left, self.expression(level + 1))
        return left

    def operand(self):
        token = self.take()
        if token == '(':
            inside = self.expression()
            self.take(')')
            return inside
        if token == 'NOT':
            return 'NOT', self.operand()
        if token in ('TRUE', 'FALSE'):
            return token == 'TRUE'
        if token.startswith('T#'):
            return seconds(token)
        if token.startswith('16#'):
            return int(token[3:], 16)
        return int(token) if token.isdigit() else self.variable(token)

    @staticmethod
    def variable(name):
        return 'NAME', '.'.join(map(snake, name.split('.')))


def python_statements(nodes):
    """Return statements of Python as the same tuples; a docstring is none."""
    found = []
    for node in nodes:
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            continue
        if isinstance(node, ast.If):
            body, other = python_statements(node.body), python_statements(node.orelse)
            found.append(('IF', python_expression(node.test), body, other))
        elif isinstance(node, ast.Assign):
            (target,) = node.targets
            found.append(('SET', python_expression(target), python_expression(node.value)))
        else:
            assert isinstance(node, ast.Expr), ast.dump(node)
            assert isinstance(node.value, ast.Call), ast.dump(node)
            input_, preset = map(python_expression, node.value.args)
            called = python_expression(node.value.func)
            found.append(('CALL', called, {'IN': input_, 'PT': preset}))
    return found


def python_expression(node):
    if isinstance(node, ast.Constant):
        return node.value
    if isinstance(node, ast.Name):
        return 'NAME', node.id
    if isinstance(node, ast.Attribute):
        return 'NAME', ast.unparse(node).removeprefix('self.')
    if isinstance(node, ast.UnaryOp):
        return _OPERATORS[type(node.op)], python_expression(node.operand)
    if isinstance(node, ast.BinOp):
        left, right = python_expression(node.left), python_expression(node.right)
        return _OPERATORS[type(node.op)], left, right
    if isinstance(node, ast.BoolOp):
        left, right = map(python_expression, node.values)
        return _OPERATORS[type(node.op)], left, right
    assert isinstance(node, ast.Compare), ast.dump(node)
    (operator,), (right,) = node.ops, node.comparators
    return _OPERATORS[type(operator)], python_expression(node.left), python_expression(right)
