# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a broken copy is, and the files that are broken and tested."""

from __future__ import annotations

from dataclasses import dataclass

WAYS_OUT = 'test/ros/test_ways_out.py'
NO_RESTART = 'test/ros/test_no_restart.py'
INTERFACE = 'test/ros/test_interface.py'
TRACE = 'test/ros/test_trace.py'
LINE = 'test/unit/link/test_line.py'
MODBUS_LINE = 'test/unit/link/test_modbus_line.py'

CONTROLLER = 'nfo_sinus_driver/drive/controller.py'
STARTING = 'nfo_sinus_driver/drive/starting.py'
TABLE = 'nfo_sinus_driver/drive/control_state.py'
SETPOINT = 'nfo_sinus_driver/drive/setpoint.py'
ADVICE = 'nfo_sinus_driver/drive/diagnosis.py'
DRIVE = 'nfo_sinus_driver/drive/drive.py'
WATCHDOG = 'nfo_sinus_driver/drive/communication_watchdog.py'
WATCH = 'nfo_sinus_driver/drive/poller.py'
WRITER = 'nfo_sinus_driver/drive/parameter_writer.py'
TUNING = 'test/unit/drive/test_tuning.py'
G2 = 'nfo_sinus_driver/families/sinus_g2/profile.py'
NODE = 'nfo_sinus_driver/node/drive_node.py'
MAIN = 'nfo_sinus_driver/node/main.py'
SIGNALS = 'nfo_sinus_driver/signals.py'
SEQUENCE = 'nfo_sinus_driver/drive/stopping.py'
PROFILE = 'nfo_sinus_driver/catalog/profile.py'
ANY_ORDER = 'test/unit/drive/test_any_order.py'
EVERY_STEP = 'test/unit/drive/test_every_step_of_a_stop.py'
LAW_2 = ('test/unit/drive/test_laws.py', '-k', 'rtu and test_2 and stop')
STOPPED_IS_TRUE = 'test/unit/drive/test_stopped_is_true.py'
STOP_CONFIRMED = ('test/unit/drive/test_stop_is_confirmed.py',)
RECOGNITION = 'test/unit/drive/test_recognition.py'
LEFTOVER = 'test/unit/drive/test_leftover_run_command.py'
CONTROL_TAKEN = ('test/unit/drive/test_control_is_taken.py',)
GUARDS = ('test/unit/drive/test_control_table.py', '-k', 'nothing_begins')
TUNING_BEGINS = (TUNING, '-k', 'any_moment')
TERMINALS_KEEP = ('test/unit/drive/test_drive_commands.py', '-k', 'terminals_keep')
NO_STOP_FORGOTTEN = ('test/unit/drive/test_no_stop_is_forgotten.py',)
NO_TURN = ('test/unit/drive/test_no_turn_at_acknowledge.py',)
G2_SCMD = (ANY_ORDER, '-k', 'G2ModeScmd')
G2_CONTROL = (ANY_ORDER, '-k', 'G2DriveControl')
OPTIMAL_SCMD = (ANY_ORDER, '-k', 'OptimalModeScmd')


@dataclass(frozen=True)
class Mutant:
    """
    One broken copy.

    :ivar law: the number of the law in docs/architecture.md that it breaks.
    :ivar old: what stands in the file, once.
    :ivar tests: what has to fail, as arguments of pytest.
    :ivar also: what else is broken, where one thing keeps the law without the other: file, what
        stands there, what in its place.
    """

    law: int
    what: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    also: tuple[tuple[str, str, str], ...] = ()

    def __str__(self) -> str:
        return f'law {self.law}: {self.what}'
