# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a description says without any effect: no mistake, but perhaps not what was meant."""

from __future__ import annotations

from collections.abc import Iterator

from nfo_sinus_driver.catalog.declared.yaml_file import Node, Problems

#: What says how the numbers of registers are read; a coil has one bit.
_OF_REGISTERS = ('type', 'order', 'bits', 'table')


def unused(root: Node, problems: Problems) -> tuple[str, ...]:
    """Return a sentence with file and line for each key that has no effect."""
    found = Problems(problems.path)
    for key, node, why in (*_of_commands(root), *_of_status(root), *_of_line(root)):
        _add(found, key, node, why)
    for key, node in root.get('measured').mapping.items():
        _check_place(found, key, node)
    parameters = root.get('parameters')
    with found.of(parameters.path):
        for key, node in parameters.mapping.items():
            _check_place(found, key, node)
            _check_parameter(found, key, node)
    return tuple(found.found)


def _add(found: Problems, key: str, node: Node, why: str) -> None:
    if key in node:
        found.add(node[key].line, f'{key} has no effect: {why}')


def _of_commands(root: Node) -> Iterator[tuple[str, Node, str]]:
    control = root['control']
    if 'coast' in control:
        yield 'quick_stop', control, 'coast is what a quick stop does'
    for name in ('prepare', 'run'):
        for step in control.get(name).items:
            yield 'within', step, f'{name} waits for a status for 2 s'
    shown = any(key in root['status'] for key in ('remote', 'local'))
    if not (shown or 'holder' in control):
        yield 'stop_disturbs_local', control, 'nothing tells who has control'
    if not root.get('parameters').mapping:
        yield 'after_write', root, 'there are no parameters'


def _of_status(root: Node) -> Iterator[tuple[str, Node, str]]:
    status, faults = root['status'], root.get('faults')
    if 'coil' in status['running']:
        for key in ('block', 'table', 'register'):
            yield key, status, 'the status stands in coils'
    if 'alarm' not in status:
        yield 'alarms', root, 'no condition of status is an alarm'
    if 'register' not in faults:
        for key in ('bits', 'none', 'table'):
            yield key, faults, 'faults has no register'


def _of_line(root: Node) -> Iterator[tuple[str, Node, str]]:
    line = root.get('line')
    if line.text('protocol') == 'modbus_tcp':
        for key in ('baud_rate', 'char_format'):
            yield key, line, 'Modbus TCP has none'


def _check_place(found: Problems, key: str, node: Node) -> None:
    if 'coil' in node:
        for what in _OF_REGISTERS:
            _add(found, what, node, f'{key} is a coil')


def _check_parameter(found: Problems, key: str, node: Node) -> None:
    if node.text('access') == 'r' and not node.flag('while_running', True):
        _add(found, 'while_running', node, f'{key} is only read')
    if 'choices' in node:
        for what in ('minimum', 'maximum'):
            _add(found, what, node, f'{key} has choices')
