# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What happens to the drives of NFO alone; the rules for all are in ``any_order_machine.py``."""

from __future__ import annotations

from typing import Any

from any_order_machine import DRIVEN
from any_order_machine import WAITS
from any_order_machine import WHOLE
from any_order_machine import AnyOrder
from any_order_shown import MODE_BUS
from any_order_shown import MODE_STOP
from any_order_shown import RUN_FIELDBUS
from hypothesis import strategies as st
from hypothesis.stateful import initialize
from hypothesis.stateful import precondition
from hypothesis.stateful import rule

from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.sinus.control_unit import ALL
from nfo_sinus_driver.simulator.sinus.control_unit import DROPS
from nfo_sinus_driver.simulator.sinus.control_unit import KEEPS
from nfo_sinus_driver.simulator.sinus.control_unit import NOTHING
from nfo_sinus_driver.simulator.sinus.control_unit import REFUSED
from nfo_sinus_driver.simulator.sinus.control_unit import SCMD
from nfo_sinus_driver.simulator.sinus.control_unit import TAKEN
from nfo_sinus_driver.simulator.sinus_g2.self_restart import TRIES

_CONTROL = 'fieldbus.drive_control'


class SinusOrder(AnyOrder):
    """The rules for both families of NFO."""

    model = 'sinus_g2'
    method = 'mode_scmd'
    #: Of the motor, the mains, the serial line and the fieldbus; 15 wants no acknowledgement.
    faults = (5, 7, 12, 14, 15)
    boot_times = (0.05, 0.5, 2.0)
    enders = (
        'first_fault',
        'first_fault',
        'press_stop',
        'press_ext',
        'stop_by_another',
        'run_input_off',
        'stop_unheard',
    )

    @initialize(
        control_mode=st.sampled_from(('Freque', 'Freque', 'Speed', 'Torque', 'PI-Reg')),
        brake=st.booleans(),
        slow=st.booleans(),
        delay=st.sampled_from((0, 0, 1)),
        drive_timeout=st.sampled_from((0.0, 0.0, 2.0)),
        restart_after=st.sampled_from((None, None, 0, 1, 2)),
        keeps=st.booleans(),
        refuses=st.sampled_from((ALL, ALL, SCMD, NOTHING)),
        tunes_on=st.booleans(),
    )
    def begin(
        self,
        control_mode: str = 'Freque',
        brake: bool = True,
        slow: bool = False,
        delay: int = 0,
        drive_timeout: float = 0.0,
        restart_after: int | None = None,
        keeps: bool = True,
        refuses: str = ALL,
        tunes_on: bool = True,
    ) -> None:
        """
        Begin; a G2 ends its faults by itself after some seconds, if there are any.

        :param keeps: the drive keeps its run command through a fault.
        :param refuses: what it refuses while one is active.
        :param tunes_on: it refuses to stop while it tunes.
        """
        optimal = self.model == 'sinus_optimal'
        if optimal and control_mode not in ('Freque', 'Speed'):
            control_mode = 'Freque'
        parameters: dict[str, Any] = {
            'control.mode': control_mode,
            'control.st_mode': 'Brake' if brake else 'Release',
            'control.accel': 0.3,
            'control.retard': 3.0 if slow else 0.3,
            'control.run_dly': delay,
        }
        if restart_after is not None and not optimal:
            parameters.update(dict.fromkeys(TRIES.values(), 3))
            parameters.update({'error.rst_dly': restart_after, 'error.tr_time': 1})
        variant = {
            'run_command_in_fault': KEEPS if keeps else DROPS,
            'refuses_in_fault': refuses,
            'stop_in_tuning': REFUSED if tunes_on else TAKEN,
        }
        far = simulated_drive(self.model, settings=parameters, **variant)
        self.begin_with(
            far,
            expected_control_mode=control_mode if optimal else '',
            drive_timeout=0.0 if optimal or self.method == 'monitor' else drive_timeout,
        )

    def begin_for_each_event(self) -> None:
        """Begin; a start that is delayed shows a run command before the motor runs by it."""
        self.begin(delay=1)

    def forget_faults(self) -> None:
        """End what RstDly or the keypad ends."""
        far = self.rig.far
        far.faults.acknowledge()
        far.faults.acknowledge_serial()
        far.set_run_input(far.control_unit.run_input)

    # --- commands that a G2 has alone -------------------------------------------------------------

    @DRIVEN
    @precondition(lambda self: self.model == 'sinus_g2' and self.method == 'mode_scmd')
    @rule(
        procedure=st.sampled_from(Procedure),
        after=st.sampled_from((0.02, 0.4, 1.0)),
        give=st.sampled_from(('', 'stop', 'stop', 'quick_stop', 'deactivate', 'enable')),
        wait=WAITS,
    )
    def tune(
        self, procedure: Procedure, after: float = 0.4, give: str = 'stop', wait: float = 1.0
    ) -> None:
        """Tune a motor that stands; do something else meanwhile."""
        if not self.laws.pending('tune'):
            self.laws.command('tune', self.rig.drive.tune(procedure))
        self.let(after)
        if give:
            self.give(give, wait)

    @DRIVEN
    @precondition(lambda self: self.model == 'sinus_g2')
    @rule(mode=st.sampled_from(('Freque', 'Speed', 'Torque')), wait=WAITS)
    def set_control_mode(self, mode: str, wait: float = 0.4) -> None:
        if self.method != 'monitor':
            self.until_noticed()
            change = self.rig.drive.parameters.change({'control.mode': mode})
            self.rig.answer(change)
            self.let(wait)

    # --- what the drive does ----------------------------------------------------------------------

    @rule(key=st.sampled_from(('stop', 'start', 'ext')), wait=WAITS)
    def press(self, key: str, wait: float = 0.4) -> None:
        self.laws.disturbed()
        self.rig.far.control_unit.press(key)
        self.let(wait)

    @rule(mode=st.sampled_from((1, 2, 3)), wait=WAITS)
    def write_mode(self, mode: int, wait: float = 0.4) -> None:
        """Let somebody else write MODE."""
        self.by_another(('fieldbus.mode', mode))
        if mode == MODE_BUS:
            self.laws.forgotten()
        self.let(wait)

    @WHOLE
    @precondition(lambda self: self.reference == 'fieldbus' and not self.laws.enabling)
    @rule(wait=WAITS)
    def run_by_another(self, wait: float = 1.0) -> None:
        """Let another master run the motor, the way this driver would."""
        self.until_noticed()
        setpoint = self.rig.far.control_unit.setpoint_key
        if self.method == 'drive_control':
            words = (0xC076, 0xC077, 0xC07F)
            self.by_another(*((_CONTROL, word) for word in words), (setpoint, 100))
        else:
            command = 'fieldbus.smode' if self.model == 'sinus_optimal' else 'fieldbus.scmd'
            mode = ('fieldbus.mode', MODE_BUS)
            self.by_another(mode, (setpoint, 100), (command, RUN_FIELDBUS))
        self.laws.started_by_another()
        self.let(wait)

    @WHOLE
    @precondition(lambda self: self.model == 'sinus_g2')
    @rule(mode=st.sampled_from(('Freque', 'Speed', 'Torque')), wait=WAITS)
    def set_control_mode_at_keypad(self, mode: str, wait: float = 1.0) -> None:
        self.until_noticed()
        if self.rig.far.peek('control.mode') != mode:
            self.rig.far.set_from_keypad('control.mode', mode)
            self.laws.control_mode_changed()
        # it is not read with every poll
        self.let(max(wait, 2.5))

    # --- what ends a ride -------------------------------------------------------------------------

    def press_stop(self, wait: float) -> None:
        self.press('stop', wait)

    def press_ext(self, wait: float) -> None:
        self.press('ext', wait)

    def stop_by_another(self, wait: float) -> None:
        self.write_mode(MODE_STOP, wait)
