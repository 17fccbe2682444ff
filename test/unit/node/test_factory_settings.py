# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What line and address a described drive leaves the factory with is taken where none is given."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
from support.described import SHIPPED

from nfo_sinus_driver.link import PROTOCOLS
from nfo_sinus_driver.node.parameters.factory_settings import line_of, with_factory_address
from nfo_sinus_driver.setting import Setting

NAMES = ('protocol', 'baud_rate', 'char_format')
ADDRESS = {'address': Setting(1, 'the address', name='address')}


@pytest.fixture
def over_tcp(tmp_path: Path) -> str:
    """A drive that has Modbus TCP alone, and says no speed."""
    path = tmp_path / 'tcp.vfd.yaml'
    text = SHIPPED['siemens_v20'].read_text(encoding='utf-8')
    begin, end = text.index('line:\n'), text.index('  numbering:')
    line = f'line:\n  protocol: modbus_tcp\n{text[end:]}'
    path.write_text(text[:begin] + line, encoding='utf-8')
    return str(path)


@pytest.mark.parametrize(
    ('families', 'given', 'line'),
    [
        ({'a': 'yaskawa_v1000'}, {}, ('modbus_rtu', 9600, '8N1')),
        # 0 and '' are the factory setting, as in the parameter files that come with the driver
        (
            {'a': 'yaskawa_v1000'},
            {'protocol': 'modbus_rtu', 'baud_rate': 0, 'char_format': ''},
            ('modbus_rtu', 9600, '8N1'),
        ),
        ({'a': 'yaskawa_v1000'}, {'baud_rate': 1200}, ('modbus_rtu', 1200, '8N1')),
        ({'a': 'siemens_v20', 'b': 'siemens_v20'}, {}, ('modbus_rtu', 9600, '8E1')),
        # its speed is none of another protocol
        ({'a': 'yaskawa_v1000'}, {'protocol': 'modbus_ascii'}, ('modbus_ascii', 19200, '7E1')),
        ({'a': 'invertek_optidrive_e3'}, {'protocol': 'modbus_tcp'}, ('modbus_tcp', 19200, '8E1')),
        # beside a drive that leaves the factory alike
        ({'a': 'schneider_atv12', 'b': None}, {}, ('modbus_rtu', 19200, '8E1')),
        (
            {'a': 'siemens_v20', 'b': 'yaskawa_v1000'},
            {'char_format': '8N2'},
            ('modbus_rtu', 9600, '8N2'),
        ),
    ],
)
def test_what_is_not_given_is_that_of_the_file(
    families: Mapping[str, object], given: Mapping[str, object], line: tuple[object, ...]
) -> None:
    found = line_of(families, given)
    assert tuple(found[name] for name in NAMES) == line
    protocol = PROTOCOLS[found['protocol']]
    protocol.require_baud_rate(found['baud_rate'])
    protocol.require_char_format(found['char_format'])


def test_a_drive_of_another_protocol_says_it(over_tcp: str) -> None:
    assert line_of({'a': over_tcp}, {})['protocol'] == 'modbus_tcp'


def test_without_a_family_the_protocol_says_it() -> None:
    assert line_of({'a': None, 'b': ''}, {'baud_rate': 1200}) == {}


def test_drives_that_differ_are_refused_with_what_to_do(over_tcp: str) -> None:
    for families, said in (
        ({'a': 'siemens_v20', 'b': 'yaskawa_v1000'}, r'char_format: .* \(8E1 of a, 8N1 of b\)'),
        ({'a': 'siemens_v20', 'b': None}, r'baud_rate: .* \(9600 of a, 19200 of b\)'),
        ({'a': over_tcp, 'b': None}, r'protocol: .* \(modbus_tcp of a, modbus_rtu of b\)'),
    ):
        with pytest.raises(ValueError, match=rf'{said}: set them alike, and say .* nfo_sinus_bus'):
            line_of(families, {})


def test_what_is_no_family_is_refused_by_the_name_of_its_drive() -> None:
    with pytest.raises(ValueError, match="left: there is no family 'nowhere': choose one of"):
        line_of({'left': 'nowhere'}, {})
    # the drive node says what is wrong with what is no text
    assert line_of({'left': 5}, {})['baud_rate'] == 19200


def test_the_address_is_that_of_the_file() -> None:
    assert with_factory_address(ADDRESS, 'yaskawa_v1000')['address'].default == 31
    assert with_factory_address(ADDRESS, None) == ADDRESS
    # it has none from the factory
    assert with_factory_address(ADDRESS, 'abb_acs355') == ADDRESS
