# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Control and status words of the drive, and the codes of MODE and SCMD [M0 §7.1, §7.2]."""

from __future__ import annotations

from collections.abc import Mapping
import enum
import functools

from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import Holder, Procedure, Reset, Write
from nfo_sinus_driver.catalog.status import Fact, State, StatusWord


class Mode(enum.IntEnum):
    """Who controls the drive [M0 table 17]."""

    INHIBIT = 0
    STOP = 1
    #: Never written: with RUN active it starts the motor [C43, C51].
    EXT = 2
    BUS = 3


#: Who has control, by MODE.
HOLDERS: Mapping[Value, Holder] = {
    Mode.INHIBIT: Holder.INHIBITED,
    Mode.STOP: Holder.NOBODY,
    Mode.EXT: Holder.LOCAL,
    Mode.BUS: Holder.BUS,
}


#: What has 16 bits on PROFIBUS or Classic ([M0 tables 2, 9], [C23]): no motor gives back more than
#: twice its nominal power, kW, and the size of a current has no sign.
NARROW: Mapping[str, tuple[str, float]] = {
    'status.i_rms': ('', 0.0),
    'status.p_out': ('motor.p_nom', 2000.0),
}
#: Why none can take control under Inhibit ([M0 table 17], [M2 §10]).
INHIBITED = (
    'MODE is Inhibit: it is tuning or, before firmware 4.28, controlled from another source'
)
#: What this driver calls what BusType, SiBaud and SiProt show [M0 table 4]. ABCC is whatever module
#: there is.
LINE_WORDS: Mapping[Value, str] = {
    'NFO': 'classic',
    'MbusAsc': 'modbus_ascii',
    'MbusRtu': 'modbus_rtu',
    **{f'{rate}bps': str(rate) for rate in (1200, 2400, 4800, 9600, 19200)},
    **{f'{rate} bps': str(rate) for rate in (38400, 57600)},
    '7b Ep 1s': '7E1',
    '7b Op 1s': '7O1',
    '7b Np 2s': '7N2',
    '8b Ep 1s': '8E1',
    '8b Op 1s': '8O1',
    '8b Np 2s': '8N2',
}


class Scmd(enum.IntEnum):
    """Start and stop commands under MODE = Bus [M0 table 18]."""

    STOP = 0x00
    ANALOG_F = 0x03
    ANALOG_R = 0x05
    FIX_1_F = 0x0B
    FIX_1_R = 0x0D
    FIX_2_F = 0x13
    FIX_2_R = 0x15
    FIX_3_F = 0x1B
    FIX_3_R = 0x1D
    FIX_4_F = 0x23
    FIX_4_R = 0x25
    FIX_5_F = 0x2B
    FIX_5_R = 0x2D
    FIX_6_F = 0x33
    FIX_6_R = 0x35
    FIX_7_F = 0x3B
    FIX_7_R = 0x3D
    OP_MODE = 0x41
    TERMINAL = 0x81
    FIELDBUS = 0x101
    FULL_TUNING = 0x201
    BASIC_TUNING = 0x301
    RS_MEASURE = 0x401
    PAR_CALC = 0x501
    ERASE_E_LOG = 0x800
    RESET_E_OUT = 0x900


#: What begins each procedure, whatever else commands the drive [M0 §7, table 18].
PROCEDURES: Mapping[Procedure | Reset, Write] = {
    procedure: Write('fieldbus.scmd', command, retry=False, head=True)
    for procedure, command in (
        (Procedure.FULL, Scmd.FULL_TUNING),
        (Procedure.BASIC, Scmd.BASIC_TUNING),
        (Procedure.STATOR_RESISTANCE, Scmd.RS_MEASURE),
        (Procedure.CALCULATE, Scmd.PAR_CALC),
        (Reset.ERROR_LOG, Scmd.ERASE_E_LOG),
        (Reset.ENERGY, Scmd.RESET_E_OUT),
    )
}


class ControlWord(enum.IntFlag):
    """DriveControl, the control word of the generic state machine [M0 table 14]."""

    SWITCH_ON = 1 << 0
    ENABLE_VOLTAGE = 1 << 1
    DISABLE_QUICK_STOP = 1 << 2
    ENABLE_OP = 1 << 3
    ENABLE_RFG = 1 << 4
    UNLOCK_RFG = 1 << 5
    USE_REF_FOR_RFG = 1 << 6
    RESET_MALFUNCTION = 1 << 7
    EVENT_TRIGGERED_OP = 1 << 10
    OVERRIDE_COAST = 1 << 11
    AUTO_INIT = 1 << 12
    ENABLE_REV_OP = 1 << 13
    NET_CTRL = 1 << 14
    NET_REF = 1 << 15


class Status(enum.IntFlag):
    """DriveStatus, the status word of the generic state machine [M0 table 15]."""

    READY_TO_SWITCH_ON = 1 << 0
    SWITCHED_ON = 1 << 1
    OP_ENABLED = 1 << 2
    FAULTED = 1 << 3
    VOLTAGE_ENABLED = 1 << 4
    QUICK_STOP_DISABLED = 1 << 5
    SWITCH_ON_DISABLED = 1 << 6
    REF_FROM_NET = 1 << 8
    CTRL_FROM_NET = 1 << 9
    SETPOINT_REACHED = 1 << 10
    LIMIT_ACTIVE = 1 << 11
    REV_OP_ENABLED = 1 << 14
    STOPPING = 1 << 15


@functools.lru_cache(maxsize=256)
def state_of(word: int) -> State:
    """Return the state that a DriveStatus word shows; UNKNOWN for a pattern not in table 16."""
    for mask, pattern, state in _STATES:
        if word & mask == pattern:
            return state
    return State.UNKNOWN


def _pattern(printed: str, state: State) -> tuple[int, int, State]:
    """Turn a pattern as the manual prints it into a mask and what stands under it."""
    bits = printed.replace(' ', '')
    mask = int(''.join('0' if bit == 'X' else '1' for bit in bits), 2)
    return mask, int(bits.replace('X', '0'), 2), state


#: The patterns of [M0 table 16], forward and reverse.
_STATES = (
    _pattern('00XX XXXX X0XX 0000', State.NOT_READY_TO_SWITCH_ON),
    _pattern('00XX XXXX X1XX 0000', State.SWITCH_ON_DISABLED),
    _pattern('00XX XXXX X01X 0001', State.READY_TO_SWITCH_ON),
    _pattern('00XX XXXX X01X 0011', State.SWITCHED_ON),
    _pattern('00XX XXXX X01X 0111', State.OPERATION_ENABLED),
    _pattern('01XX XXXX X01X 0011', State.OPERATION_ENABLED),
    _pattern('10XX XXXX X01X 0111', State.STOPPING),
    _pattern('11XX XXXX X01X 0011', State.STOPPING),
    _pattern('10XX XXXX X00X 0111', State.QUICK_STOP),
    _pattern('11XX XXXX X00X 0011', State.QUICK_STOP),
    _pattern('10XX XXXX X0XX 1111', State.FAULT_REACTION_ACTIVE),
    _pattern('11XX XXXX X0XX 1011', State.FAULT_REACTION_ACTIVE),
    _pattern('00XX XXXX X0XX 1000', State.FAULTED),
)

STATUS_WORD = StatusWord(
    state=state_of,
    by_bit={
        Status.READY_TO_SWITCH_ON: Fact.READY,
        Status.SWITCHED_ON: Fact.SWITCHED_ON,
        Status.OP_ENABLED: Fact.OPERATION_ENABLED,
        Status.FAULTED: Fact.FAULT,
        Status.VOLTAGE_ENABLED: Fact.VOLTAGE_ENABLED,
        Status.SWITCH_ON_DISABLED: Fact.SWITCH_ON_DISABLED,
        Status.REF_FROM_NET: Fact.NETWORK_REFERENCE,
        Status.CTRL_FROM_NET: Fact.NETWORK_CONTROL,
        Status.SETPOINT_REACHED: Fact.SETPOINT_REACHED,
        Status.LIMIT_ACTIVE: Fact.LIMIT_ACTIVE,
        Status.REV_OP_ENABLED: Fact.OPERATION_ENABLED | Fact.REVERSE,
        Status.STOPPING: Fact.STOPPING,
    },
    # bit 5 is undefined outside the driven states [M0 table 16]
    by_state={State.QUICK_STOP: Fact.QUICK_STOP_ACTIVE},
)

#: Its parameters whose bits mean something each.
BIT_FIELDS = frozenset(
    (
        'fieldbus.drive_control',
        'fieldbus.drive_status',
        'fieldbus.profidrive_control',
        'fieldbus.profidrive_status',
        'fieldbus.control_word',
        'fieldbus.status_word',
        'fieldbus.supported_drive_modes',
    )
)
