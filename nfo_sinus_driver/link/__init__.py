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

"""Bytes on one line, one transaction at a time. No ROS, no knowledge of drives or parameters."""

from nfo_sinus_driver.link.consistent_read import consistent_read
from nfo_sinus_driver.link.errors import DamagedAnswer
from nfo_sinus_driver.link.errors import GatewaySilent
from nfo_sinus_driver.link.errors import LinkError
from nfo_sinus_driver.link.errors import NoAnswer
from nfo_sinus_driver.link.errors import NoPath
from nfo_sinus_driver.link.errors import NotReady
from nfo_sinus_driver.link.errors import PortError
from nfo_sinus_driver.link.errors import Refused
from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import Identification
from nfo_sinus_driver.link.interface import Inquiry
from nfo_sinus_driver.link.interface import Link
from nfo_sinus_driver.link.interface import Reply
from nfo_sinus_driver.link.protocol import LineProtocol
from nfo_sinus_driver.link.protocols import PROTOCOLS
from nfo_sinus_driver.link.protocols import line_settings
from nfo_sinus_driver.link.protocols import open_link
from nfo_sinus_driver.link.reconnect import Reconnect
from nfo_sinus_driver.link.settings import LineSettings

__all__ = [
    'PROTOCOLS',
    'Address',
    'DamagedAnswer',
    'GatewaySilent',
    'Identification',
    'Inquiry',
    'LineProtocol',
    'LineSettings',
    'Link',
    'LinkError',
    'NoAnswer',
    'NoPath',
    'NotReady',
    'PortError',
    'Reconnect',
    'Refused',
    'Reply',
    'consistent_read',
    'line_settings',
    'open_link',
]
