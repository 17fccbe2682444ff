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

"""A drive family: its parameter table and its status codes, read from the data files beside it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import csv
from fractions import Fraction
import functools
from pathlib import Path
from typing import TypeVar

from nfo_sinus_driver.catalog.dialect import DIALECTS
from nfo_sinus_driver.catalog.inv_st import InvStCode
from nfo_sinus_driver.catalog.inv_st import Kind
from nfo_sinus_driver.catalog.parameter import Access
from nfo_sinus_driver.catalog.parameter import Parameter
from nfo_sinus_driver.catalog.parameter import Place
from nfo_sinus_driver.catalog.parameter import Protocol
from nfo_sinus_driver.catalog.parameter import RawType

#: The models that there are tables of.
MODELS = ('sinus_g2', 'sinus_optimal')

_TABLES = Path(__file__).parent
#: Firmware 4.28 renamed Sio Stby and its like [C3].
_RENAMED = Fraction('4.28')


class CatalogError(Exception):
    """A table contradicts itself; the message names the file and the line."""


class Model(Mapping[str, Parameter]):
    """
    A drive family: its parameters by key, and its inverter status codes.

    :ivar name: one of ``MODELS``.
    :ivar dialect: what its control and status words and its status codes mean.
    """

    def __init__(self, name: str, parameters: list[Parameter], inv_st: list[InvStCode]) -> None:
        self.name = name
        self.dialect = DIALECTS[name]
        self._parameters = {parameter.key: parameter for parameter in parameters}
        self._inv_st = {code.code: code for code in inv_st}

    def __getitem__(self, key: str) -> Parameter:
        return self._parameters[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self._parameters)

    def __len__(self) -> int:
        return len(self._parameters)

    @property
    def settings(self) -> tuple[Parameter, ...]:
        """The parameters that become ROS parameters, in the order of the manual."""
        return tuple(parameter for parameter in self.values() if parameter.is_setting)

    @property
    def inv_st_codes(self) -> Collection[int]:
        """The inverter status codes that the manual lists."""
        return self._inv_st.keys()

    def inv_st(self, code: int) -> InvStCode:
        """Return what an inverter status code means; an unknown code is shown as its number."""
        try:
            return self._inv_st[code]
        except KeyError:
            text = f'Code {code}'
            missing = 'Status code that the manual does not list'
            return InvStCode(code, text, text, Kind.STATUS, False, missing, '')

    def inv_st_text(self, code: int, firmware: Fraction | None = None) -> str:
        """Return the text on the drive's display; it changed with firmware 4.28 [C3]."""
        entry = self.inv_st(code)
        old = firmware is not None and firmware < _RENAMED
        return entry.old_text if old else entry.text


@functools.cache
def load_model(name: str) -> Model:
    """
    Read and check the tables of one drive family.

    :raises ValueError: there is no such model; the message lists those there are.
    :raises CatalogError: a table contradicts itself.
    """
    if name not in MODELS:
        raise ValueError(f'unknown model {name!r}: choose one of {", ".join(MODELS)}')
    parameters = _read(f'{name}.csv', _parameter)
    inv_st = _read(f'inv_st_{name}.csv', _inv_st_code)
    _check_unique(f'{name}.csv', 'key', [parameter.key for parameter in parameters])
    for protocol in Protocol:
        places = [p.places[protocol] for p in parameters if protocol in p.places]
        used = [address for place in places for address in place.occupied]
        _check_unique(f'{name}.csv', protocol.value, used)
    _check_unique(f'inv_st_{name}.csv', 'code', [entry.code for entry in inv_st])
    return Model(name, parameters, inv_st)


_T = TypeVar('_T')


def _read(file: str, parse: Callable[[dict[str, str]], _T]) -> list[_T]:
    rows = []
    with (_TABLES / file).open(encoding='utf-8', newline='') as stream:
        for number, row in enumerate(csv.DictReader(stream, strict=True), start=2):
            try:
                if None in row or None in row.values():
                    raise ValueError('too many or too few columns')
                rows.append(parse(row))
            except (KeyError, ValueError, ZeroDivisionError) as error:
                raise CatalogError(f'{file}, line {number}: {error}') from error
    return rows


def _parameter(row: dict[str, str]) -> Parameter:
    places = {}
    classic = tuple(int(id_.removeprefix('E'), 16) for id_ in row['classic'].split('+') if id_)
    if classic:
        type_ = RawType[row['classic_type']]
        if len(classic) != type_.words:
            raise ValueError(f'{type_.name} takes {type_.words} Classic ids, not {len(classic)}')
        places[Protocol.CLASSIC] = Place(classic, type_, _fraction(row['classic_factor']))
    if row['modbus']:
        modbus = (int(row['modbus'], 16),)
        type_ = RawType[row['modbus_type']]
        places[Protocol.MODBUS] = Place(modbus, type_, _fraction(row['modbus_factor']))
    if not places:
        raise ValueError('no address on any bus')
    if any((place.factor is None) != bool(row['scale']) for place in places.values()):
        raise ValueError('a parameter has either a factor or a scale, on every bus')
    minimum = _fraction(row['minimum'])
    maximum = _fraction(row['maximum'])
    if minimum is not None and maximum is not None and minimum >= maximum:
        raise ValueError('the minimum is not below the maximum')
    pairs = [pair.split('=', 1) for pair in row['labels'].split('|') if pair]
    labels = {int(code, 0): label for code, label in pairs}
    if len(labels) != len(pairs) or len(set(labels.values())) != len(pairs):
        raise ValueError('a code or a label stands twice')
    return Parameter(
        key=row['key'],
        name=row['name'],
        group=row['group'],
        places=places,
        scale=row['scale'],
        unit=row['unit'],
        minimum=minimum,
        maximum=maximum,
        decimals=int(row['decimals']),
        labels=labels,
        access=Access(row['access']),
        stopped={'init': True, 'run': False, '': False}[row['when']],
        since=_fraction(row['since']),
        description=row['description'],
        source=row['source'],
        pnu=int(row['pnu']) if row['pnu'] else None,
        canopen=int(row['canopen'], 16) if row['canopen'] else None,
    )


def _inv_st_code(row: dict[str, str]) -> InvStCode:
    return InvStCode(
        code=int(row['code']),
        text=row['text'],
        old_text=row['text_before_4_28'] or row['text'],
        kind=Kind(row['kind']),
        requires_ack={'yes': True, 'no': False}[row['requires_ack']],
        description=row['description'],
        remedy=row['remedy'],
    )


def _fraction(text: str) -> Fraction | None:
    return Fraction(text) if text else None


def _check_unique(file: str, what: str, values: Sequence[object]) -> None:
    for value, times in Counter(values).items():
        if times > 1:
            shown = f'{value:04X}' if isinstance(value, int) else value
            raise CatalogError(f'{file}: {what} {shown} stands {times} times')
