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
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
import dataclasses
import functools
import math
import time

from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.lifecycle import LifecycleState
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float32
from std_srvs.srv import SetBool
from std_srvs.srv import Trigger

from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.node.line import NEWEST
from nfo_sinus_driver.node.line import Line
from nfo_sinus_driver.node.reporter import Reporter
from nfo_sinus_driver.node.settings import DRIVE_SETTINGS
from nfo_sinus_driver.node.settings import declare
from nfo_sinus_driver.node.settings import integers_to_doubles

#: How often autostart looks whether it should try, s.
_AUTOSTART_PERIOD = 0.25
#: How long it rests after a try that failed, at first and at last, s: meanwhile a person may have
#: the lifecycle, and the drives that do answer have the bus.
_AUTOSTART_REST = 1.0
_AUTOSTART_LONGEST_REST = 4.0
#: How long a service waits for the bus before it says that it does not know, s. A start delay of
#: the drive may last an hour.
_LONGEST_COMMAND = 3700.0
_LONGEST_STOP = 10.0
#: What identifies a drive or how it is commanded cannot change under way.
_ONLY_UNCONFIGURED = ('address', 'model', 'control_method')

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
        lifecycle_group = MutuallyExclusiveCallbackGroup()
        Node.__init__(self, name)
        LifecycleNodeMixin.__init__(self, callback_group=lifecycle_group)
        self._line = line
        values = declare(self, DRIVE_SETTINGS)
        self.settings = self._drive_settings(values)
        self._reporter = Reporter(self, line)
        self._drive = Drive(line.bus, self.settings, self._reporter)
        self._reporter.start(lambda: self._drive)
        self.add_pre_set_parameters_callback(
            lambda parameters: integers_to_doubles(parameters, DRIVE_SETTINGS)
        )
        self.add_on_set_parameters_callback(self._check_settings)
        self.add_post_set_parameters_callback(self._take_settings)
        self._create_commands()
        self._told_idle_setpoint = False
        self._autostart_tries = bool(values['autostart'])
        self._autostarting = False
        self._autostart_complaint = ''
        self._autostart_rest = 0.0
        self._autostart_at = 0.0
        self._barred = False
        self._autostart_timer = self.create_timer(
            _AUTOSTART_PERIOD,
            self._autostart,
            callback_group=lifecycle_group,
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )

    @property
    def state(self) -> str:
        """The lifecycle state's label, such as ``active``."""
        label: str = self._state_machine.current_state[1]
        return label

    def stop_for_good(self, patience: float) -> Future[str]:
        """
        Stop the motor, and see to it that nobody can start it again.

        :param patience: how long the drive may take to confirm it, s.
        """
        self._barred = True
        self._autostart_tries = False
        self._told_idle_setpoint = True
        return self._drive.stop_for_good(patience)

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
        if self._drive.settings != self.settings:
            self._drive = Drive(self._line.bus, self.settings, self._reporter)
        try:
            self._drive.connect(patient=not self._autostarting).result()
        except DriveError as error:
            self._complain_of_start(str(error))
            return TransitionCallbackReturn.FAILURE
        if not self._is_for(self._drive.settings):
            self.get_logger().info('the settings were changed meanwhile: beginning anew')
            self._stop_for('let go', self._disconnect)
            return TransitionCallbackReturn.FAILURE
        self._drive.settings = self.settings
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
        self._told_idle_setpoint = False
        return super().on_activate(state)

    @_guarded
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the motor and only keep watch."""
        self._note_person()
        self._stop_for('deactivated', self._drive.deactivate)
        return super().on_deactivate(state)

    @_guarded
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give control back and leave the drive alone."""
        self._note_person()
        self._stop_for('cleaned up', self._disconnect)
        return TransitionCallbackReturn.SUCCESS

    @_guarded
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the motor and give control back."""
        self._note_person()
        self._autostart_timer.cancel()
        if self._drive.identity is not None:
            self._stop_for('shut down', self._drive.stop)
            self._stop_for('shut down', self._disconnect)
        return TransitionCallbackReturn.SUCCESS

    @_guarded
    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the motor, whatever went wrong, and begin anew."""
        self._stop_for('an error happened', self._drive.stop)
        self._stop_for('an error happened', self._disconnect)
        return TransitionCallbackReturn.SUCCESS

    def _disconnect(self) -> Future[str]:
        return self._drive.disconnect(self.settings.shutdown_timeout)

    def _stop_for(self, what: str, command: Callable[[], Future[str]]) -> None:
        try:
            answer = command().result(_LONGEST_STOP + self.settings.shutdown_timeout)
        except (DriveError, FutureTimeoutError) as error:
            self.get_logger().error(f'{what}, but: {error}')
        else:
            self.get_logger().info(f'{what}: {answer}' if answer else what)

    def _autostart(self) -> None:
        if not self._autostart_tries:
            self._autostart_timer.cancel()
            return
        if time.monotonic() < self._autostart_at:
            return
        self._autostarting = True
        try:
            if self.state == 'unconfigured':
                self.trigger_configure()
            if self.state == 'inactive':
                self.trigger_activate()
                self._autostart_tries = False
        finally:
            self._autostarting = False
            rest = self._autostart_rest + _AUTOSTART_REST
            self._autostart_rest = min(rest, _AUTOSTART_LONGEST_REST)
            self._autostart_at = time.monotonic() + self._autostart_rest

    def _note_person(self) -> None:
        """Leave the lifecycle to a person once a person took a hand in it."""
        if not self._autostarting:
            self._autostart_tries = False

    def _complain_of_start(self, text: str) -> None:
        """Log why the drive cannot be configured, once for each reason."""
        if not self._autostarting:
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
        other = self._line.owner_of(settings.address)
        if other is not None and other is not self:
            raise ValueError(
                f'address {settings.address} belongs to {other.get_name()} already: '
                'every drive on a bus needs an address of its own'
            )
        return settings

    def _check_settings(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._settings_with(parameters)
            for parameter in parameters:
                if parameter.name == 'drive_timeout':
                    self._try_drive_timeout(parameter.value)
        except (ValueError, DriveError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _settings_with(self, parameters: list[Parameter]) -> DriveSettings:
        values = dataclasses.asdict(self.settings)
        del values['retries']
        changed = {parameter.name: parameter.value for parameter in parameters}
        for name in _ONLY_UNCONFIGURED:
            if changed.get(name, values[name]) != values[name] and not self._is_loose:
                raise ValueError(
                    f'{name} can only be changed while the node is unconfigured: '
                    'deactivate it and clean it up first'
                )
        return self._drive_settings({**values, **changed})

    def _try_drive_timeout(self, seconds: float) -> None:
        """Set the drive's own time-out if the drive is there; else configure does it."""
        if self.state in ('inactive', 'active') and seconds != self.settings.drive_timeout:
            try:
                self._drive.set_drive_timeout(seconds).result(_LONGEST_STOP)
            except FutureTimeoutError:
                raise DriveError('the drive did not take drive_timeout in time') from None

    def _take_settings(self, parameters: list[Parameter]) -> None:
        self.settings = self._settings_with(parameters)
        if not self._is_loose:
            self._drive.settings = self.settings

    @property
    def _is_loose(self) -> bool:
        """No drive belongs to the node yet; one that is being looked for does not count."""
        return self.state in ('unconfigured', 'configuring')

    def _is_for(self, settings: DriveSettings) -> bool:
        return all(
            getattr(settings, name) == getattr(self.settings, name) for name in _ONLY_UNCONFIGURED
        )

    # --- commands -----------------------------------------------------------------------------

    def _create_commands(self) -> None:
        """Give each kind of command a callback group, so that none waits for another."""
        self.create_subscription(
            Float32,
            '~/setpoint',
            self._on_setpoint,
            NEWEST,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
        # reentrant, for to disable must not wait for an enable that waits for a start delay
        group = ReentrantCallbackGroup()
        self.create_service(SetBool, '~/enable', self._on_enable, callback_group=group)
        for name, callback in (
            ('~/stop', self._on_stop),
            ('~/quick_stop', self._on_quick_stop),
            ('~/fault_ack', self._on_fault_ack),
        ):
            group = MutuallyExclusiveCallbackGroup()
            self.create_service(Trigger, name, callback, callback_group=group)

    def _on_setpoint(self, message: Float32) -> None:
        if self.state != 'active':
            return
        if not math.isfinite(message.data):
            self.get_logger().warning(
                f'set-point {message.data} ignored: it is not a finite number',
                throttle_duration_sec=10.0,
            )
            return
        self._drive.set_setpoint(message.data)
        if self._drive.armed:
            self._told_idle_setpoint = False
        elif not self._told_idle_setpoint:
            self._told_idle_setpoint = True
            self.get_logger().info(
                'set-points arrive, but the drive is not enabled: call ~/enable to follow them'
            )

    def _on_enable(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        if not request.data:
            return self._answer(response, self._drive.stop, _LONGEST_STOP)
        if self.state != 'active':
            response.success = False
            response.message = self._why_not_active()
            return response
        return self._answer(response, self._drive.enable, _LONGEST_COMMAND)

    def _why_not_active(self) -> str:
        if self.state == 'finalized':
            return 'the node was shut down: start the driver again'
        if self._autostart_complaint:
            return f'the drive has not answered yet: {self._autostart_complaint}'
        return f'the node is {self.state}: activate it first'

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._answer(response, self._drive.stop, _LONGEST_STOP)

    def _on_quick_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._answer(response, self._drive.quick_stop, _LONGEST_STOP)

    def _on_fault_ack(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return self._answer(response, self._drive.acknowledge, _LONGEST_STOP)

    def _answer(self, response, command: Callable[[], Future[str]], timeout: float):  # type: ignore[no-untyped-def]
        try:
            response.message = command().result(timeout)
            response.success = True
        except DriveError as error:
            response.message = str(error)
            response.success = False
        except FutureTimeoutError:
            response.message = f'the bus did not get to it within {timeout:g} s'
            response.success = False
        except Exception as error:
            # an exception that leaves a service callback would end the executor
            self.get_logger().error(f'error in a service: {error!r}')
            response.message = f'error in the driver: {error}'
            response.success = False
        return response
