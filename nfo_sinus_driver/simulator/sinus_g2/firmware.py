# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Which G2 it is: what the manuals leave open of it, and what its firmware does.

The firmware before 4.28 is that of [M2]; [M0] describes the newer one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from nfo_sinus_driver.simulator.canopen import Profile301
from nfo_sinus_driver.simulator.control_unit import choice
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.sinus.control_unit import SinusVariant
from nfo_sinus_driver.simulator.sinus.serial_side import LineRules

SW_VER = 'fieldbus.sw_ver'
#: Its codes of SiProt [C5].
_OLD_FORMAT_CODES = {'7E1': 0, '8N1': 1}


@dataclass(frozen=True)
class G2Variant(SinusVariant):
    """One way to read the manuals, and the chapter on CANopen ([M0 §6.4], [C102])."""

    dialect: str = choice(
        '',
        '2.03',
        '5.0',
        text='the manual that describes the Classic protocol of the drives (default: as their '
        'firmware, fieldbus.sw_ver, says)',
    )
    #: [C120]; that of a process value always does.
    sign_in_drive_control: str = choice(
        'ignored',
        'followed',
        text='under DriveControl: whether the sign of a set-point reverses beside its bit 13',
    )
    #: [C122]
    shown_in_dc_brk: str = choice(
        'running', 'standby', text='what it shows during the DC braking before a start, DC-Brk'
    )
    telegram_words: str = choice(
        'profidrive',
        'drivecontrol',
        text='on telegram 1: the words are those of PROFIdrive, or DriveControl and DriveStatus',
    )
    #: Which the manual leaves "TBD". ``full``: identity, texts, heartbeats, guarding; ``minimal``:
    #: device type, error register, vendor and the heartbeat that a node sends; ``bare``: no object
    #: at all. A node reports its boot-up and obeys network management in any case.
    canopen_profile: str = choice(
        'full', 'minimal', 'bare', text='on CANopen: how much of the communication profile there is'
    )
    #: ``by_shape``: both where the profile is full, else none.
    canopen_watch: str = choice(
        'by_shape',
        'none',
        'heartbeat',
        'guarding',
        'both',
        text='on CANopen: what a master can be watched by',
    )
    #: Which the manual does not print. ``narrow``: enumerations have one; ``wide``: all have four.
    canopen_types: str = choice(
        'table', 'narrow', 'wide', text='on CANopen: how many bytes values have'
    )
    #: From one, sub-index 0 reports how many there are; from zero, as on PROFIBUS.
    canopen_sub_indices: str = choice(
        'from_one', 'from_zero', text='on CANopen: how the elements of arrays are numbered'
    )
    #: At the index that is printed, at the one that its parameters' numbers give [C2], or nowhere.
    canopen_error_log: str = choice(
        '2F7C', '4F7D', 'none', text='on CANopen: where the error log stands'
    )
    canopen_bus_mode: str = choice(
        'held', 'free', text='on CANopen: whether the module holds the drive in bus mode'
    )
    #: Which a module with a drive profile need not have [M0 §7].
    canopen_state_machine: str = choice(
        'present',
        'absent',
        text='on CANopen: whether DriveControl, DriveStatus and the PROFIdrive words are there',
    )
    canopen_ramp: str = choice(
        'running',
        'ready',
        text='on CANopen: what StatusWord (6041h) shows while the motor ramps to a stop',
    )

    @property
    def profile(self) -> Profile301:
        """What the node has of the communication profile."""
        watch = self.canopen_watch
        if watch == 'by_shape':
            watch = 'both' if self.canopen_profile == 'full' else 'none'
        return Profile301(
            mandatory=self.canopen_profile != 'bare',
            optional=self.canopen_profile == 'full',
            consumes_heartbeats=watch in ('heartbeat', 'both'),
            guards=watch in ('guarding', 'both'),
        )


@dataclass(frozen=True)
class Firmware:
    """
    One firmware's way; by default that of the newer one.

    :ivar manual: the manual that describes it.
    :ivar sw_ver: the SWVer of a drive that has it.
    :ivar log_size: entries that the error log holds [C4].
    :ivar classic_line: how it takes its line on Classic ([C5], [C6], [C7]).
    :ivar naks_damage: a message with a wrong check sum is answered by NAK; else not at all [C8].
    :ivar obeys_stop: MODE = Stop is obeyed by the one addressed in spite of a serial fault; else
        only when it goes to all [C9].
    :ivar most_address: the highest that the parameter Address takes on Classic [C10].
    :ivar sets_references: FrqSet and its like can be written on Classic; else only E001E [C11].
    :ivar short_counters: hours and seconds are counted in 24 bits [C26].
    :ivar even_stops: every even SCMD below 800h is Stop [C31].
    :ivar own_address: a message to address 0 is answered with the drive's own [C86].
    :ivar lower_case: hexadecimal digits are sent as small letters; both are read [C86].
    :ivar bus_only: nothing but MODE is written while the bus has no control [C100].
    :ivar own_bus_codes: control over a fieldbus has InvSt codes of its own, four higher [C3].
    :ivar tenths: values that it reports with a decimal more on Classic [C115].
    :ivar lacks: parameters that it does not have on Classic [C21].
    :ivar codes: enumerations of which it has these codes only.
    """

    manual: str
    sw_ver: float
    log_size: int = 32
    classic_line: LineRules = field(default_factory=LineRules)
    naks_damage: bool = False
    obeys_stop: bool = True
    most_address: int = 94
    sets_references: bool = True
    short_counters: bool = False
    even_stops: bool = False
    own_address: bool = False
    lower_case: bool = False
    bus_only: bool = False
    own_bus_codes: bool = False
    tenths: frozenset[str] = frozenset()
    lacks: frozenset[str] = frozenset()
    codes: Mapping[str, frozenset[int]] = field(default_factory=dict)

    def line_rules(self, protocol: str) -> LineRules:
        """Return how it takes its line by a protocol; older firmware knows nothing but Classic."""
        return self.classic_line if protocol == 'classic' else LineRules()


NEW = Firmware(manual='2.03', sw_ver=4.38)
OLD = Firmware(
    manual='5.0',
    sw_ver=4.21,
    log_size=128,
    classic_line=LineRules(_OLD_FORMAT_CODES, most_baud=9600, at_once=True),
    naks_damage=True,
    obeys_stop=False,
    most_address=95,
    sets_references=False,
    short_counters=True,
    even_stops=True,
    own_address=True,
    lower_case=True,
    bus_only=True,
    own_bus_codes=True,
    tenths=frozenset({'status.trq_act'}),
    lacks=frozenset(
        {
            'control.f_sleep',
            'serial.bus_type',
            'status.e_out',
            'status.sigma_e_out',
            'error.short_c_err_cnt',
            'fieldbus.sw_ver',
            'fieldbus.nfo_ver',
            'fieldbus.drive_control',
            'fieldbus.drive_status',
            'fieldbus.spd_scl_numerator',
            'fieldbus.spd_scl_denominator',
        }
    ),
    codes={
        'serial.si_baud': frozenset({16, 32, 64, 128}),
        'serial.si_prot': frozenset(_OLD_FORMAT_CODES.values()),
        'pi_reg.unit': frozenset(range(12)),
    },
)
#: By the manual that describes them.
_DIALECTS: Mapping[str, Firmware] = {firmware.manual: firmware for firmware in (NEW, OLD)}
#: The first firmware that [M0] describes.
_FIRST_NEW = Fraction('4.28')


def firmware_of(memory: Memory, dialect: str) -> Firmware:
    """Return which of the two a drive has, by its SWVer, or by the manual that describes it."""
    if dialect and SW_VER not in memory.given:
        memory.set(SW_VER, _DIALECTS[dialect].sw_ver)
    version = memory.version
    assert version is not None
    firmware = OLD if version < _FIRST_NEW else NEW
    if dialect not in ('', firmware.manual):
        raise ValueError(f'dialect {dialect} is not that of firmware {float(version)}')
    return firmware
