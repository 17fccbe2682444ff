# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Drives that a file describes, ``NAME.vfd.yaml``: what it says, and what is wrong in it."""

from nfo_sinus_driver.catalog.declared.description import (
    Await,
    Condition,
    Copied,
    Description,
    Direction,
    SetBits,
    SetpointPlace,
    Shown,
    Step,
    Steps,
    drive_number,
)
from nfo_sinus_driver.catalog.declared.reader import SUFFIX, read
from nfo_sinus_driver.catalog.declared.register_map import FAULT_KEY, PULSE_KEY, STATUS_KEY
from nfo_sinus_driver.catalog.declared.registers import PULSES, Place, place_of
from nfo_sinus_driver.catalog.declared.tables import Code, status_codes
from nfo_sinus_driver.catalog.declared.yaml_file import DescriptionError
from nfo_sinus_driver.catalog.profile import Write

__all__ = [
    'FAULT_KEY',
    'PULSES',
    'PULSE_KEY',
    'STATUS_KEY',
    'SUFFIX',
    'Await',
    'Code',
    'Condition',
    'Copied',
    'Description',
    'DescriptionError',
    'Direction',
    'Place',
    'SetBits',
    'SetpointPlace',
    'Shown',
    'Step',
    'Steps',
    'Write',
    'drive_number',
    'place_of',
    'read',
    'status_codes',
]
