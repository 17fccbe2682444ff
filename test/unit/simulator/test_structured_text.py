# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Structured Text as a simulated PLC reads it."""

import re

import pytest

from nfo_sinus_driver.simulator.structured_text import load

_TEXT = """(* a comment
   of two lines *)
FUNCTION_BLOCK FB_One
VAR_INPUT
    Number : INT := 16#10;
    On : BOOL;
END_VAR
VAR
    Low : WORD;
END_VAR
{}
END_FUNCTION_BLOCK
"""


@pytest.mark.parametrize(
    ('statement', 'word'),
    [
        ('WHILE On DO Number := 1; END_WHILE;', 'WHILE'),
        ('Other := 1;', 'Other'),
        ('Number := Other;', 'Other'),
        ('Number := Number MOD 2;', 'MOD'),
        ('Number := ROL(Low, 2);', 'ROL'),
        ('Number := 1', 'END_FUNCTION_BLOCK'),
        ('Number + 1;', '+'),
        ('IF On Number := 1; END_IF;', 'Number'),
        ('END_IF;', 'END_IF'),
    ],
)
def test_what_is_not_known_is_refused_with_its_line(statement, word):
    line = 12 if word == 'END_FUNCTION_BLOCK' else 11
    said = re.escape(f'one.st, line {line}: {word} is not known here')
    with pytest.raises(ValueError, match=f'^{said}$'):
        load(_TEXT.format(statement), 'one.st')


def test_type_that_is_not_known_is_refused_with_its_line():
    with pytest.raises(ValueError, match=r'^one.st, line 9: LREAL is not known here'):
        load(_TEXT.format('Low := 1;').replace('WORD', 'LREAL'), 'one.st')


@pytest.mark.parametrize(
    ('expression', 'value'),
    [
        ('NOT Number = 2', False),
        ('1 = 2 OR 2 = 2 AND Number > 2', True),
        ('Number AND NOT 16#0010 OR 16#0001', 1),
        ('Number - 1 - 2', 13),
        ('SHL(16#01FF, 8)', 0xFF00),
        ('NOT (On OR FALSE)', True),
    ],
)
def test_operators_bind_as_the_standard_says(expression, value):
    program = load(_TEXT.format(f'Low := {expression};'), 'one.st')['FB_One'](None)
    program()
    assert program.low == value
