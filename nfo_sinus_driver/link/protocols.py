# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The link that speaks each protocol, loaded when it is opened: a driver speaks only one."""

from __future__ import annotations

import importlib
from typing import Protocol, cast

from nfo_sinus_driver.link.interface import LineProtocol, LineSettings, Link
from nfo_sinus_driver.link.line_protocols import PROTOCOLS


class _LinkClass(Protocol):
    """What makes a link of a kind."""

    def on_port(self, port: str, settings: LineSettings) -> Link:
        """Return the link on a port; it is not open yet."""


def link_class(protocol: LineProtocol) -> _LinkClass:
    """Return what makes links of a protocol."""
    module, name = protocol.link.split('.')
    return cast('_LinkClass', getattr(importlib.import_module(f'{__package__}.{module}'), name))


def protocol_of(name: str) -> LineProtocol:
    """
    Return a protocol.

    :raises ValueError: there is none of that name; the message says which there are.
    """
    if name not in PROTOCOLS:
        raise ValueError(f'unknown protocol {name!r}: choose one of {", ".join(PROTOCOLS)}')
    return PROTOCOLS[name]


def line_settings(
    protocol: str,
    *,
    baud_rate: int = 0,
    char_format: str = '',
    response_timeout: float = 0.2,
    rs485: bool = False,
) -> LineSettings:
    """
    Return how a line is set; ``0`` and ``''`` are the factory settings of the protocol.

    :raises ValueError: no such protocol, or a setting that no drive has; the message says which
        there are.
    """
    found = protocol_of(protocol)
    return LineSettings(
        baud_rate or found.baud_rate, char_format or found.char_format, response_timeout, rs485
    )


def open_link(protocol: str, port: str, settings: LineSettings) -> Link:
    """
    Return the link for a protocol on a port; it is not open yet.

    :param port: a device path, or a URL of pyserial (``socket://host:port``); ``host:port`` of
        the gateway for ``modbus_tcp``, where only the ``response_timeout`` of the settings counts;
        for ``canopen`` the name of a CAN interface, such as ``can0``, too.
    :raises ValueError: no such protocol or kind of URL, or a setting with which the protocol can
        never work; the message says what can.
    """
    found = protocol_of(protocol)
    found.require_baud_rate(settings.baud_rate)
    found.require_char_format(settings.char_format)
    return link_class(found).on_port(port, settings)
