# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the manuals say: tables and pure functions on them. No I/O beyond that, no ROS.

**The tables are read and checked when a family is loaded, not when a value is used.** An unknown
codec, a step that is no count, a label twice or a missing role is a :class:`CatalogError` with file
and line, before anything is sent. No family is known by name here; a folder, or a file that
describes a drive, is found by the name that the user gives.

**Numbers are exact.** The value of a raw count is a fraction (1/10, 1/6, 60/4), so that a value
that was read and is written back is the same one. A setting between two steps of the drive is
refused, and the message has both; only a set-point is rounded, to the nearest step.

**Bytes have a length.** A parameter of 32 bits is one request with both words, low word first on
NFO's drives; half of it is never read or written [M0 §6.2.3]. Byte order, word order, BCD, bits
and texts are a codec (:mod:`.codec`) that the row names, with its inverse, both tested by
properties over every value.

**"Unknown" is a value.** A status has facts that may be true, false, or not shown by this drive;
what is not shown is never taken for false (:mod:`.status`). A code that no manual lists keeps its
number and shows no standstill.

**What drive control may ask for has a name** (:class:`Role`). A role that a family lacks is a
feature that this drive has not, and the answer of a service says so.

Rejected: descriptions in YAML for all families (the firmwares of a G2 differ in what they do, and
a language for that would be a worse Python).
"""

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
    NotTried,
    OlderDialect,
    Procedure,
    Product,
    Profile,
    Refusal,
    Removal,
    Reset,
    SetpointTarget,
)
from nfo_sinus_driver.catalog.status import (
    MOTOR_PLATE,
    Fact,
    Kind,
    Meaning,
    Role,
    State,
    StatusCode,
)
from nfo_sinus_driver.catalog.table import CatalogError

__all__ = [
    'MOTOR_PLATE',
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
    'NotTried',
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
