# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Checks nodes by the JSON schema that editors use, too: ``vfd.schema.json`` beside this file.

It knows what that schema uses: ``type``, ``properties``, ``patternProperties``,
``additionalProperties``, ``required``, ``enum``, ``minimum``, ``maximum``, ``exclusiveMinimum``,
``items``, ``minItems``, ``maxItems``, ``pattern`` and ``$ref``.
"""

from __future__ import annotations

from collections.abc import Mapping
import difflib
from fractions import Fraction
import functools
import json
from pathlib import Path
import re
from typing import Any

from nfo_sinus_driver.catalog.declared.yaml_file import Node, Problems

#: The schema of a description.
PATH = Path(__file__).parent / 'vfd.schema.json'
#: So many characters of a text are shown, for what is wrong may be of any length.
_SHOWN = 60
#: So like one another are two words of which one is a slip of the other.
_NEAR = 0.75
_KINDS = {
    'object': 'a mapping (key: value)',
    'array': 'a list',
    'string': 'a text',
    'integer': 'a whole number',
    'number': 'a number',
    'boolean': 'true or false',
}


@functools.cache
def schema() -> Mapping[str, Any]:
    """Return the schema."""
    found: Mapping[str, Any] = json.loads(PATH.read_text(encoding='utf-8'))
    return found


def check(root: Node, problems: Problems) -> None:
    """Check a file as a whole."""
    _Checker(problems).check(root, schema(), 'the file')


def check_parameters(node: Node, problems: Problems) -> None:
    """Check the parameters of a file that stand in another one."""
    _Checker(problems).check(node, schema()['properties']['parameters'], 'the parameters')


class _Checker:
    """Checks one file."""

    def __init__(self, problems: Problems) -> None:
        self._problems = problems

    def check(self, node: Node, rule: Mapping[str, Any], where: str) -> None:
        """Check a node and all below it."""
        while '$ref' in rule:
            rule = schema()['$defs'][rule['$ref'].rpartition('/')[2]]
        if not self._has_kind(node, rule, where):
            return
        if node.json_type == 'object':
            self._check_object(node, rule, where)
        elif node.json_type == 'array':
            self._check_array(node, rule, where)
        else:
            self._check_scalar(node, rule, where)

    def _has_kind(self, node: Node, rule: Mapping[str, Any], where: str) -> bool:
        wanted = rule.get('type', list(_KINDS))
        kinds = [wanted] if isinstance(wanted, str) else wanted
        if node.json_type in kinds or (node.json_type == 'integer' and 'number' in kinds):
            return True
        said = ' or '.join(_KINDS[kind] for kind in kinds)
        self._problems.add(node.line, f'{where} has to be {said}')
        return False

    def _check_object(self, node: Node, rule: Mapping[str, Any], where: str) -> None:
        known, patterns = rule.get('properties', {}), rule.get('patternProperties', {})
        for key, value in node.mapping.items():
            found = known.get(key)
            for pattern, other in patterns.items():
                if found is None and re.search(pattern, key):
                    found = other
            if found is not None:
                self.check(value, found, f'{key!r} of {where}')
            else:
                self._problems.add(value.line, _unknown(key, where, known, rule))
        for key in rule.get('required', ()):
            if key not in node:
                what = known.get(key, {}).get('description', '')
                hint = f': {what}' if what else ''
                self._problems.add(node.line, f'{where} needs {key!r}{hint}')

    def _check_array(self, node: Node, rule: Mapping[str, Any], where: str) -> None:
        count, least, most = len(node.items), rule.get('minItems', 0), rule.get('maxItems')
        if count < least or (most is not None and count > most):
            others = '' if least == most else ' or more' if most is None else f' to {most}'
            self._problems.add(
                node.line, f'{where} has {count} entries: it needs {least}{others}'
            )
        for number, item in enumerate(node.items, 1):
            self.check(item, rule.get('items', {}), f'entry {number} of {where}')

    def _check_scalar(self, node: Node, rule: Mapping[str, Any], where: str) -> None:
        value = node.scalar
        if 'enum' in rule and value not in rule['enum']:
            allowed = ', '.join(map(str, rule['enum']))
            given = str(value)[:_SHOWN]
            self._problems.add(node.line, f'{where} is {given}: choose one of {allowed}')
        elif isinstance(value, str):
            pattern = rule.get('pattern', '')
            if pattern and not re.search(pattern, value):
                hint = rule.get('description', f'it has to match {pattern}')
                said = f'{where} cannot be {value[:_SHOWN]!r}: {hint}'
                self._problems.add(node.line, said)
        elif isinstance(value, (int, Fraction)) and not isinstance(value, bool):
            self._check_number(node, value, rule, where)

    def _check_number(
        self, node: Node, value: int | Fraction, rule: Mapping[str, Any], where: str
    ) -> None:
        low, high = rule.get('minimum'), rule.get('maximum')
        above = rule.get('exclusiveMinimum')
        if above is not None and not value > above:
            self._problems.add(node.line, f'{where} has to be more than {above}')
        elif low is not None and value < low:
            self._problems.add(node.line, f'{where} has to be {low} at least')
        elif high is not None and value > high:
            self._problems.add(node.line, f'{where} has to be {high} at most')


def _unknown(
    key: str, where: str, known: Mapping[str, Any], rule: Mapping[str, Any]
) -> str:
    """Return what to say of a key that is none."""
    near = difflib.get_close_matches(key, known, 1, _NEAR)
    if near:
        return f'{key!r} is no key of {where}: {near[0]!r} may be meant'
    if known:
        return f'{key!r} is no key of {where}: it has {", ".join(known)}'
    hint = rule.get('description', 'see docs/your_own_drive.md')
    return f'{key!r} cannot be a key of {where}: {hint}'
