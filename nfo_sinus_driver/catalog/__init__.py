# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""What the manuals say: tables and pure functions on them. No I/O beyond that, no ROS."""

from nfo_sinus_driver.catalog.codec import Number
from nfo_sinus_driver.catalog.codec import Text
from nfo_sinus_driver.catalog.codec import codec_of
from nfo_sinus_driver.catalog.codec import to_bytes
from nfo_sinus_driver.catalog.codec import to_words
from nfo_sinus_driver.catalog.error_log import ErrorLogArea
from nfo_sinus_driver.catalog.family import Family
from nfo_sinus_driver.catalog.family import example_setting
from nfo_sinus_driver.catalog.family import families
from nfo_sinus_driver.catalog.family import load_family
from nfo_sinus_driver.catalog.family import load_parameter
from nfo_sinus_driver.catalog.family import load_profile
from nfo_sinus_driver.catalog.family import usual_family
from nfo_sinus_driver.catalog.inverter_status import InverterStatus
from nfo_sinus_driver.catalog.parameter import Access
from nfo_sinus_driver.catalog.parameter import Address
from nfo_sinus_driver.catalog.parameter import Parameter
from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import ControlMethod
from nfo_sinus_driver.catalog.profile import Holder
from nfo_sinus_driver.catalog.profile import Limits
from nfo_sinus_driver.catalog.profile import NotPossible
from nfo_sinus_driver.catalog.profile import OlderDialect
from nfo_sinus_driver.catalog.profile import Procedure
from nfo_sinus_driver.catalog.profile import Profile
from nfo_sinus_driver.catalog.profile import Refusal
from nfo_sinus_driver.catalog.profile import Removal
from nfo_sinus_driver.catalog.profile import Reset
from nfo_sinus_driver.catalog.profile import SetpointTarget
from nfo_sinus_driver.catalog.status import Fact
from nfo_sinus_driver.catalog.status import Kind
from nfo_sinus_driver.catalog.status import Meaning
from nfo_sinus_driver.catalog.status import Role
from nfo_sinus_driver.catalog.status import State
from nfo_sinus_driver.catalog.status import StatusCode
from nfo_sinus_driver.catalog.status import StatusWord
from nfo_sinus_driver.catalog.table import CatalogError

__all__ = [
    'Access',
    'Address',
    'CatalogError',
    'ControlMethod',
    'ErrorLogArea',
    'Fact',
    'Family',
    'Holder',
    'InverterStatus',
    'Kind',
    'Limits',
    'Meaning',
    'NotPossible',
    'Number',
    'OlderDialect',
    'Parameter',
    'Procedure',
    'Profile',
    'Refusal',
    'Removal',
    'Reset',
    'Role',
    'SetpointTarget',
    'State',
    'StatusCode',
    'StatusWord',
    'Text',
    'Value',
    'codec_of',
    'example_setting',
    'families',
    'load_family',
    'load_parameter',
    'load_profile',
    'to_bytes',
    'to_words',
    'usual_family',
]
