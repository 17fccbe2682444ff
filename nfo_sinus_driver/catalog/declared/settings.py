# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The parameters of a description, and the values that it gives to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from nfo_sinus_driver.catalog.declared.register_map import RegisterMap
from nfo_sinus_driver.catalog.declared.yaml_file import Node, Problems, number_of
from nfo_sinus_driver.catalog.parameter import NO_SETTINGS, Access, Parameter, Value
from nfo_sinus_driver.catalog.status import Role

#: Groups of what is no setting.
_TAKEN = frozenset(('line', 'measured', *(group.lower() for group in NO_SETTINGS)))


class Settings:
    """
    The parameters of one file.

    :ivar parameters: all, by key.
    :ivar roles: which of them has which role.
    :ivar defaults: with what value they leave the factory.
    """

    def __init__(self, root: Node, register_map: RegisterMap, problems: Problems) -> None:
        self._root = root
        self._map = register_map
        self._problems = problems
        self.parameters: dict[str, Parameter] = {}
        self.roles: dict[Role, str] = {}
        self.defaults: dict[str, Value] = {}
        parameters = root.get('parameters')
        with problems.of(parameters.path):
            for key, node in parameters.mapping.items():
                self._add(key, node)

    def _add(self, key: str, node: Node) -> None:
        if key.partition('.')[0] in _TAKEN:
            taken = ', '.join(sorted(_TAKEN))
            self._problems.add(node.line, f'{key}: the groups {taken} are taken: use another one')
            return
        access = Access(node.text('access', 'rw'))
        writable = access is not Access.READ
        address = self._map.address(node, key, writable=writable)
        parameter = self._parameter(key, node, access)
        self.parameters[key] = self.scaled(node, replace(parameter, addresses={'modbus': address}))
        self._check(key, node)
        self._take_role(key, node)
        default = node.get('default')
        if default.scalar is not None:
            value = self.value(key, default)
            if value is not None:
                self.defaults[key] = value

    def _parameter(self, key: str, node: Node, access: Access) -> Parameter:
        group, _, name = key.partition('.')
        factor = node.number('factor')
        decimals = len(str(float(factor)).partition('.')[2]) if factor and factor < 1 else 0
        return Parameter(
            key=key, name=node.text('name', name), group=group.replace('_', ' ').capitalize(),
            addresses={}, access=access, unit=node.text('unit'), minimum=node.number('minimum'),
            maximum=node.number('maximum'), decimals=decimals, labels=self._labels(key, node),
            stopped=not node.flag('while_running', True), description=node.text('description'),
            source=node.text('source'),
        )

    def _labels(self, key: str, node: Node) -> Mapping[int, str]:
        labels: dict[int, str] = {}
        for text, label in node.get('choices').mapping.items():
            try:
                code = number_of(text)
            except ValueError as error:
                self._problems.add(label.line, f'{key}: {error}')
                continue
            if str(label.scalar) in labels.values() or code in labels:
                self._problems.add(label.line, f'{key}: the choice {label.scalar} stands twice')
            labels[code] = str(label.scalar)
        return labels

    def _check(self, key: str, node: Node) -> None:
        made = self.parameters[key]
        codec, factor = made.at('modbus').number, made.factor('modbus')
        low, high = made.minimum, made.maximum
        if low is not None and high is not None and low >= high:
            self._problems.add(node.line, f'{key}: the minimum is not below the maximum')
        for what, end in (('minimum', low), ('maximum', high)):
            if end is not None and not made.scale and not (
                codec.minimum <= end / factor <= codec.maximum
            ):
                self._problems.add(
                    node[what].line, f'{key}: the {what} does not fit {codec.name} with this factor'
                )
        if made.labels and (factor != 1 or not all(map(codec.fits, made.labels))):
            self._problems.add(
                node['choices'].line, f'{key}: choices are numbers that the register carries'
            )

    def _take_role(self, key: str, node: Node) -> None:
        if 'role' not in node:
            return
        role = Role(node.text('role'))
        if role in self.roles:
            self._problems.add(
                node['role'].line, f'{key} and {self.roles[role]} have the same role'
            )
        self.roles[role] = key

    # --- what names a parameter ---

    def known(self, node: Node) -> str:
        """Return the key that a node names; ``''`` where there is none."""
        key = node.scalar
        if not isinstance(key, str):
            return ''
        if key not in self.parameters:
            self._problems.add(node.line, f'{key} is none of the parameters: add it there')
            return ''
        return key

    def value(self, key: str, node: Node) -> Value | None:
        """Return the value that a node gives to a parameter; ``None`` if it cannot have it."""
        found, parameter = node.scalar, self.parameters[key]
        value: Value = found if isinstance(found, (bool, int, str)) else float(found or 0)
        if parameter.kind is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value)
        if parameter.labels and isinstance(value, int) and not isinstance(value, bool):
            value = parameter.labels.get(value, value)
        if parameter.kind is bool and isinstance(value, str):
            value = {'ON': True, 'YES': True, 'OFF': False, 'NO': False}.get(value.upper(), value)
        try:
            parameter.encode(value)
        except ValueError as error:
            self._problems.add(node.line, str(error))
            return None
        return value

    def holder(self, node: Node) -> tuple[str, tuple[Value, ...]] | None:
        """Return the parameter that reports who has control, and its values for the line."""
        key = self.known(node.get('parameter'))
        if not key:
            return None
        if not self.parameters[key].labels:
            self._problems.add(node.line, f'{key} tells who has control: it needs choices')
        values = [self.value(key, item) for item in node.get('bus').items]
        return key, tuple(value for value in values if value is not None)

    def scaled(self, node: Node, parameter: Parameter) -> Parameter:
        """Return a parameter with the scale and the empty value that a node gives it."""
        none, scale = node.get('none').scalar, node.text('scaled_by')
        if scale and scale not in self._root.get('parameters'):
            self._problems.add(
                node['scaled_by'].line, f'{scale} is none of the parameters: add it there'
            )
        return replace(parameter, scale=scale, none=none if isinstance(none, int) else None)


def role_parameters(root: Node) -> Mapping[Role, str]:
    """Return the roles that other sections give to parameters."""
    roles: dict[Role, str] = {}
    holder = root['control'].get('holder')
    for role, node in (
        (Role.COMMUNICATION_TIMEOUT, root.get('timeout').get('parameter')),
        (Role.CONTROL_SOURCE, holder.get('parameter')),
        (Role.STOP_MODE, root['control'].get('stop_mode').get('parameter')),
    ):
        if isinstance(node.scalar, str):
            roles[role] = node.scalar
    return roles
