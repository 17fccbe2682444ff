# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Bytes on one line, one transaction at a time. No ROS, no knowledge of drives or parameters."""

from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import Clock
from nfo_sinus_driver.link.interface import Connecting
from nfo_sinus_driver.link.interface import DamagedAnswer
from nfo_sinus_driver.link.interface import GatewayFault
from nfo_sinus_driver.link.interface import GatewayLate
from nfo_sinus_driver.link.interface import GatewaySilent
from nfo_sinus_driver.link.interface import Identification
from nfo_sinus_driver.link.interface import Inquiry
from nfo_sinus_driver.link.interface import Interrupted
from nfo_sinus_driver.link.interface import LineProtocol
from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.link.interface import Link
from nfo_sinus_driver.link.interface import LinkError
from nfo_sinus_driver.link.interface import NoAnswer
from nfo_sinus_driver.link.interface import NoData
from nfo_sinus_driver.link.interface import NoPath
from nfo_sinus_driver.link.interface import NotReady
from nfo_sinus_driver.link.interface import PortError
from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.interface import Remarks
from nfo_sinus_driver.link.interface import Reply
from nfo_sinus_driver.link.interface import Supervision
from nfo_sinus_driver.link.interface import Watch
from nfo_sinus_driver.link.line_protocols import BIT_RATES
from nfo_sinus_driver.link.line_protocols import PROTOCOLS
from nfo_sinus_driver.link.protocols import line_settings
from nfo_sinus_driver.link.protocols import open_link
from nfo_sinus_driver.link.reconnect import Reconnect

__all__ = [
    'BIT_RATES',
    'PROTOCOLS',
    'Address',
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
    'line_settings',
    'open_link',
]
