# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Bytes on one line, one transaction at a time. No ROS, no knowledge of drives or parameters."""

from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    Connecting,
    DamagedAnswer,
    GatewayFault,
    GatewayLate,
    GatewaySilent,
    Identification,
    Inquiry,
    Interrupted,
    LineProtocol,
    LineSettings,
    Link,
    LinkError,
    NoAnswer,
    NoData,
    NoPath,
    NotReady,
    PortError,
    Refused,
    Remarks,
    Reply,
    Supervision,
    Watch,
)
from nfo_sinus_driver.link.line_protocols import ADDRESSES, BIT_RATES, PROTOCOLS
from nfo_sinus_driver.link.protocols import BusSettings, open_link
from nfo_sinus_driver.link.reconnect import Reconnect

__all__ = [
    'ADDRESSES',
    'BIT_RATES',
    'PROTOCOLS',
    'Address',
    'BusSettings',
    'Clock',
    'Connecting',
    'DamagedAnswer',
    'GatewayFault',
    'GatewayLate',
    'GatewaySilent',
    'Identification',
    'Inquiry',
    'Interrupted',
    'LineProtocol',
    'LineSettings',
    'Link',
    'LinkError',
    'NoAnswer',
    'NoData',
    'NoPath',
    'NotReady',
    'PortError',
    'Reconnect',
    'Refused',
    'Remarks',
    'Reply',
    'Supervision',
    'Watch',
    'open_link',
]
