# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The rules by which Hypothesis makes up histories of a drive; see ``any_order_laws.py``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import math
from typing import Any, ClassVar

from any_order_history import POLL_RATE, SETPOINT_TIMEOUT, SHUTDOWN_TIMEOUT
from any_order_laws import Broken, Laws
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, precondition, rule
import pytest
from support.rig import Connection, Rig

from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.simulator.memory import Refused as Refusal

#: How long it takes until the next thing happens, s: within one transaction, a poll, a ramp.
WAITS = st.sampled_from((0.0, 0.004, 0.02, 0.1, 0.4, 1.0, 2.5))
SETPOINTS = st.sampled_from((20.0, -20.0, 0.0, 5.0, 50.0, 400.0, -1e5, 0.004))
#: Faults of the drive, and how long it is silent after power-on, as its machine says.
FAULTS = st.runner().flatmap(lambda machine: st.sampled_from(machine.faults))
BOOT_TIMES = st.runner().flatmap(lambda machine: st.sampled_from(machine.boot_times))
#: What ends a run, likewise.
ENDERS = st.runner().flatmap(lambda machine: st.sampled_from(machine.enders))

WHOLE = precondition(lambda self: self.rig.line.whole)
DRIVEN = precondition(lambda self: self.laws.watched)


class AnyOrder(RuleBasedStateMachine):
    """
    The rules for drives of any family; each ends with some time that passes.

    :cvar line: how its line is, and ``protocol`` what is spoken there.
    :cvar driver: other settings of the driver.
    :cvar faults: codes of some of its faults.
    :cvar boot_times: how long it may be silent after power-on, s.
    :cvar enders: what ends a run, the names of methods that take the time to wait.
    """

    protocol: ClassVar[str] = 'modbus_rtu'
    line: ClassVar[Mapping[str, Any]] = {'response_timeout': 0.1}
    driver: ClassVar[Mapping[str, Any]] = {}
    model: ClassVar[str]
    method: ClassVar[str]
    reference: ClassVar[str] = 'fieldbus'
    faults: ClassVar[Sequence[int]]
    boot_times: ClassVar[Sequence[float]]
    enders: ClassVar[Sequence[str]]

    def __init__(self) -> None:
        super().__init__()
        self.rig: Rig
        self.laws: Laws

    def begin_with(
        self,
        parameters: Mapping[str, Any],
        options: Mapping[str, Any],
        left_behind: Mapping[str, int],
        **settings: Any,
    ) -> None:
        """Begin with a drive in which something stands, and with these settings of the driver."""
        self.rig = Rig(
            self.connection,
            parameters=parameters,
            options=options,
            line=self.line,
            poll_rate=POLL_RATE,
            setpoint_timeout=SETPOINT_TIMEOUT,
            shutdown_timeout=SHUTDOWN_TIMEOUT,
            **settings,
        )
        for key, raw in left_behind.items():
            self.rig.far.memory.put(key, raw)
        self.laws = Laws(self.rig)
        self.connect()
        self.activate()

    @property
    def connection(self) -> Connection:
        """That to its drive."""
        return Connection(
            self.protocol, self.model, self.method, self.reference, driver=self.driver
        )

    def begin_for_each_event(self) -> None:
        """Begin in the way that shows most of what ends a run; each family its own."""
        raise NotImplementedError

    def put_right(self) -> None:
        """Put right what keeps the motor from running, but for a fault; each family its own."""

    def forget_faults(self) -> None:
        """Let the drive end its faults by itself, or as its keypad can."""
        raise NotImplementedError

    def teardown(self) -> None:
        if hasattr(self, 'rig'):
            self.rig.close()

    def let(self, wait: float) -> None:
        """Let time pass, and judge."""
        self.rig.judge(self.rig.looked)
        self.rig.pass_time(wait)

    def until_noticed(self) -> None:
        """Let what has happened last be noticed, if it can be."""
        # a drive without power does not answer, and is not noticed before it has started
        while not self.rig.far.listening and self.rig.line.whole:
            self.rig.pass_time(0.1)
        while self.laws.shown.hides_stop_whole:
            self.rig.pass_time(0.1)
        self.rig.pass_time(self.laws.noticed)

    # --- commands ---------------------------------------------------------------------------------

    @precondition(lambda self: not self.laws.watched)
    @rule(wait=WAITS)
    def connect(self, wait: float = 0.1) -> None:
        future = self.rig.drive.connect(retry=False)
        self.rig.answer(future)
        error = future.exception()
        if error is None:
            self.laws.connected()
        elif not isinstance(error, DriveError):
            raise Broken(f'connect raised {error!r}')
        self.let(wait)

    @DRIVEN
    @rule(wait=WAITS)
    def activate(self, wait: float = 0.1) -> None:
        self.rig.drive.activate()
        self.laws.activated()
        self.let(wait)

    def give(self, name: str, wait: float) -> None:
        # dozens of calls at one moment delay the polls, and show nothing
        if not self.laws.pending(name):
            self.laws.command(name, getattr(self.rig.drive, name)())
        self.let(wait)

    @DRIVEN
    @rule(wait=WAITS)
    def enable(self, wait: float = 1.0) -> None:
        self.give('enable', wait)

    @DRIVEN
    @rule(value=SETPOINTS, wait=WAITS)
    def run(self, value: float = 20.0, wait: float = 1.0) -> None:
        """Enable it and send set-points, as a program does."""
        self.give('enable', 0.4)
        self.send(value, wait)

    @rule(value=SETPOINTS, wait=WAITS)
    def run_motor(self, value: float = 20.0, wait: float = 1.0) -> None:
        """Put right what is in the way, enable it and send set-points."""
        rig, far = self.rig, self.rig.far
        rig.send(None)
        rig.line.mend()
        far.silence(0.0)
        far.motor.load = 0.3
        far.faults.end_causes()
        if self.laws.watched:
            # what happened last may not have been noticed, nor the line be trusted again
            self.let(2.5)
        else:
            self.connect()
        self.activate()
        if far.faults:
            self._answered('acknowledge')
        if not far.control_unit.run_input:
            self.run_input_on()
        self.put_right()
        self._answered('enable')
        self.send(value, wait)

    @rule(value=SETPOINTS, wait=WAITS)
    def another_run(self, value: float, wait: float) -> None:
        self.run_motor(value, wait)

    @rule(value=st.sampled_from((20.0, -50.0)), wait=st.sampled_from((0.4, 1.0)))
    def good_run(self, value: float, wait: float) -> None:
        self.run_motor(value, wait)

    def _answered(self, name: str) -> None:
        if self.method != 'monitor':
            future = getattr(self.rig.drive, name)()
            self.laws.command(name, future)
            self.rig.answer(future)

    @DRIVEN
    @rule(wait=WAITS)
    def enable_without_run_input(self, wait: float = 0.4) -> None:
        self.run_input_off()
        self._answered('enable')
        self.let(wait)

    @DRIVEN
    @rule(wait=WAITS)
    def stop(self, wait: float = 0.4) -> None:
        self.give('stop', wait)

    @rule(wait=WAITS)
    def stop_while_reading(self, wait: float = 0.4) -> None:
        """Stop a run while all the parameters are read, which keeps the line busy."""
        self.run_motor()
        reading = self.rig.drive.parameters.read()
        self.let(0.05)
        self.give('stop', wait)
        # what is measured and polled comes first, on the line of a drive that answers late
        self.rig.answer(reading, 180.0)

    @DRIVEN
    @rule(
        names=st.sampled_from(
            (
                ('enable', 'stop'),
                ('stop', 'enable'),
                ('stop', 'stop'),
                ('enable', 'enable', 'stop'),
                ('enable', 'quick_stop', 'enable'),
                ('quick_stop', 'acknowledge'),
                ('acknowledge', 'acknowledge'),
                ('stop', 'deactivate'),
            )
        ),
        begun=st.sampled_from(('', '', 'enable', 'acknowledge')),
        after=st.sampled_from((0.0, 0.004, 0.02)),
        wait=WAITS,
    )
    def at_once(
        self, names: tuple[str, ...], begun: str = '', after: float = 0.0, wait: float = 0.4
    ) -> None:
        """Let two clients call at the same moment, perhaps while a third one is being served."""
        if begun:
            self.give(begun, after)
        for name in names:
            self.laws.command(name, getattr(self.rig.drive, name)())
        self.let(wait)

    @DRIVEN
    @rule(wait=WAITS)
    def quick_stop(self, wait: float = 0.4) -> None:
        self.give('quick_stop', wait)

    @DRIVEN
    @rule(wait=WAITS)
    def acknowledge(self, wait: float = 0.4) -> None:
        self.give('acknowledge', wait)

    @DRIVEN
    @rule(wait=WAITS)
    def deactivate(self, wait: float = 0.4) -> None:
        self.give('deactivate', wait)

    @DRIVEN
    @rule(wait=WAITS)
    def clean_up(self, wait: float = 0.4) -> None:
        future = self.rig.drive.disconnect(SHUTDOWN_TIMEOUT)
        self.laws.command('disconnect', future)
        self.rig.answer(future)
        self.let(wait)

    @DRIVEN
    @rule(wait=WAITS)
    def shut_down(self, wait: float = 0.4) -> None:
        """End the driver as a signal does, and start another."""
        for name, give in (
            ('stop_for_good', self.rig.drive.stop_for_good),
            ('disconnect', self.rig.drive.disconnect),
        ):
            future = give(SHUTDOWN_TIMEOUT)
            self.laws.command(name, future)
            self.rig.answer(future)
        self.kill(wait)

    @rule(wait=WAITS)
    def kill(self, wait: float = 0.4) -> None:
        """End the driver as a power cut of its computer does, and start another."""
        self.rig.send(None)
        self.rig.kill()
        self.laws.killed()
        self.rig.begin()
        self.let(wait)
        self.connect()
        if self.laws.watched:
            self.activate()

    @DRIVEN
    @rule(code=FAULTS, between=st.sampled_from((0.0, 0.1, 0.4)), wait=WAITS)
    def fault_in_a_run_acknowledged(
        self, code: int, between: float = 0.4, wait: float = 1.0
    ) -> None:
        """Acknowledge a fault that has ended a run, with the run command standing perhaps."""
        self.run_motor()
        self.fault(code, wait=between)
        if self.laws.watched:
            self.give('acknowledge', wait)

    @precondition(lambda self: self.reference == 'fieldbus')
    @rule(value=SETPOINTS, wait=WAITS)
    def set_once(self, value: float = 20.0, wait: float = 0.1) -> None:
        for number in (math.nan, math.inf):
            with pytest.raises(ValueError, match='no number'):
                self.rig.drive.set_setpoint(number)
        self._set(value)
        self.let(wait)

    def _set(self, value: float) -> None:
        self.rig.drive.set_setpoint(value)
        self.laws.gave(value)

    @precondition(lambda self: self.reference == 'fieldbus')
    @rule(value=st.none() | SETPOINTS, wait=WAITS)
    def send(self, value: float | None = 20.0, wait: float = 1.0) -> None:
        """Let a program send set-points from now on, or no more."""
        if self.reference == 'fieldbus':
            self.rig.keep(lambda: None if value is None else self._set(value))
        self.let(wait)

    # --- what the drive does ----------------------------------------------------------------------

    @rule(code=FAULTS, standing=st.booleans(), wait=WAITS)
    def fault(self, code: int, standing: bool = False, wait: float = 0.4) -> None:
        self.laws.disturbed()
        self.rig.far.trip(code, cause_present=standing)
        self.let(wait)

    @precondition(lambda self: self.rig.far.faults)
    @rule(wait=WAITS)
    def end_cause(self, wait: float = 0.4) -> None:
        self.rig.far.faults.end_causes()
        self.let(wait)

    @precondition(lambda self: self.rig.far.faults and self.rig.line.whole)
    @rule(wait=WAITS)
    def end_fault(self, wait: float = 1.0) -> None:
        """Let the drive forget its fault, by its keypad or by itself."""
        self.until_noticed()
        self.laws.disturbed()
        self.rig.far.faults.end_causes()
        self.forget_faults()
        self.let(wait)

    def by_another(self, *writes: tuple[str, int]) -> None:
        """Let another master write raw numbers, until the drive refuses one."""
        self.laws.disturbed()
        for key, raw in writes:
            try:
                self.rig.far.write_raw(key, raw)
            except Refusal:
                return

    @rule(wait=WAITS)
    def run_input_off(self, wait: float = 0.4) -> None:
        self.laws.disturbed()
        self.rig.far.set_run_input(False)
        self.let(wait)

    @WHOLE
    @precondition(lambda self: not self.rig.far.control_unit.run_input)
    @rule(wait=WAITS)
    def run_input_on(self, wait: float = 1.0) -> None:
        self.until_noticed()
        self.laws.disturbed()
        self.rig.far.set_run_input(True)
        self.let(wait)

    @rule(share=st.sampled_from((0.3, 3.0)), wait=WAITS)
    def load(self, share: float, wait: float = 1.0) -> None:
        """Load the motor; 3.0 is more than the current limit lets it turn."""
        self.rig.far.motor.load = share
        self.let(wait)

    @rule(boot=BOOT_TIMES, wait=WAITS)
    def power_cycle(self, boot: float, wait: float = 1.0) -> None:
        self.laws.disturbed()
        self.rig.far.power_cycle(boot)
        self.let(wait)

    @rule(
        event=ENDERS,
        after=st.sampled_from((0.2, 0.2, 1.0)),
        wait=st.sampled_from((1.0, 2.5)),
    )
    def end_run(self, event: str, after: float = 1.0, wait: float = 1.0) -> None:
        """Let something that ends a run happen in one."""
        self.run_motor(wait=after)
        getattr(self, event)(wait=wait)

    def first_fault(self, wait: float) -> None:
        self.fault(self.faults[0], wait=wait)

    def stop_unheard(self, wait: float) -> None:
        """Stop while the next request is lost."""
        self.rig.line.unheard = 1
        self.stop(wait)

    # --- what the line does -----------------------------------------------------------------------

    @WHOLE
    @rule(state=st.sampled_from(('silent', 'deaf', 'noise', 'late', 'gone')), wait=WAITS)
    def break_line(self, state: str, wait: float = 1.0) -> None:
        self.rig.line.state = state
        self.let(wait)

    @rule(
        state=st.sampled_from(('silent', 'noise', 'gone')),
        give=st.sampled_from(('', '', 'stop', 'quick_stop', 'deactivate')),
        seconds=st.sampled_from((4.5, 9.0, 9.0)),
        wait=WAITS,
    )
    def lose_line(self, state: str, give: str, seconds: float, wait: float = 2.5) -> None:
        """Lose the line in a run for so long that the drive is lost; stop it meanwhile."""
        self.run_motor()
        self.break_line(state, wait=0.02)
        if give and self.laws.watched:
            self.give(give, 0.0)
        self.let(seconds)
        self.mend_line(wait)

    @rule(state=st.sampled_from(('silent', 'gone')), wait=WAITS)
    def lose_line_for_long(self, state: str, wait: float) -> None:
        self.lose_line(state, '', 9.0, wait)

    @precondition(lambda self: not self.rig.line.whole)
    @rule(wait=WAITS)
    def mend_line(self, wait: float = 1.0) -> None:
        self.rig.line.mend()
        self.let(wait)

    @WHOLE
    @rule(losses=st.integers(1, 3), wait=WAITS)
    def lose_answers(self, losses: int, wait: float = 0.4) -> None:
        self.rig.line.losses = losses
        self.let(wait)

    @WHOLE
    @rule(share=st.sampled_from((0.01, 0.03, 0.1)), seed=st.integers(0, 999), wait=WAITS)
    def noise(self, share: float = 0.1, seed: int = 0, wait: float = 1.0) -> None:
        """Damage or lose answers by chance, until the line is mended."""
        self.rig.line.make_noise(share, seed)
        self.let(wait)

    @rule(
        share=st.sampled_from((0.03, 0.1)),
        seed=st.integers(0, 999),
        give=st.sampled_from(('stop', 'quick_stop', 'deactivate', 'enable')),
    )
    def run_in_noise(self, share: float, seed: int, give: str) -> None:
        self.run_motor()
        self.noise(share, seed, 2.5)
        if self.laws.watched:
            self.give(give, 1.0)

    @rule(seconds=st.sampled_from((0.05, 0.3, 2.0)), wait=WAITS)
    def hold_silent(self, seconds: float, wait: float = 1.0) -> None:
        self.rig.far.silence(seconds)
        self.let(wait)
