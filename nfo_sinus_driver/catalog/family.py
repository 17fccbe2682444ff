# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A drive family: its parameters, status codes and profile, read from its folder in ``families/``.

No module imports such a folder: its name is all that is known of it, and :func:`load_family`
reads it.
More folders are found where the search path of that package, its ``__path__``, leads.
"""

from __future__ import annotations

from collections.abc import Collection, ItemsView, Iterator, Mapping, Sequence, ValuesView
from dataclasses import dataclass, replace
from fractions import Fraction
import functools
import importlib
import math
from pathlib import Path

from nfo_sinus_driver.catalog import table
from nfo_sinus_driver.catalog.codec import BitField, Number, codec_of
from nfo_sinus_driver.catalog.error_log import ErrorLogArea
from nfo_sinus_driver.catalog.own_parameters import own_parameter
from nfo_sinus_driver.catalog.parameter import Access, Address, Parameter, Value
from nfo_sinus_driver.catalog.profile import Profile, SetpointTarget
from nfo_sinus_driver.catalog.status import MOTOR_PLATE, SPEED, Kind, Meaning, Role, StatusCode

_FAMILIES = 'nfo_sinus_driver.families'
#: Roles of what is read beside the polls, and in no hurry: such parameters may take their time, as
#: those do that a PLC asks the drive for.
_UNHURRIED = frozenset(
    (
        Role.FIRMWARE,
        Role.MOTOR_FIRMWARE,
        Role.CONTROL_MODE,
        Role.ACTUAL_SPEED,
        Role.ACTUAL_TORQUE,
        Role.OUTPUT_VOLTAGE,
        Role.OUTPUT_CURRENT,
        Role.OUTPUT_POWER,
        Role.POWER_FACTOR,
        Role.DC_LINK_VOLTAGE,
        Role.MOTOR_TEMPERATURE,
        Role.PT1000_TEMPERATURE,
        Role.OPERATING_TIME,
        Role.RUNNING_TIME,
        Role.BRAKE_TIME,
        Role.ENERGY,
        Role.TOTAL_ENERGY,
        Role.BUS_ADDRESS,
        *MOTOR_PLATE,
    )
)
#: The message InvSt has one byte for a status code.
_HIGHEST_CODE = 0xFF
#: What the name of a file ends with that describes a family.
DESCRIBED = '.vfd.yaml'
#: Wider ones have no place in a message.
_WIDEST_WORD = 0xFFFFFFFF
#: A motor may be overhauled by so much, as a share of the greatest set-point.
_BEYOND_SETPOINTS = 1.1
#: What multiplies set-points or measured values, beside what the tables name as a scale: speeds of
#: a shaft are frequencies by the pole pairs, or by what is nominal.
_SCALING = (
    Role.SPEED_SCALE_NUMERATOR,
    Role.SPEED_SCALE_DENOMINATOR,
    Role.POLE_PAIRS,
    Role.NOMINAL_FREQUENCY,
    Role.NOMINAL_SPEED,
)
#: What a parameter of the line is for a drive, whatever its group.
_OF_LINE = (Role.BUS_PROTOCOL, Role.BUS_ADDRESS, Role.BAUD_RATE, Role.CHARACTER_FORMAT)


@dataclass(frozen=True)
class Family(Mapping[str, Parameter]):
    """
    A drive family: its parameters by key, and what it says of itself.

    :ivar name: the name of its folder.
    :ivar parameters: its parameters, in the order of the manual.
    :ivar roles: which of them has which role.
    :ivar status_codes: its inverter status codes, by number.
    :ivar error_logs: where its error log stands, by protocol; empty where no manual says.
    :ivar profile: how it is commanded, and what is to be known of it beside its tables.
    :ivar unlisted: what any other status code means; ``None``: nothing is known of it.
    :ivar unused: what stands in the file of a described drive without any effect.
    """

    name: str
    parameters: Mapping[str, Parameter]
    roles: Mapping[Role, str]
    status_codes: Mapping[int, StatusCode]
    error_logs: Mapping[str, ErrorLogArea]
    profile: Profile
    unlisted: StatusCode | None = None
    unused: Sequence[str] = ()

    def __getitem__(self, key: str) -> Parameter:
        return self.parameters[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.parameters)

    def __len__(self) -> int:
        return len(self.parameters)

    def items(self) -> ItemsView[str, Parameter]:
        """Return keys and parameters; a Mapping would look each up."""
        return self.parameters.items()

    def values(self) -> ValuesView[Parameter]:
        """Return the parameters, likewise."""
        return self.parameters.values()

    # one is loaded once: it is equal to none but itself
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @property
    def settings(self) -> tuple[Parameter, ...]:
        """The parameters that can be set, in the order of the manual."""
        return tuple(parameter for parameter in self.values() if parameter.is_setting)

    @property
    def kept(self) -> tuple[Parameter, ...]:
        """The parameters that become ROS parameters: the settings, and what is only read."""
        return tuple(parameter for parameter in self.values() if parameter.is_kept)

    @property
    def measured(self) -> tuple[Parameter, ...]:
        """The measured values, by whose names the topic ``~/measured`` has them."""
        return tuple(parameter for parameter in self.values() if parameter.is_measured)

    def key(self, role: Role) -> str:
        """Return the key of the parameter that has a role; ``''`` if this family has none."""
        return self.roles.get(role, '')

    @property
    def key_of_status(self) -> str:
        """The parameter that every drive of it has: the status code, or the word that has it."""
        return self.key(Role.STATUS_CODE) or self.key(Role.STATUS_WORD)

    @functools.cached_property
    def role_of(self) -> Mapping[str, Role]:
        """The roles of the parameters that have one, by key."""
        return {key: role for role, key in self.roles.items()}

    def spelled(self, key: str, value: Value) -> str:
        """
        Return what a tool shows beside the value of a parameter; ``''``: nothing.

        As the display of the drive has it; or, where its bits mean something each, which are set.
        """
        spell = self.profile.spelled.get(key)
        if spell is not None:
            return spell(int(value))
        by_bits = key in self.profile.bit_fields or self.role_of.get(key) is Role.STATUS_WORD
        if not by_bits or not isinstance(value, int):
            return ''
        sizes = sorted(8 * address.codec.size for address in self[key].addresses.values())
        # another bus may have it in more bits
        size = next((width for width in sizes if abs(value) < 2**width), sizes[-1])
        word = value % 2**size
        bits = [str(bit) for bit in range(size) if word >> bit & 1]
        named = f': bit{"s" * (len(bits) > 1)} {", ".join(bits)}' if bits else ''
        return f'{word:0{size // 4}X}h{named}'

    def status_code(self, code: int) -> StatusCode:
        """Return what an inverter status code means; an unknown code is shown as its number."""
        found = self.status_codes.get(code)
        if found is not None:
            return found
        if self.unlisted is not None:
            return replace(self.unlisted, code=code, text=f'{self.unlisted.text} {code}')
        unlisted = 'Status code that the manual does not list'
        return StatusCode(code, f'Code {code}', description=unlisted)

    def codes(self, meaning: Meaning) -> tuple[StatusCode, ...]:
        """Return the inverter status codes that mean something."""
        return tuple(code for code in self.status_codes.values() if meaning in code.meanings)

    def group_of(self, role: Role) -> frozenset[str]:
        """Return the keys of the group that the parameter with a role is in, if there is one."""
        key = self.key(role)
        group = self[key].group if key else ''
        return frozenset(member for member, parameter in self.items() if parameter.group == group)

    @functools.cached_property
    def communication(self) -> frozenset[str]:
        """The keys of the settings of the line, by which the drive may be lost."""
        of_line = {self.key(role) for role in _OF_LINE if role in self.roles}
        return self.group_of(Role.BUS_ADDRESS) | of_line

    def needs_standstill(self, key: str) -> bool:
        """
        Return whether a setting is written only while the motor stands.

        By the manual, or because the drive may be lost by it: its motor could not be stopped then.
        The drive's own time-out is a setting of its line by which none is lost.
        """
        drive_timeout = key == self.key(Role.COMMUNICATION_TIMEOUT)
        drive_timeout = drive_timeout or key in self.profile.timeout_conditions
        return self[key].stopped or (key in self.communication and not drive_timeout)

    @functools.cached_property
    def scaling(self) -> frozenset[str]:
        """The keys of the parameters that set-points or measured values are multiplied by."""
        named = {parameter.scale for parameter in self.values() if parameter.scale in self}
        return frozenset(named | {self.key(role) for role in _SCALING if role in self.roles})

    def can_be(self, key: str, value: Value) -> bool:
        """Return whether a drive can have a value, by its manual: else the value was spoiled."""
        parameter, role = self[key], self.role_of.get(key)
        if role is Role.STATUS_CODE:
            return value in self.status_codes
        if role is Role.CONTROL_SOURCE:
            return value in self.profile.holders
        if role is Role.STATUS_WORD:
            word, status_word = int(value), self.profile.status_word
            listed = status_word.code is None or status_word.code(word) in self.status_codes
            return listed and status_word.may_say(word)
        if isinstance(value, str):
            return not parameter.labels or value in parameter.labels.values()
        if math.isnan(value):
            # the drive reports that there is none
            return True
        low, high = parameter.minimum, parameter.maximum
        most = math.inf if role is None else self.profile.most.get(role, math.inf)
        in_range = (low is None or value >= float(low)) and (high is None or value <= float(high))
        return abs(value) <= most and in_range


def folders() -> Mapping[str, Path]:
    """Return the folders that families have, by their names."""
    roots = [Path(root) for root in importlib.import_module(_FAMILIES).__path__]
    found = [path.parent for root in roots for path in root.glob('*/parameters.csv')]
    return {folder.name: folder for folder in sorted(found)}


def families() -> tuple[str, ...]:
    """Return the names of the families that there are folders of."""
    return tuple(sorted(folders()))


def is_family(name: str) -> bool:
    """Return whether a name is that of a folder, or the path of a file that describes a drive."""
    return is_described(name) or name in folders()


def is_described(name: str) -> bool:
    """Return whether a family is one that a file describes: its name is the path of the file."""
    return name.endswith(DESCRIBED)


def usual_family() -> str:
    """Return the name of the family of a drive whose model is not given."""
    return str(importlib.import_module(_FAMILIES).USUAL)


def _has_profile(name: str, method: str) -> bool:
    """Return whether a control method has a profile of its own."""
    folder = folders().get(name)
    return bool(method) and folder is not None and (folder / method / 'profile.py').exists()


def _place(name: str, method: str) -> tuple[str, Path]:
    """Return package and folder of a family, or those that a control method of it has."""
    folder = folders()[name]
    package = f'{_FAMILIES}.{name}'
    if _has_profile(name, method):
        return f'{package}.{method}', folder / method
    return package, folder


def example_setting() -> tuple[str, float]:
    """Return the key of a setting of that family, and a value, for help and documentation."""
    key, value = importlib.import_module(_FAMILIES).EXAMPLE
    return str(key), float(value)


@functools.cache
def load_profile(name: str, method: str = '') -> Profile:
    """
    Load the profile of one drive family, without its tables.

    :param method: a control method; one that speaks to the drive in another way than all others
        has a profile of its own in a folder of its name, and tables, or only roles.

    :raises ValueError: there is no such family; the message lists those there are.
    :raises CatalogError: its folder is no package.
    """
    if is_described(name):
        return _described(name).profile
    if name not in folders():
        raise ValueError(f'unknown model {name!r}: choose one of {", ".join(families())}')
    package, folder = _place(name, method)
    if not (folder / '__init__.py').exists():
        raise table.CatalogError(f'{name}: no __init__.py, without which it would not be installed')
    profile = importlib.import_module(f'{package}.profile').PROFILE
    assert isinstance(profile, Profile)
    return profile


def load_family(
    name: str,
    method: str = '',
    words: str = '',
    nominal_speed: float = 0.0,
    own: tuple[str, ...] = (),
) -> Family:
    """
    Read and check the tables of one drive family.

    :param method: as for :func:`load_profile`.
    :param words: which of the ``words`` of its profile a PLC maps; ``''``: the first.
    :param nominal_speed: of a motor in Speed mode, rpm, where the profile has a ``speed_mode``; 0:
        it is in another one.
    :param own: parameters that a user names, where the profile has ``own_addresses``.
    :raises ValueError: there is no such family; the message lists those there are. Or one of the
        user's parameters cannot be.
    :raises CatalogError: a table contradicts itself, or another one.
    """
    # the same tables for all the methods that share them
    family = _read_family(name, method if _has_profile(name, method) else '')
    family = _speaking(family, words, method)
    family = _with_own(family, own) if own else family
    return _in_speed_mode(family, nominal_speed) if nominal_speed else family


@functools.cache
def _with_own(family: Family, texts: tuple[str, ...]) -> Family:
    """Return a family with the parameters that a user names, too."""
    places = family.profile.own_addresses
    if places is None:
        raise ValueError(f'no manual says how a {family.name} is reached by addresses')
    addressing = next(iter(family.profile.methods.values())).addressing
    parameters = dict(family.parameters)
    for text in texts:
        own = own_parameter(text, addressing, places)
        if own.key in parameters:
            raise ValueError(f'{text!r}: there is a {own.key} already')
        parameters[own.key] = own
    return replace(family, parameters=parameters)


@functools.cache
def _speaking(family: Family, words: str, method: str) -> Family:
    profile = family.profile.words[words] if words else family.profile
    seen = profile.seen_by(method)
    return family if seen is family.profile else replace(family, profile=seen)


@functools.cache
def _in_speed_mode(family: Family, nominal_speed: float) -> Family:
    """Return a family whose drives report and take speeds where others do frequencies."""
    profile = family.profile
    mode = profile.speed_mode
    assert mode is not None
    count, most = mode.count(Fraction(str(nominal_speed))), mode.most(nominal_speed)
    speeds = {key: family[key].in_rpm(count) for key in mode.keys}
    role_of = {Role.ACTUAL_FREQUENCY: Role.ACTUAL_SPEED}
    target = SetpointTarget(mode.keys[-1], most, nominal=float(nominal_speed))
    return replace(
        family,
        parameters={**family.parameters, **speeds},
        roles={role_of.get(role, role): key for role, key in family.roles.items()},
        profile=replace(
            profile,
            setpoints={SPEED.mode: target},
            # as much above as of frequencies
            most={Role.ACTUAL_SPEED: most * _BEYOND_SETPOINTS},
        ),
    )


@functools.cache
def load_parameter(name: str, role: Role) -> Parameter | None:
    """
    Read the parameter of a drive family that has a role, and no other: all tables take memory.

    :return: ``None`` if none has that role.
    :raises ValueError: there is no such family; the message lists those there are.
    :raises CatalogError: what is said of this parameter contradicts itself.
    """
    if is_described(name):
        family = _described(name)
        return family.get(family.key(role))
    load_profile(name)
    _, folder = _place(name, '')
    keys = _keys(folder)
    key = _roles(folder, keys).get(role)
    return _parameters(folder, keys, key)[key] if key else None


@functools.cache
def _described(path: str) -> Family:
    """Read the family that a file describes; its parser is loaded for such a file alone."""
    declared = importlib.import_module('nfo_sinus_driver.catalog.declared')
    drive = declared.read(Path(path))
    profile = importlib.import_module(f'{_FAMILIES}._declared.profile').profile_of(drive)
    codes = declared.status_codes(drive)
    unlisted = codes[declared.Code.FAULT]
    # its number is its name
    unlisted = replace(unlisted, meanings=unlisted.meanings - {Meaning.UNNAMED})
    return Family(
        drive.name, drive.parameters, drive.roles, codes, {}, profile, unlisted, drive.unused
    )


@functools.cache
def _read_family(name: str, method: str = '') -> Family:
    if is_described(name):
        return _described(name)
    profile = load_profile(name, method)
    _, folder = _place(name, method)
    if method and not (folder / 'parameters.csv').exists():
        shared = _read_family(name, '')
        own = {**shared.roles, **_roles(folder, shared.parameters)}
        _require_fitting(folder, profile, shared.parameters, own)
        return replace(shared, roles=own, profile=profile)
    keys = _keys(folder)
    parameters = _parameters(folder, keys)
    roles = _roles(folder, keys)
    _require_fitting(folder, profile, keys, roles)
    codes = table.read(folder / 'status_codes.csv', _status_code, lambda row: [f'code {row.code}'])

    def area(row: table.Row) -> ErrorLogArea:
        found = _area(row)
        for entry in range(found.limit):
            for _, key in found.readings_of(entry):
                _known(key, keys)
        return found

    log = folder / 'error_log.csv'
    logs = table.read(log, area, lambda row: [row.protocol]) if log.exists() else []
    family = Family(
        name=name,
        parameters=parameters,
        roles=roles,
        status_codes={row.code: row for row in codes},
        error_logs={row.protocol: row for row in logs},
        profile=profile,
    )
    return _with_mailbox(family, _read_family(name), method) if profile.mailbox else family


def _with_mailbox(own: Family, whole: Family, method: str) -> Family:
    """
    Return the family of a telegram with what the mailbox of the PLC reaches of the whole one.

    That is settings, what is only read, and what begins a procedure: no other commands, whose words
    are those of the telegram.
    """
    profile = own.profile
    begins = {
        write.key for control in profile.methods.values() for write in control.procedures.values()
    }
    protocol, addressing = profile.mailbox, profile.methods[method].addressing

    def placed(parameter: Parameter) -> Parameter:
        address = replace(parameter.at(protocol), protocol=addressing)
        return replace(parameter, addresses={**parameter.addresses, addressing: address})

    reached = {
        key: placed(parameter)
        for key, parameter in whole.items()
        if protocol in parameter.addresses
        and (parameter.is_setting or parameter.access is Access.READ or key in begins)
    }
    roles = {role: key for role, key in whole.roles.items() if key in reached}
    named = {Role.FAULT_CODE: roles[Role.STATUS_CODE]} if Role.STATUS_CODE in roles else {}
    unhurried = {role: key for role, key in roles.items() if role in _UNHURRIED}
    log = whole.error_logs.get(protocol)
    return replace(
        own,
        parameters={**reached, **own},
        roles={**unhurried, **named, **own.roles},
        status_codes={**whole.status_codes, **own.status_codes},
        error_logs={addressing: replace(log, protocol=addressing)} if log else {},
    )


def _keys(folder: Path) -> Collection[str]:
    rows = table.read(folder / 'parameters.csv', lambda row: row['parameter'], lambda key: [key])
    return dict.fromkeys(rows)


def _known(key: str, keys: Collection[str]) -> str:
    if key not in keys:
        raise ValueError(f'no parameter is {key}')
    return key


def _parameters(folder: Path, keys: Collection[str], only: str = '') -> Mapping[str, Parameter]:
    """Read the parameters of a folder, or only one of them."""
    addresses: dict[str, dict[str, Address]] = {key: {} for key in keys}

    def address(row: table.Row) -> tuple[str, Address]:
        return _known(row['parameter'], keys), _address(row)

    def parameter(row: table.Row) -> Parameter:
        return _parameter(row, addresses[row['parameter']])

    for key, found in table.read(folder / 'addresses.csv', address, _what_it_takes, only):
        addresses[key][found.protocol] = found
    rows = table.read(folder / 'parameters.csv', parameter, lambda row: [row.key], only)
    return {row.key: row for row in rows}


def _roles(folder: Path, keys: Collection[str]) -> Mapping[Role, str]:
    def role(row: table.Row) -> tuple[Role, str]:
        return Role(row['role']), _known(row['parameter'], keys)

    return dict(table.read(folder / 'roles.csv', role, lambda row: [row[0].value, row[1]]))


def _require_fitting(
    folder: Path, profile: Profile, keys: Collection[str], roles: Mapping[Role, str]
) -> None:
    for needed in _needed_roles(profile):
        if needed not in roles:
            raise table.CatalogError(f'{folder / "roles.csv"}: no parameter is the {needed.value}')
    for wrong in _wrong_in(profile, keys):
        raise table.CatalogError(f'{folder / "profile.py"}: {wrong}')


def _wrong_in(profile: Profile, keys: Collection[str]) -> Iterator[str]:
    if not 0 <= profile.status_word.shown <= _WIDEST_WORD:
        yield 'shown is wider than a status word, 32 bits'
    for key in (profile.identified_by, *(target.key for target in profile.setpoints.values())):
        if key and key not in keys:
            yield f'no parameter is {key}'


def _needed_roles(profile: Profile) -> Iterator[Role]:
    yield Role.STATUS_CODE if profile.status_word.code is None else Role.STATUS_WORD
    if profile.status_word.by_frequency:
        yield Role.ACTUAL_FREQUENCY


def _address(row: table.Row) -> Address:
    return Address(
        protocol=row['protocol'],
        space=row['space'],
        index=int(row['index'], 0),
        sub_index=table.number(row['sub_index']),
        codec=codec_of(row['codec']),
        factor=table.ratio(row['factor']),
        source=row['source'],
    )


def _what_it_takes(row: tuple[str, Address]) -> Iterator[str]:
    key, address = row
    yield f'{key} on {address.protocol}'
    # some bits of a number may have a name of their own beside it
    bits = address.codec.name if isinstance(address.codec, BitField) else ''
    for numbers in address.occupied:
        shown = '.'.join(f'{number:04X}h' for number in numbers)
        yield f'{address.protocol} {address.space} {shown} {bits}'.rstrip()


def _parameter(row: table.Row, addresses: Mapping[str, Address]) -> Parameter:
    if not addresses:
        raise ValueError('no address on any bus')
    minimum = table.fraction(row['minimum'])
    maximum = table.fraction(row['maximum'])
    if minimum is not None and maximum is not None and minimum >= maximum:
        raise ValueError('the minimum is not below the maximum')
    pairs = [pair.split('=', 1) for pair in row['labels'].split('|') if pair]
    labels = {int(code, 0): label for code, label in pairs}
    if len(labels) != len(pairs) or len(set(labels.values())) != len(pairs):
        raise ValueError('a code or a label stands twice')
    steps = tuple(_steps(row.get('steps', ''), minimum))
    counts = [number for pair in steps for number in pair] + [Fraction(code) for code in labels]
    for address in addresses.values():
        if any((number / address.factor).denominator != 1 for number in counts):
            raise ValueError(f'not all steps are counts on {address.protocol}')
    return Parameter(
        key=row['parameter'],
        name=row['name'],
        group=row['group'],
        addresses=addresses,
        scale=row['scale'],
        unit=row['unit'],
        minimum=minimum,
        maximum=maximum,
        steps=steps,
        decimals=int(row['decimals']),
        labels=labels,
        access=Access(row['access']),
        stopped={'init': True, 'run': False, '': False}[row['when']],
        since=table.fraction(row['since']),
        older={'yes': True, '': False}[row['older']],
        option=row.get('option', ''),
        description=row['description'],
        source=row['source'],
    )


def _steps(text: str, minimum: Fraction | None) -> Iterator[tuple[Fraction, Fraction]]:
    """Return what ``0.05|10:0.5`` says: by 0.05 from the minimum, by 0.5 from 10 on."""
    start = minimum
    for part in text.split('|') if text else ():
        *begins, step = part.split(':')
        if begins:
            start = Fraction(begins[0])
        if start is None:
            raise ValueError('steps begin at the minimum, and there is none')
        yield start, Fraction(step)


def _status_code(row: table.Row) -> StatusCode:
    code = int(row['code'])
    if not 0 <= code <= _HIGHEST_CODE:
        raise ValueError(f'code {code} is out of range, 0 to {_HIGHEST_CODE}')
    return StatusCode(
        code=code,
        text=row['text'],
        old_text=row['old_text'] or row['text'],
        renamed=table.fraction(row['renamed']),
        kind=Kind(row['kind']),
        requires_ack={'yes': True, 'no': False}[row['requires_ack']],
        meanings=frozenset(map(Meaning, row['meanings'].split())),
        description=row['description'],
        remedy=row['remedy'],
    )


def _readings(text: str) -> Iterator[tuple[str, str]]:
    for pair in text.split('|') if text else ():
        what, key = pair.split('=')
        yield what, key


def _area(row: table.Row) -> ErrorLogArea:
    codec = codec_of(row['codec'])
    if not isinstance(codec, Number):
        raise ValueError(f'an entry is no {codec.name}')
    return ErrorLogArea(
        protocol=row['protocol'],
        space=row['space'],
        first=int(row['index'], 0),
        stride=int(row['stride']),
        entries=int(row['entries']),
        limit=int(row['limit']),
        codec=codec,
        factor=Fraction(row.get('factor') or 1),
        above=table.number(row.get('above', '')),
        readings=tuple(_readings(row.get('readings', ''))),
        elsewhere=table.number(row.get('elsewhere', '')),
        sub_stride=table.number(row.get('sub_stride', '')),
    )
