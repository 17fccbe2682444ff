# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What each protocol can do, and how its lines leave the factory, without what speaks it."""

from __future__ import annotations

from collections.abc import Mapping

from nfo_sinus_driver.link.interface import LineProtocol

#: The addresses of drives on Modbus [M0 §6.2.2].
_MODBUS_UNITS = range(1, 248)
#: Classic: the address at which a drive answers whatever its own is, if it is alone on the line.
POINT_TO_POINT = 0
#: Classic: the address that all drives obey and none answers.
BROADCAST = 95

MODBUS_RTU = LineProtocol(
    name='modbus_rtu',
    link='rtu.RtuLink',
    addressing='modbus',
    units=_MODBUS_UNITS,
    baud_rate=19200,
    char_format='8E1',
    char_formats=('8E1', '8O1', '8N2', '8N1', '8E2', '8O2'),
    identifies=True,
    writes_and_reads=True,
)
MODBUS_ASCII = LineProtocol(
    name='modbus_ascii',
    link='modbus_ascii.AsciiLink',
    addressing='modbus',
    units=_MODBUS_UNITS,
    baud_rate=19200,
    char_format='7E1',
    char_formats=('7E1', '7O1', '7N2', '7N1', '7E2', '7O2'),
    identifies=True,
    writes_and_reads=True,
)
MODBUS_TCP = LineProtocol(
    name='modbus_tcp',
    link='modbus_tcp.TcpLink',
    addressing='modbus',
    units=_MODBUS_UNITS,
    # the line behind a gateway is set in the gateway
    baud_rate=19200,
    char_format='8E1',
    identifies=True,
    writes_and_reads=True,
    most_requests=50.0,
    carries=frozenset(('telegram1',)),
)
CLASSIC = LineProtocol(
    name='classic',
    link='classic.ClassicLink',
    addressing='classic',
    units=range(POINT_TO_POINT, BROADCAST),
    baud_rate=9600,
    char_format='7E1',
    char_formats=('7E1', '7O1', '7N2', '8E1', '8O1', '8N2', '8N1'),
    broadcast=BROADCAST,
    point_to_point=POINT_TO_POINT,
)
MOVITRAC = LineProtocol(
    name='movitrac',
    link='movitrac.MovitracLink',
    addressing='movitrac',
    # P842 [M4 §2.3.1]
    units=range(64),
    baud_rate=9600,
    char_format='8N1',
    baud_rates=(9600,),
    char_formats=('8N1',),
    check='power, the interface (USS 11A or UST 11A on X4, or terminals 67/68 of the option '
    'on X20), master-slave operation off (P880 = No), the address (P842), A and B of the '
    'wires, 9600 bit/s 8N1 in a device server',
)
CANOPEN = LineProtocol(
    name='canopen',
    link='canopen_link.CanopenLink',
    addressing='canopen',
    units=range(1, 128),
    baud_rate=125_000,
    char_format='8N1',
    baud_rates=(10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000),
    identifies=True,
    rates_disturb=True,
    check='power, the node id, the bit rate, CAN_H and CAN_L, 120 ohms at each end of the bus '
    'and nowhere else, and that the interface is up (ip -details link show)',
)

#: What the driver's ``protocol`` parameter takes, and what each is.
PROTOCOLS: Mapping[str, LineProtocol] = {
    protocol.name: protocol
    for protocol in (MODBUS_RTU, MODBUS_ASCII, MODBUS_TCP, CLASSIC, MOVITRAC, CANOPEN)
}
#: The bit rates of all of them.
BIT_RATES = tuple(sorted({rate for each in PROTOCOLS.values() for rate in each.baud_rates}))
#: Which addresses a drive may have, for the reader.
ADDRESSES = '; '.join(
    dict.fromkeys(
        f'{one.addressing} {one.units[0]} to {one.units[-1]}'
        + f' ({one.point_to_point}: alone on its line)' * (one.point_to_point is not None)
        for one in PROTOCOLS.values()
    )
)
