# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What happens to the drives of each family alone, and the machine for each way to command one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from any_order_machine import BOOT_TIMES, DRIVEN, WAITS, WHOLE, AnyOrder
from any_order_shown import CONTROL_WORD, MODE_BUS, MODE_STOP, RUN_FIELDBUS, TARGETS
from hypothesis import strategies as st
from hypothesis.stateful import initialize, precondition, rule

from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.drive.known.settings import AS_THE_DRIVE_CAN
from nfo_sinus_driver.simulator.family import load
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE, FUNCTION_BITS, SETPOINT
from nfo_sinus_driver.simulator.movitrac31.parameters import Bit, Mode
from nfo_sinus_driver.simulator.sinus_g2.state_machine import TRIES

_CONTROL = 'fieldbus.drive_control'
_SIO_ERR = b'\x04!E00AC\x05'.hex()


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
        drive_timeout=st.sampled_from((0.0, AS_THE_DRIVE_CAN, 2.0)),
        restart_after=st.sampled_from((None, None, 0, 1, 2)),
        keeps=st.booleans(),
        refuses=st.sampled_from(('all', 'all', 'scmd', 'nothing')),
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
        refuses: str = 'all',
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
        if drive_timeout < 0 and not optimal:
            parameters['serial.auto_stop'] = True
        if restart_after is not None and not optimal:
            parameters.update(dict.fromkeys(TRIES.values(), 3))
            parameters.update({'error.rst_dly': restart_after, 'error.tr_time': 1})
        variant = {
            'run_command_in_fault': 'keeps' if keeps else 'drops',
            'refuses_in_fault': refuses,
            'stop_in_tuning': 'refused' if tunes_on else 'taken',
        }
        self.begin_with(
            parameters,
            variant,
            {},
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
        """Let another master write MODE."""
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
        elif self.method == 'ds402':
            commands = [(CONTROL_WORD, word) for word in (0x76, 0x77, 0x7F)]
            self.by_another(*commands, *((target, 100) for target in TARGETS))
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
        before = self.laws.shown.facts()['control mode']
        if self.rig.far.peek('control.mode') != mode:
            self.rig.far.set_from_keypad('control.mode', mode)
        if self.laws.shown.facts()['control mode'] != before:
            self.laws.control_mode_changed()
        # it is not read with every poll
        self.let(max(wait, 2.5))

    # --- what ends a run -------------------------------------------------------------------------

    def press_stop(self, wait: float) -> None:
        self.press('stop', wait)

    def press_ext(self, wait: float) -> None:
        self.press('ext', wait)

    def stop_by_another(self, wait: float) -> None:
        self.write_mode(MODE_STOP, wait)


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
    for option in load('movitrac31').variant.options()
    if option.name != 'option_card'
}


class MovitracOrder(AnyOrder):
    """The rules for a MOVITRAC."""

    protocol = 'movitrac'
    line: ClassVar[Mapping[str, Any]] = {}
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
        drive_timeout=st.sampled_from((0.0, AS_THE_DRIVE_CAN, 2.0)),
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
            'serial.pc_timeout': 2.0 if needs and drive_timeout else 0.0,
            'serial.response_time': response_time,
            'ramp.t11_up': 3.0 if slow else 0.3,
            'ramp.t11_down': 3.0 if slow else 0.3,
            'ramp.t13_stop': 0.3,
            'special.auto_reset': resets_itself,
            'special.restart_time': 3.0,
            **(times if magnetizes else {}),
        }
        self.begin_with(
            settings,
            switches,
            {FUNCTION_BITS: _RUNS, SETPOINT: _20_HZ} if left_behind else {},
            drive_timeout=0.0 if self.method == 'monitor' else drive_timeout,
        )

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
        """Take the mains away, and hold the motor by its brake; longer where no status shows it."""
        super().power_cycle(boot if boot > _SHORT_BOOT or self._is_seen else 1.5, 0.0)
        self.rig.far.motor.rotor = 0.0
        self.let(wait)

    @property
    def _is_seen(self) -> bool:
        """Whether a motor that starts again is stopped, though the drive is not lost before."""
        far, line, laws = self.rig.far, self.rig.line, self.laws
        since, value = laws.setpoint_since
        steady = line.whole and laws.now - since > 0.5 and abs(value) > _SEEN_FROM
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

    # --- what ends a run -------------------------------------------------------------------------

    def standard_at_keypad(self, wait: float) -> None:
        self.control_mode_at_keypad('Standard', wait)

    def keypad_in_control(self, wait: float) -> None:
        self.manual_operation('', wait)

    def opposite_terminal(self, wait: float) -> None:
        """Give the other direction, too, which is none."""
        self.close_terminal(42, wait)


class G2ModeScmd(SinusOrder):
    pass


class G2DriveControl(SinusOrder):
    method = 'drive_control'


class OptimalModeScmd(SinusOrder):
    model = 'sinus_optimal'


class OptimalDriveControl(SinusOrder):
    model = 'sinus_optimal'
    method = 'drive_control'
    reference = 'terminal'


class Classic(SinusOrder):
    protocol = 'classic'
    line: ClassVar[Mapping[str, Any]] = {'response_timeout': 0.1, 'baud': 57600}
    # older firmware does not say who has control while a fault is active
    driver: ClassVar[Mapping[str, Any]] = {'classic_dialect': 'v2.03'}

    def teardown(self) -> None:
        # why it refused something is asked, which clears the serial fault that a refusal is
        frames = [frame['hex'] for frame in self.rig.line.frames]
        self.rig.acknowledged += sum(
            frame == _SIO_ERR
            and any(earlier.endswith('15') for earlier in frames[number - 6 : number])
            for number, frame in enumerate(frames)
        )
        super().teardown()


class ClassicDriveControl(Classic):
    method = 'drive_control'


class Canopen(SinusOrder):
    protocol = 'canopen'


class CanopenDs402(Canopen):
    method = 'ds402'


class G2Monitor(SinusOrder):
    method = 'monitor'


class OptimalMonitor(SinusOrder):
    model = 'sinus_optimal'
    method = 'monitor'


class Movitrac(MovitracOrder):
    pass


class MovitracMonitor(MovitracOrder):
    method = 'monitor'


MACHINES = (
    G2ModeScmd,
    G2DriveControl,
    OptimalModeScmd,
    OptimalDriveControl,
    Classic,
    ClassicDriveControl,
    Canopen,
    CanopenDs402,
    G2Monitor,
    OptimalMonitor,
    Movitrac,
    MovitracMonitor,
)
