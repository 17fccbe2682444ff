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

"""The node of one drive: lifecycle, settings and services; telling is done by `Reporter`."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
import dataclasses
import functools
import threading

from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.lifecycle import LifecycleState
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter

from nfo_sinus_driver.drive import Change
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive.detect import detect_model
from nfo_sinus_driver.drive.settings import AUTO
from nfo_sinus_driver.node.autostart import Autostart
from nfo_sinus_driver.node.commands import Commands
from nfo_sinus_driver.node.drive_parameters import DriveParameters
from nfo_sinus_driver.node.drive_parameters import wanted_state
from nfo_sinus_driver.node.error_log import ErrorLogServices
from nfo_sinus_driver.node.joint import Joint
from nfo_sinus_driver.node.lifecycle import answer_transitions
from nfo_sinus_driver.node.line import Line
from nfo_sinus_driver.node.reporter import Reporter
from nfo_sinus_driver.node.setpoints import Setpoints
from nfo_sinus_driver.node.settings import DRIVE_SETTINGS
from nfo_sinus_driver.node.settings import declare
from nfo_sinus_driver.node.settings import understood
from nfo_sinus_driver.node.tuning import TuningServices

#: How long a stop may wait for the bus before it is said that it is not known, s.
_LONGEST_STOP = 10.0
#: What identifies a drive or how it is commanded cannot change under way.
_ONLY_UNCONFIGURED = ('address', 'model', 'control_method', 'reference', 'classic_dialect')

_Transition = Callable[['DriveNode', LifecycleState], TransitionCallbackReturn]


def _guarded(transition: _Transition) -> _Transition:
    """Log what a transition raises: rclpy swallows it without a word."""

    @functools.wraps(transition)
    def guarded(self: DriveNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(self, state)
        except Exception as error:
            self.get_logger().error(f'{transition.__name__} failed: {error!r}')
            return TransitionCallbackReturn.ERROR

    return guarded


class DriveNode(LifecycleNodeMixin, Node):
    """
    A managed node for one drive.

    :param line: the bus and the nodes that share it.
    :raises rclpy.exceptions.ParameterException: an override of a setting is wrong.
    :raises ValueError: settings that contradict each other; the message says how.
    """

    def __init__(self, name: str, line: Line) -> None:
        # parameters have the default group, so lifecycle gets one of its own: neither may wait
        # for the other, and commands for none of them
        Node.__init__(self, name)
        LifecycleNodeMixin.__init__(self, callback_group=MutuallyExclusiveCallbackGroup())
        # autostart changes the state, too, and from a thread of its own
        self._in_transition = threading.Lock()
        answer_transitions(self, self._in_transition)
        self._line = line
        values = declare(self, DRIVE_SETTINGS)
        if not values['gear_ratio']:
            raise ValueError('gear_ratio 0: motor turns per turn of the shaft, never 0')
        self.settings = self._drive_settings(values)
        joint = Joint(
            lambda: self.get_parameter('joint_name').value or self.get_name(),
            lambda: self.get_parameter('gear_ratio').value,
        )
        self._reporter = Reporter(self, line, joint)
        #: What ``model: auto`` stands for, as far as it is known.
        self._found_model = DriveSettings().model
        self._drive = Drive(line.bus, self._concrete, self._reporter)
        self.drive_parameters = DriveParameters(self)
        self._wanted = wanted_state(self, self._drive)
        self._reporter.start(lambda: self._drive)
        self.add_on_set_parameters_callback(self._check_settings)
        self.add_post_set_parameters_callback(self._take_settings)
        self._commands = Commands(self)
        self._setpoints = Setpoints(self, line, joint)
        ErrorLogServices(self, self._commands, self._reporter.stamp)
        self._tuning = TuningServices(self, self._reporter.stamp)
        self._autostart_wanted = bool(values['autostart'])
        self._autostart = Autostart(name, self._try_to_start)
        self._autostart_complaint = ''
        self._barred = False

    def start(self) -> None:
        """Look for the drive, if that was wanted."""
        if self._autostart_wanted:
            self._autostart.start()

    def join(self, timeout: float) -> None:
        """Wait for what :meth:`start` began, but not for ever (s)."""
        self._autostart.join(timeout)

    @property
    def state(self) -> str:
        """The lifecycle state's label, such as ``active``."""
        label: str = self._state_machine.current_state[1]
        return label

    @property
    def is_silent(self) -> bool:
        """Its drive does not respond, although somebody has configured the node."""
        return self.state != 'unconfigured' and not self._drive.snapshot.connected

    def why_not_active(self) -> str:
        """Return why the node is not active, and what to do."""
        if self.state == 'finalized':
            return 'the node was shut down: start the driver again'
        if self._autostart_complaint:
            return f'the drive has not answered yet: {self._autostart_complaint}'
        return f'the node is {self.state}: activate it first'

    def stop_for_good(self, patience: float) -> Future[str]:
        """
        Stop the motor, and see to it that nobody can start it again.

        :param patience: how long the drive may take to confirm it, s.
        """
        self._barred = True
        self._autostart.give_up()
        self._setpoints.be_quiet(True)
        return self._drive.stop_for_good(patience)

    @property
    def later_parameters(self) -> list[str]:
        """The names of the parameters that will be declared when the drive is there."""
        return [parameter.key for parameter in self._drive.model.settings]

    @property
    def drive(self) -> Drive:
        """The drive behind this node."""
        return self._drive

    # --- lifecycle ----------------------------------------------------------------------------

    @_guarded
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Identify the drive and watch it from then on."""
        if self._barred:
            return TransitionCallbackReturn.FAILURE
        if not self._is_for(self._drive.settings) and self._drive.stop_unconfirmed:
            address = self._drive.settings.address
            self._complain_of_start(f'the stop of the drive at {address} is not confirmed yet')
            return TransitionCallbackReturn.FAILURE
        try:
            if self.settings.model == AUTO:
                detection = detect_model(self._line.bus, self.settings.address)
                self._found_model = self._line.bus.run(detection).result()
            if self._drive.settings != self._concrete:
                before = self._drive.settings
                if before.address == self.settings.address and (
                    before.control_method != self.settings.control_method
                ):
                    self._drive.require_standing().result()
                self._drive = Drive(self._line.bus, self._concrete, self._reporter)
            self._drive.connect(patient=not self._autostart.trying, parameters=True).result()
        except (DriveError, ValueError) as error:
            self._complain_of_start(str(error))
            return TransitionCallbackReturn.FAILURE
        if not self._is_for(self._drive.settings):
            self.get_logger().info('the settings were changed meanwhile: beginning anew')
            self._stop_for('let go', self._disconnect)
            return TransitionCallbackReturn.FAILURE
        self._drive.settings = self._concrete
        self.drive_parameters.declare(self._drive)
        self._apply_wanted_state()
        self._autostart_complaint = ''
        self._note_person()
        return TransitionCallbackReturn.SUCCESS

    @_guarded
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Poll at full rate and take set-points."""
        if self._barred:
            return TransitionCallbackReturn.FAILURE
        self._note_person()
        self._drive.activate()
        self._setpoints.be_quiet(False)
        return super().on_activate(state)

    @_guarded
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the motor and only keep watch; fails if the drive answers and does not stop."""
        self._note_person()
        if not self._let_go('deactivated'):
            self._drive.activate()
            return TransitionCallbackReturn.FAILURE
        return super().on_deactivate(state)

    @_guarded
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give control back and leave the drive alone; fails if it answers and does not stop."""
        self._note_person()
        if not self._let_go('cleaned up'):
            return TransitionCallbackReturn.FAILURE
        self._stop_for('cleaned up', self._disconnect)
        self.drive_parameters.undeclare()
        return TransitionCallbackReturn.SUCCESS

    @_guarded
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the motor and give control back."""
        self._note_person()
        if self._drive.identity is not None:
            self._stop_for('shut down', self._drive.stop)
            self._stop_for('shut down', self._disconnect)
        return TransitionCallbackReturn.SUCCESS

    @_guarded
    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the motor, whatever went wrong, and begin anew."""
        self._stop_for('an error happened', self._drive.stop)
        self._stop_for('an error happened', self._disconnect)
        self.drive_parameters.undeclare()
        return TransitionCallbackReturn.SUCCESS

    def _apply_wanted_state(self) -> None:
        """Bring the drive into the state of the parameter file, once in the life of a process."""
        wanted, self._wanted = self._wanted, {}
        write = self.get_parameter('apply_parameters').value
        if wanted:
            self._drive.parameters.apply(wanted, write=write).result()

    def _disconnect(self) -> Future[str]:
        return self._drive.disconnect(self.settings.shutdown_timeout)

    def _let_go(self, what: str) -> bool:
        """
        Stop the motor; false if the drive answers and its motor is energised all the same.

        One that does not answer is let go: it is told to stop as soon as it answers again.
        """
        self._stop_for(what, self._drive.deactivate)
        return not (self._drive.stop_overdue and self._drive.snapshot.connected)

    def _stop_for(self, what: str, command: Callable[[], Future[str]]) -> None:
        try:
            answer = command().result(_LONGEST_STOP + self.settings.shutdown_timeout)
        except (DriveError, FutureTimeoutError) as error:
            self.get_logger().error(f'{what}, but: {error}')
        else:
            self.get_logger().info(f'{what}: {answer}' if answer else what)

    def _try_to_start(self) -> bool:
        """Configure and activate; return whether the node is active."""
        with self._in_transition:
            # meanwhile somebody else may have taken the lifecycle over
            if not self._autostart.over and self.state == 'unconfigured':
                self.trigger_configure()
            if not self._autostart.over and self.state == 'inactive':
                self.trigger_activate()
            return self.state == 'active'

    def _note_person(self) -> None:
        """Leave the lifecycle to an operator once an operator took a hand in it."""
        if not self._autostart.trying:
            self._autostart.give_up()

    def _complain_of_start(self, text: str) -> None:
        """Log why the drive cannot be configured, once for each reason."""
        if not self._autostart.trying:
            self.get_logger().error(text)
        elif self._line.bus.port_error is not None:
            # the bus node says so already, for all its drives
            self._autostart_complaint = text
        elif text != self._autostart_complaint:
            self._autostart_complaint = text
            self.get_logger().error(f'{text}; trying again for ever')

    # --- settings -----------------------------------------------------------------------------

    def _drive_settings(self, values: dict[str, object]) -> DriveSettings:
        names = {field.name for field in dataclasses.fields(DriveSettings)}
        wanted = {name: value for name, value in values.items() if name in names}
        settings = DriveSettings(**wanted, retries=self._line.retries)  # type: ignore[arg-type]
        self._line.bus.protocol.require_unit(settings.address)
        other = self._line.rival_of(self, settings.address)
        if other is not None:
            raise ValueError(
                f'address {settings.address} belongs to {other.get_name()} already: '
                'every drive on a bus needs an address of its own'
            )
        return settings

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """
        Set parameters for somebody outside, all of them or none.

        Only what comes this way is written to the drive: declaring and following it do not.
        """
        try:
            meant = [understood(parameter, DRIVE_SETTINGS) for parameter in parameter_list]
            admitted = self.drive_parameters.admit(meant)
        except (ValueError, DriveError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        with self.drive_parameters.from_outside():
            return super().set_parameters_atomically(admitted)

    def _check_settings(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._settings_with(parameters)
            changes = self.drive_parameters.write(parameters)
            for parameter in parameters:
                if parameter.name == 'drive_timeout':
                    self._try_drive_timeout(parameter.value, changes)
        except (ValueError, DriveError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _settings_with(self, parameters: list[Parameter]) -> DriveSettings:
        """
        Return the settings as they would be.

        :raises ValueError: they make no sense, or cannot be changed now.
        """
        values = dataclasses.asdict(self.settings)
        del values['retries']
        changed = {parameter.name: parameter.value for parameter in parameters}
        if changed.get('gear_ratio') == 0:
            raise ValueError('gear_ratio 0: motor turns per turn of the shaft, never 0')
        # not read_only for rclpy, so that what was dumped can be loaded
        if changed.get('autostart', self._autostart_wanted) != self._autostart_wanted:
            raise ValueError('autostart is read when the driver starts: give it then')
        for name in _ONLY_UNCONFIGURED:
            if changed.get(name, values[name]) != values[name] and not self._is_loose:
                raise ValueError(
                    f'{name} can only be changed while the node is unconfigured: '
                    'deactivate it and clean it up first'
                )
        return self._drive_settings({**values, **changed})

    def _try_drive_timeout(self, seconds: float, changes: Sequence[Change]) -> None:
        """
        Set the drive's own time-out if the drive is there; else configure does it.

        :param changes: what is undone if the drive does not take it.
        """
        if self.state in ('inactive', 'active') and seconds != self.settings.drive_timeout:
            try:
                self._drive.set_drive_timeout(seconds).result(_LONGEST_STOP)
            except (DriveError, FutureTimeoutError) as error:
                self.drive_parameters.put_back(changes)
                raise DriveError(f'drive_timeout: {error or "not in time"}') from None

    def _take_settings(self, parameters: list[Parameter]) -> None:
        self.settings = self._settings_with(parameters)
        if not self._is_loose:
            self._drive.settings = self._concrete

    @property
    def _concrete(self) -> DriveSettings:
        """
        The settings with a model that is one.

        :raises ValueError: the model that was found has not all that is set.
        """
        if self.settings.model != AUTO:
            return self.settings
        return dataclasses.replace(self.settings, model=self._found_model)

    @property
    def _is_loose(self) -> bool:
        """No drive belongs to the node yet; one that is being looked for does not count."""
        return self.state in ('unconfigured', 'configuring')

    def _is_for(self, settings: DriveSettings) -> bool:
        return all(
            getattr(settings, name) == getattr(self._concrete, name)
            for name in _ONLY_UNCONFIGURED
        )
