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

"""What happens to a MOVITRAC alone; the rules for all are in ``any_order_machine.py``."""

from __future__ import annotations

from typing import Any

from any_order_machine import BOOT_TIMES
from any_order_machine import WAITS
from any_order_machine import WHOLE
from any_order_machine import AnyOrder
from hypothesis import strategies as st
from hypothesis.stateful import initialize
from hypothesis.stateful import precondition
from hypothesis.stateful import rule

from nfo_sinus_driver.simulator.family import load
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.movitrac31.codes import Bit
from nfo_sinus_driver.simulator.movitrac31.codes import Mode
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE
from nfo_sinus_driver.simulator.movitrac31.commands import FUNCTION_BITS
from nfo_sinus_driver.simulator.movitrac31.commands import SETPOINT

#: Over-current, DC link voltage, temperature and PC time-out: codes that mean the same whether they
#: are read as binary or as decimal digits [C105].
_FAULTS = (101, 107, 106, 145)
_MODES = ('Standard', 'Remote setpoint', 'Remote control', 'Fieldbus')
#: As raw numbers: hundredths.
_REMOTE = 100 * Mode.REMOTE_CONTROL
_20_HZ = 2000
_RUNS = Bit.ENABLE | Bit.CW
#: A power-off that ends before the drive is lost, s; and from which set-point on it is seen, Hz:
#: the motor has to be slower yet when it is heard again than it was.
_SHORT_BOOT = 0.5
_SEEN_FROM = 19.0
#: The directions at the terminals.
_TERMINALS = (41, 42)
#: How a drive may be, where the manual leaves it open: all that the simulated family offers but the
#: option cards, which change nothing here.
SWITCHES = {
    option.name: st.sampled_from(option.choices)
    for option in load('movitrac31').options
    if option.name != 'option_card'
}


class MovitracOrder(AnyOrder):
    """The rules for a MOVITRAC."""

    model = 'movitrac31'
    method = 'function_bits'
    faults = _FAULTS
    #: The first is less than ``lost_after``.
    boot_times = (_SHORT_BOOT, 1.5, 4.0)
    enders = (
        'first_fault',
        'first_fault',
        'standard_at_keypad',
        'keypad_in_control',
        'run_input_off',
        'opposite_terminal',
        'stop_unheard',
    )

    @initialize(
        stored=st.sampled_from(('Standard', 'Remote control', 'Remote control')),
        left_behind=st.booleans(),
        slow=st.booleans(),
        response_time=st.sampled_from((0.0, 0.0, 0.0, 30.0)),
        drive_timeout=st.sampled_from((0.0, 0.0, 2.0)),
        resets_itself=st.booleans(),
        magnetizes=st.booleans(),
        **SWITCHES,
    )
    def begin(
        self,
        stored: str = 'Standard',
        left_behind: bool = False,
        slow: bool = False,
        response_time: float = 0.0,
        drive_timeout: float = 0.0,
        resets_itself: bool = False,
        magnetizes: bool = False,
        **switches: str,
    ) -> None:
        """
        Begin.

        :param stored: P841, the control mode.
        :param left_behind: function bits and a set-point of an earlier session stand.
        :param response_time: how long it waits before it answers, ms.
        :param resets_itself: it resets its faults by itself, P861.
        :param magnetizes: current flows for a while before the motor turns, and after.
        """
        needs = switches.get('settings_need', 'nothing') != 'nothing'
        times = {'motor.premagnetization_time_1': 100, 'motor.postmagnetization_time_1': 100}
        settings: dict[str, Any] = {
            # what no setting can change later has to be so from the beginning
            CONTROL_MODE: 'Remote control' if needs else stored,
            'serial.pc_timeout': drive_timeout if needs else 0.0,
            'serial.response_time': response_time,
            'ramp.t11_up': 3.0 if slow else 0.3,
            'ramp.t11_down': 3.0 if slow else 0.3,
            'ramp.t13_stop': 0.3,
            'special.auto_reset': resets_itself,
            'special.restart_time': 3.0,
            **(times if magnetizes else {}),
        }
        far = simulated_drive(self.model, settings=settings, **switches)
        if left_behind:
            far.memory.put(FUNCTION_BITS, _RUNS)
            far.memory.put(SETPOINT, _20_HZ)
        self.begin_with(far, drive_timeout=0.0 if self.method == 'monitor' else drive_timeout)

    def begin_for_each_event(self) -> None:
        """Begin; the bits stay in a fault, so that they show whether the driver removes them."""
        self.begin(bits_in_fault='kept', bits_after_power_on='kept')

    def put_right(self) -> None:
        """Open the terminals for a direction, and leave manual operation."""
        unit = self.rig.far.control_unit
        if self.rig.far.memory.raw('serial.manual_operation'):
            self.automatic_operation()
        for terminal in _TERMINALS:
            if terminal in unit.terminals.closed:
                self.open_terminal(terminal)

    def forget_faults(self) -> None:
        """Reset them at the keypad."""
        self.rig.far.control_unit.press('reset')

    # --- what the drive does ----------------------------------------------------------------------

    @rule(terminal=st.sampled_from(_TERMINALS), wait=WAITS)
    def close_terminal(self, terminal: int, wait: float = 0.4) -> None:
        """Give a direction at a terminal."""
        self.laws.disturbed()
        self.rig.far.control_unit.switch(terminal, True)
        self.let(wait)

    @WHOLE
    @rule(terminal=st.sampled_from(_TERMINALS), wait=WAITS)
    def open_terminal(self, terminal: int, wait: float = 0.4) -> None:
        self.until_noticed()
        self.laws.disturbed()
        self.rig.far.control_unit.switch(terminal, False)
        self.let(wait)

    @WHOLE
    @rule(mode=st.sampled_from(_MODES), wait=WAITS)
    def control_mode_at_keypad(self, mode: str, wait: float = 1.0) -> None:
        """Change P841 at the keypad; what stands of a run command may start the motor by that."""
        self.until_noticed()
        self.laws.disturbed()
        was_remote = self.laws.shown.by_bus
        self.rig.far.set_from_keypad(CONTROL_MODE, mode)
        if not was_remote and self.laws.standing:
            self.laws.started_by_another()
        self.let(max(wait, 2.5))

    @WHOLE
    @rule(direction=st.sampled_from(('', '', 'cw', 'ccw')), wait=WAITS)
    def manual_operation(self, direction: str = '', wait: float = 1.0) -> None:
        """Take control at the keypad on X4, and turn the motor by it."""
        self.until_noticed()
        self.laws.disturbed()
        self.rig.far.control_unit.press('manual')
        # as long as a person takes, at least
        self.let(max(wait, 2.5))
        if direction:
            self.rig.far.control_unit.press(direction)
            self.let(max(wait, 1.0))

    @rule(boot=BOOT_TIMES, wait=WAITS)
    def power_cycle(self, boot: float, wait: float = 1.0) -> None:
        """Take the mains away, and hold the motor by its brake; for longer where nobody sees it."""
        super().power_cycle(boot if boot > _SHORT_BOOT or self._is_seen else 1.5, 0.0)
        self.rig.far.motor.rotor = 0.0
        self.let(wait)

    @property
    def _is_seen(self) -> bool:
        """Whether a motor that starts anew is seen to, though the drive is not lost before."""
        far, link, laws = self.rig.far, self.rig.link, self.laws
        since, value = laws.setpoint_since
        steady = link.whole and laws.now - since > 0.5 and abs(value) > _SEEN_FROM
        slow = far.memory.number('ramp.t11_up') > 1.0
        return steady and slow and abs(far.motor.frequency) > _SEEN_FROM

    @WHOLE
    @precondition(lambda self: self.rig.far.memory.raw('serial.manual_operation'))
    @rule(wait=WAITS)
    def automatic_operation(self, wait: float = 1.0) -> None:
        self.until_noticed()
        self.laws.disturbed()
        self.rig.far.control_unit.press('automatic')
        if self.laws.standing:
            self.laws.started_by_another()
        self.let(wait)

    @WHOLE
    @precondition(lambda self: not self.laws.enabling)
    @rule(direction=st.sampled_from((Bit.CW, Bit.CCW)), wait=WAITS)
    def run_by_another(self, direction: Bit = Bit.CW, wait: float = 1.0) -> None:
        """Let another master run the motor, the way this driver would."""
        self.until_noticed()
        mode = [] if self.laws.shown.by_bus else [(CONTROL_MODE, _REMOTE)]
        self.by_another(*mode, (SETPOINT, _20_HZ), (FUNCTION_BITS, Bit.ENABLE | direction))
        self.laws.started_by_another()
        self.let(wait)

    @WHOLE
    @precondition(lambda self: not self.rig.far.motor.driven)
    @rule(wait=WAITS)
    def factory_setting(self, wait: float = 2.5) -> None:
        """Let another master start the factory setting."""
        self.until_noticed()
        self.by_another(('fieldbus.factory_setting', 100))
        self.let(wait)

    # --- what ends a ride -------------------------------------------------------------------------

    def standard_at_keypad(self, wait: float) -> None:
        self.control_mode_at_keypad('Standard', wait)

    def keypad_in_control(self, wait: float) -> None:
        self.manual_operation('', wait)

    def opposite_terminal(self, wait: float) -> None:
        """Give the other direction, too, which is none."""
        self.close_terminal(42, wait)
