# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What each protocol is, by its name, and how its lines are set."""

from __future__ import annotations

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.catalog import families, load_family
from nfo_sinus_driver.link import PROTOCOLS, Address, BusSettings, LineProtocol, open_link
from nfo_sinus_driver.link.interface import BAUD_RATES, LineSettings

EVERY = pytest.mark.parametrize('protocol', PROTOCOLS.values(), ids=list(PROTOCOLS))
PORTS = {'modbus_tcp': 'gateway:502'}
#: What each protocol reaches, of every family.
ROWS = {
    protocol.name: [
        row
        for family in families()
        for row in load_family(family).values()
        if protocol.addressing in row.addresses
    ]
    for protocol in PROTOCOLS.values()
}


def open_with(protocol: str, char_format: str) -> None:
    """Make the link that speaks a protocol on a line that is set so."""
    line = BusSettings(protocol=protocol, char_format=char_format).line
    open_link(protocol, PORTS.get(protocol, '/dev/x'), line)


@EVERY
def test_a_link_says_what_it_speaks(protocol: LineProtocol) -> None:
    port = PORTS.get(protocol.name, '/dev/x')
    assert PROTOCOLS[protocol.name] is protocol
    assert BusSettings(port, protocol.name).open().protocol is protocol


@EVERY
def test_it_reaches_parameters_and_no_drive_by_its_broadcast(protocol: LineProtocol) -> None:
    assert ROWS[protocol.name]
    assert protocol.broadcast not in protocol.units
    assert protocol.point_to_point in (None, protocol.units[0])


@EVERY
def test_the_parts_of_every_parameter_are_the_whole_of_it(protocol: LineProtocol) -> None:
    for row in ROWS[protocol.name]:
        place = row.at(protocol.addressing)
        address = Address(*place.place)
        parts = protocol.parts(address)
        assert sum(part.size for part in parts) == address.size == place.codec.size
        assert all(protocol.parts(part) == (part,) for part in parts), 'each is one transaction'
        # all but Classic read what belongs together at once
        assert parts == (address,) or protocol.name == 'classic'


@EVERY
@given(st.integers(2, 32).map(lambda words: 2 * words))
def test_a_value_whose_first_register_is_apart_is_read_whole(
    protocol: LineProtocol, size: int
) -> None:
    address = Address('register', 7, 0x100, size)
    parts = protocol.parts(address)
    assert sum(part.size for part in parts) == size
    assert [part.index for part in parts] == ([7, 0x100] if protocol.has_parts else [7])


@given(st.sampled_from(list(PROTOCOLS.values())), st.integers(-1, 300))
def test_addresses(protocol: LineProtocol, address: int) -> None:
    ends = {'classic': (0, 94), 'movitrac': (0, 63), 'canopen': (1, 127), 'modbus_tcp': (0, 247)}
    lowest, highest = ends.get(protocol.name, (1, 247))
    beside = 255 if protocol.name == 'modbus_tcp' else None
    if lowest <= address <= highest or address == beside:
        protocol.require_unit(address)
    else:
        spans = f'{lowest} to {highest}' + f', {beside}' * (beside is not None)
        with pytest.raises(ValueError, match=f'^address {address}: .* has {spans}$'):
            protocol.require_unit(address)


FORMATS = st.builds(''.join, st.tuples(*map(st.sampled_from, ('78', 'EON', '12'))))


@given(st.sampled_from(['modbus_rtu', 'modbus_ascii']), FORMATS)
def test_a_modbus_frame_has_as_many_data_bits_as_its_protocol(protocol: str, format_: str) -> None:
    # RTU has eight, ASCII seven (MODBUS over Serial Line V1.02 §2.5)
    bits = '8' if protocol == 'modbus_rtu' else '7'
    if format_[0] == bits:
        open_with(protocol, format_)
    else:
        remedy = f'{protocol} has {bits} data bits, write {bits}{format_[1:]}'
        with pytest.raises(ValueError, match=f"^char_format '{format_}': {remedy}$"):
            open_with(protocol, format_)


@given(FORMATS)
def test_classic_has_the_formats_of_its_firmwares(format_: str) -> None:
    if format_ in ('7E1', '7O1', '7N2', '8E1', '8O1', '8N2', '8N1'):
        open_with('classic', format_)
    else:
        with pytest.raises(ValueError, match='classic has 7E1, 7O1, 7N2, 8E1, 8O1, 8N2, 8N1'):
            open_with('classic', format_)


@given(st.sampled_from(list(PROTOCOLS)), st.sampled_from((*BAUD_RATES, 125_000)))
def test_baud_rates(protocol: str, baud_rate: int) -> None:
    line = BusSettings(protocol=protocol, baud_rate=baud_rate).line
    if baud_rate in PROTOCOLS[protocol].baud_rates:
        open_link(protocol, PORTS.get(protocol, '/dev/x'), line)
    else:
        has = ', '.join(map(str, PROTOCOLS[protocol].baud_rates))
        with pytest.raises(ValueError, match=f'^baud_rate {baud_rate}: {protocol} has {has}$'):
            open_link(protocol, '/dev/x', line)


@pytest.mark.parametrize('protocol', ['classic', 'modbus_rtu', 'modbus_ascii'])
@pytest.mark.parametrize('baud_rate', [1200, 2400, 4800, 9600, 19200, 38400, 57600])
def test_a_serial_line_has_the_rates_that_the_manual_prints(protocol: str, baud_rate: int) -> None:
    # [M0 §6.1.2, §6.2.2]
    link = BusSettings('/dev/x', protocol, baud_rate=baud_rate).open()
    assert link.protocol.name == protocol


@pytest.mark.parametrize('port', ['/dev/ttyACM0', 'can0', 'socket://adapter:4001'])
def test_canopen_has_the_bit_rates_of_its_adapters(port: str) -> None:
    for bit_rate in (10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 1_000_000):
        BusSettings(port, 'canopen', baud_rate=bit_rate).open()
    assert BusSettings(protocol='canopen').line.baud_rate == 125_000


@given(FORMATS)
def test_the_line_of_a_gateway_is_the_gateways(format_: str) -> None:
    open_with('modbus_tcp', format_)


@pytest.mark.parametrize(
    ('protocol', 'baud_rate', 'char_format'),
    [
        ('modbus_rtu', 19200, '8E1'),
        ('modbus_ascii', 19200, '7E1'),
        ('classic', 9600, '7E1'),
        ('movitrac', 9600, '8N1'),
    ],
)
def test_factory_settings(protocol: str, baud_rate: int, char_format: str) -> None:
    # [M0 §6.2.2], [M0 §6.1.2], [C6], [M4 §2.3.3]
    line = BusSettings(protocol=protocol).line
    assert (line.baud_rate, line.char_format) == (baud_rate, char_format)
    open_link(protocol, '/dev/x', line)
    asked = BusSettings(protocol=protocol, baud_rate=9600, char_format=f'{char_format[0]}N2').line
    assert (asked.baud_rate, asked.char_format) == (9600, f'{char_format[0]}N2')
    with pytest.raises(ValueError, match='unknown protocol'):
        BusSettings(protocol='profibus').open()


def test_unknown_protocol() -> None:
    with pytest.raises(ValueError, match="unknown protocol 'profibus': choose one of modbus_rtu"):
        open_link('profibus', '/dev/null', LineSettings())


# --- settings -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('char_format', 'bits', 'parity', 'stop', 'char_bits'),
    [
        ('8E1', 8, 'E', 1, 11),
        ('8N2', 8, 'N', 2, 11),
        ('7O1', 7, 'O', 1, 10),
        ('8N1', 8, 'N', 1, 10),
    ],
)
def test_line_settings(
    char_format: str, bits: int, parity: str, stop: int, char_bits: int
) -> None:
    line = LineSettings(baud_rate=9600, char_format=char_format)
    assert (line.data_bits, line.parity, line.stop_bits) == (bits, parity, stop)
    assert line.char_time == pytest.approx(char_bits / 9600)


@pytest.mark.parametrize('baud', BAUD_RATES)
def test_silence_between_two_frames(baud: int) -> None:
    # [MODBUS over Serial Line V1.02, 2.5.1.1]: 3.5 characters of 11 bits, fixed above 19200
    gap = LineSettings(baud_rate=baud).frame_gap
    assert gap == pytest.approx(38.5 / baud if baud <= 19200 else 0.00175)


@pytest.mark.parametrize(
    ('setting', 'message'),
    [
        ({'baud_rate': 0}, 'baud_rate 0: it is more than 0'),
        ({'char_format': '8e1'}, 'write data bits, parity and stop bits'),
        ({'char_format': '9N1'}, 'such as 8E1'),
        ({'char_format': '8E1 '}, 'such as 8E1'),
        ({'response_timeout': 0.0}, '0.01 to 10 s'),
        ({'response_timeout': 10.1}, '0.01 to 10 s'),
        ({'response_timeout': float('nan')}, '0.01 to 10 s'),
    ],
)
def test_settings_that_no_drive_has(setting: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        LineSettings(**setting)  # type: ignore[arg-type]
