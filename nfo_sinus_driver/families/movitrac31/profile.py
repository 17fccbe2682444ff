# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is to be known of a MOVITRAC 31 beside its tables [M4 §4]."""

from __future__ import annotations

from nfo_sinus_driver.catalog.profile import Profile, Read, Status, Steps
from nfo_sinus_driver.catalog.status import Role
from nfo_sinus_driver.families.movitrac31 import words
from nfo_sinus_driver.families.movitrac31.function_bits import FunctionBits
from nfo_sinus_driver.families.movitrac31.line import CONTROL_MODE, START_SETTINGS
from nfo_sinus_driver.families.movitrac31.product import BIT_FIELDS, SPELLED, TYPE, read_product
from nfo_sinus_driver.families.movitrac31.remote_setpoint import RemoteSetpoint


def _active_method(status: Status | None) -> Steps[str]:
    """Return the control method by which the line has control, or would have it."""
    by_terminals = (yield Read(CONTROL_MODE)) == words.REMOTE_SETPOINT
    return 'remote_setpoint' if by_terminals else 'function_bits'


PROFILE = Profile(
    title='MOVITRAC 31',
    enable_input='enable terminal (43 from the factory)',
    # the keypad is an option, of whose keys [M4] says nothing
    has_stop_key=False,
    status_word=words.STATUS_WORD,
    # of a drive that is only watched
    holders=RemoteSetpoint.holders,
    methods={'function_bits': FunctionBits, 'remote_setpoint': RemoteSetpoint},
    setpoints=FunctionBits.setpoints,
    active_method=_active_method,
    product=read_product,
    identified_by=TYPE,
    spelled=SPELLED,
    bit_fields=BIT_FIELDS,
    start_settings=START_SETTINGS,
    measured=(
        'status.heat_sink_temperature',
        'status.external_current_limit',
        'status.apparent_current',
        'status.inverter_utilization',
        'status.motor_utilization_1',
        'status.motor_utilization_2',
        'status.terminals',
    ),
    # [M4 §2.3.2]
    cuts_off={'serial.master_slave': True},
    resync_reads={
        'movitrac': (
            'serial.inverter_address',
            'serial.response_time',
            'status.frequency',
            'status.heat_sink_temperature',
        )
    },
    # a tenth above what the display values have [M4 §4]: the motor may be overhauled
    most={Role.ACTUAL_FREQUENCY: 440.0, Role.ACTUAL_SPEED: 9999.0},
)
