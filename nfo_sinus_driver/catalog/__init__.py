# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the manuals say: tables and pure functions on them. No I/O beyond that, no ROS."""

from nfo_sinus_driver.catalog.codec import Number, Text, codec_of, to_bytes, to_words
from nfo_sinus_driver.catalog.error_log import ErrorLogArea
from nfo_sinus_driver.catalog.factory_line import with_factory_line
from nfo_sinus_driver.catalog.family import (
    Family,
    example_setting,
    families,
    is_described,
    is_family,
    load_family,
    load_parameter,
    load_profile,
    usual_family,
)
from nfo_sinus_driver.catalog.inverter_status import InverterStatus
from nfo_sinus_driver.catalog.parameter import Access, Address, Parameter, Value
from nfo_sinus_driver.catalog.profile import (
    ControlMethod,
    Holder,
    Limits,
    NotPossible,
    OlderDialect,
    Procedure,
    Product,
    Profile,
    Refusal,
    Removal,
    Reset,
    SetpointTarget,
)
from nfo_sinus_driver.catalog.status import Fact, Kind, Meaning, Role, State, StatusCode
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
    'Product',
    'Profile',
    'Refusal',
    'Removal',
    'Reset',
    'Role',
    'SetpointTarget',
    'State',
    'StatusCode',
    'Text',
    'Value',
    'codec_of',
    'example_setting',
    'families',
    'is_described',
    'is_family',
    'load_family',
    'load_parameter',
    'load_profile',
    'to_bytes',
    'to_words',
    'usual_family',
    'with_factory_line',
]
