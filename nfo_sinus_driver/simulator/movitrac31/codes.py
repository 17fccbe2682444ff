# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Bits and numbers of a MOVITRAC 31.., as its manual prints them [M4 §4]."""

from __future__ import annotations

import enum


class Bit(enum.IntFlag):
    """Function bits, index 281; byte 3, the last one on the line, has the lowest [C72]."""

    CW = 1 << 0
    CCW = 1 << 1
    ENABLE = 1 << 2
    SECOND_SET = 1 << 3
    RESET = 1 << 6
    INHIBIT = 1 << 8
    SECOND_RAMP = 1 << 12
    HOLD = 1 << 15


class Flag(enum.IntFlag):
    """Byte 3 of the inverter status, index 284."""

    NO_BRAKE_CHOPPER = 1 << 0
    SUPPLY_24_V = 1 << 1
    VOLTAGE_SIGNAL = 1 << 2
    SECOND_SET = 1 << 3
    CW = 1 << 4


class Number(enum.IntEnum):
    """The inverter status, byte 1 of index 284, as far as a drive without encoder comes to it."""

    INHIBIT = 0
    NO_ENABLE = 1
    START_MAGNETIZATION = 2
    STOP_MAGNETIZATION = 3
    HEATING_CURRENT = 5
    DC_BRAKING = 6
    DC_HOLDING_CURRENT = 7
    ENABLE = 10
    CHANGE_DIRECTION = 11
    NORMAL_STOP = 12
    RAPID_STOP = 13


class Mode(enum.IntEnum):
    """Control modes, P841."""

    STANDARD = 0
    REMOTE_SETPOINT = 1
    REMOTE_CONTROL = 2
    FIELDBUS = 3


class Input(enum.IntEnum):
    """Functions of a binary input, P600 to P609; those with a slash are on while it is open."""

    CCW = 0
    ENABLE = 1
    SECOND_SET = 2
    FIXED_1 = 3
    FIXED_2 = 4
    RESET = 5
    SECOND_RAMP = 10
    NOT_INHIBIT = 11
    NOT_EXTERNAL_FAULT = 12
    CW = 16


class Output(enum.IntEnum):
    """Functions of a binary output, P611 to P617, as far as they are simulated."""

    READY = 0
    FIELD_ON = 1
    FIELD_OFF = 2
    BRAKE_APPLIED = 3
    MANUAL = 4
    SECOND_SET = 5
    AT_SETPOINT = 11
    NOT_FAULT = 19
    BRAKE_RELEASED = 33
    STANDING = 35


#: What a status code has that is a fault: so much more than the fault's own number.
FAULTS = 100
EXTERNAL_FAULT = FAULTS + 27
PC_TIMEOUT = FAULTS + 45
