# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The settings of the bus node and of a drive node, by name."""

from __future__ import annotations

from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import BusSettings
from nfo_sinus_driver.setting import DISABLED, FIXED, START_ONLY, Setting, settings_of

#: Settings of the nodes alone.
DRIVES = Setting(['nfo_sinus'], 'the names of the drive nodes', change=FIXED, name='drives')
BLACK_BOX = Setting(
    60.0,
    'how much of the past is kept in memory, and written to a bag at each stop that was not asked '
    'for, each fault and each loss',
    0, 600, unit='s', zero='nothing', change=FIXED, name='black_box',
)
INTROSPECTION = Setting(
    'off',
    'what is published of the calls of services that are no commands, on SERVICE/_service_event of '
    'this node and those of its drives: who called and when, or request and answer, too; calls of '
    'commands are published whole in any case',
    choices=('off', 'metadata', 'contents'), change=FIXED, name='introspection',
)
BOND = Setting(
    False,
    "each drive's node has a bond with nav2's lifecycle manager while it is active (topic bond), "
    'for a bond_timeout of the manager above 0',
    change=FIXED, name='bond',
)
_OF_NODE = (
    Setting(
        True, 'configure and activate by itself, and try until it works',
        change=START_ONLY, name='autostart',
    ),
    Setting(
        1.0,
        'motor turns per turn of the output shaft; negative inverts the direction of joint_states '
        'and joint_command',
        also='not 0', change=DISABLED, name='gear_ratio',
    ),
    Setting(
        1.0,
        'how much of unit 1 Hz of the drive is (1 rpm, 1 %, as its control mode has it), such as '
        'm/s of a belt, in ~/setpoint, ~/setpoint_all and ~/status; negative inverts the direction',
        also='not 0', change=DISABLED, name='scale',
    ),
    Setting(
        '', 'what ~/setpoint and ~/status are in, such as m/s',
        zero='the unit of the control mode', change=DISABLED, name='unit',
    ),
    Setting(
        '', 'name of the output shaft in joint_states', zero='the name of the node',
        name='joint_name',
    ),
    Setting(
        True,
        'at the first configure, write the parameters of the drive that were given to this node '
        'and that differ in the drive; false: only report them',
        name='apply_parameters',
    ),
    Setting('', 'frame_id of the headers', name='frame_id'),
    Setting(
        [''],
        'what is due after so many hours or starts of ~/operating_record, each NAME=FIGURE:LIMIT, '
        'such as fan=powered_time:80000, with powered_time (h), running_time (h) or starts; then '
        'a warning in /diagnostics, and once in the log, says so',
        zero='nothing', name='maintenance',
    ),
)

BUS_SETTINGS = {
    **settings_of(BusSettings),
    **{setting.name: setting for setting in (DRIVES, BLACK_BOX, INTROSPECTION, BOND)},
}
DRIVE_SETTINGS = {**settings_of(DriveSettings), **{setting.name: setting for setting in _OF_NODE}}
