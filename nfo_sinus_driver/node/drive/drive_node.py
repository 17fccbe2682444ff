# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The node of one drive: the transitions of its lifecycle, and its settings as parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
import dataclasses
import functools
import logging
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock

from nfo_sinus_driver.drive import Cause, Drive, DriveError, DriveSettings, Report
from nfo_sinus_driver.node.drive.bond import Bond
from nfo_sinus_driver.node.drive.bus_context import BusContext
from nfo_sinus_driver.node.drive.callers import Call, publish_calls
from nfo_sinus_driver.node.drive.commands import CommandServices, ErrorLogServices, TuningServices
from nfo_sinus_driver.node.drive.lifecycle import Lifecycle
from nfo_sinus_driver.node.drive.managed_drive import ONLY_UNCONFIGURED, ManagedDrive
from nfo_sinus_driver.node.drive.operating_recorder import OperatingRecorder
from nfo_sinus_driver.node.drive.other_lines import OtherLines, drive_of, is_elsewhere, stop_of
from nfo_sinus_driver.node.drive.reporter import Reporter
from nfo_sinus_driver.node.drive.setpoints import Setpoints
from nfo_sinus_driver.node.messages.messages import Joint
from nfo_sinus_driver.node.messages.scale import Scale, require_factors
from nfo_sinus_driver.node.messages.wording import NodeError, Wording
from nfo_sinus_driver.node.parameters.declaring import coerce, declare
from nfo_sinus_driver.node.parameters.drive_parameters import (
    DriveParameters,
    desired_config,
    in_time,
    possible_config,
)
from nfo_sinus_driver.node.parameters.factory_settings import with_factory_address
from nfo_sinus_driver.node.parameters.parameter_names import did_you_mean
from nfo_sinus_driver.node.parameters.settings import DRIVE_SETTINGS
from nfo_sinus_driver.node.ros.rclpy_internals import overrides_of
from nfo_sinus_driver.operating_record.maintenance import limits
from nfo_sinus_driver.setting import DISABLED

_log = logging.getLogger(__name__)

#: How long a stop may wait for the bus, s.
_LONGEST_STOP = 10.0

_Transition = Callable[['DriveNode', LifecycleState], TransitionCallbackReturn]


def _require_own(values: Mapping[str, Any]) -> None:
    """Make sure that settings of the node alone make sense, or raise a ValueError."""
    require_factors(values)
    limits(values.get('maintenance', ()))


def _guarded(transition: _Transition) -> _Transition:
    """Log what a transition raises: rclpy swallows it without a word."""

    @functools.wraps(transition)
    def guarded(self: DriveNode, state: LifecycleState) -> TransitionCallbackReturn:
        try:
            return transition(self, state)
        except Exception as error:
            _log.exception('%s of %s failed', transition.__name__, self.get_fully_qualified_name())
            self.lifecycle.complain(f'error in the driver: {error!r}', known=False)
            return TransitionCallbackReturn.ERROR

    return guarded


class DriveNode(LifecycleNodeMixin, Node):
    """
    A managed node for one drive, taken into a context.

    :raises rclpy.exceptions.ParameterException: an override of a setting is wrong.
    :raises ValueError: settings that contradict each other; the message says how.
    """

    def __init__(self, name: str, context: BusContext) -> None:
        # parameters have the default group, so lifecycle gets one of its own: neither may wait
        # for the other, and commands for neither
        Node.__init__(self, name)
        LifecycleNodeMixin.__init__(self, callback_group=MutuallyExclusiveCallbackGroup())
        self._bus_context = context
        self._ending = False
        #: What moves the node through its states.
        self.lifecycle = Lifecycle(self)
        family = overrides_of(self).get('family')
        known = with_factory_address(DRIVE_SETTINGS, None if family is None else family.value)
        values = declare(self, known)
        _require_own(values)
        joint = Joint(
            lambda: self.get_parameter('joint_name').value or self.get_name(),
            lambda: self.get_parameter('gear_ratio').value,
        )
        self._drive_parameters = DriveParameters(self)
        queue, follow = context.publish_queue, self._drive_parameters.note_changes
        wording = Wording(self)
        #: What the drive has done.
        self.operating_record = record = OperatingRecorder(
            self, queue, context.memory.line, lambda: self.managed
        )
        reporter = Reporter(
            self, queue, context.black_box, wording, joint, record, lambda: self.managed, follow
        )
        #: The drive of the node.
        self.managed = ManagedDrive(
            self.get_name(),
            wording,
            Scale(
                lambda: self.get_parameter('scale').value, lambda: self.get_parameter('unit').value
            ),
            context.bus,
            context.memory,
            self._drive_settings(values),
            reporter,
            self.lifecycle,
            self._stop_others,
        )
        self._other_lines = OtherLines(
            self,
            queue,
            lambda: [other for other in self.managed.settings.stop_with if not self._beside(other)],
            lambda: self.managed.drive.snapshot.enabled,
        )
        try:
            self._desired = desired_config(self, self.managed.drive)
        except DriveError as error:
            raise ValueError(wording.say(error)) from error
        #: The drive that was last given the wanted settings.
        self._applied_to: Drive | None = None
        self.add_on_set_parameters_callback(self._check_settings)
        self.add_post_set_parameters_callback(self._take_settings)
        self._bond = Bond(self, queue, self._is_there) if context.bond else None
        self._setpoints = Setpoints(self, context, self.managed, joint)
        commands = CommandServices(self, self.managed)
        ErrorLogServices(self, self.managed, commands, reporter.stamp)
        TuningServices(self, self.managed, reporter.stamp)
        publish_calls(self, context.introspection)
        context.add(self.managed)
        context.diagnose.append(reporter.diagnosis)

    def create_subscription(
        self, msg_type: type, *arguments: Any, **options: Any
    ) -> Subscription:
        """Create one; simulated time does not wait for parameters that are being set."""
        if msg_type is Clock:
            options['callback_group'] = MutuallyExclusiveCallbackGroup()
        return super().create_subscription(msg_type, *arguments, **options)

    def stop_for_good(self, patience: float, why: str) -> Future[Report | None]:
        """Stop the motor within ``patience`` s; no client can start it again."""
        self._ending = True
        self.lifecycle.end()
        self._setpoints.be_quiet(True)
        if self._bond is not None:
            # the queue may end before it would be told
            self._bond.beat()
        return self.managed.drive.stop_for_good(patience, Report(Cause.DRIVER_ENDS, by=why))

    def _is_there(self) -> bool:
        """The node is active, as far as nav2's lifecycle manager goes by its bond."""
        # a deactivation may fail, and takes as long as the stop
        return self.lifecycle.state in ('active', 'deactivating') and not self._ending

    def _stop_others(self, why: Report) -> None:
        """Stop the drives that stop with this one; called on the bus."""
        self._other_lines.stop()
        reason = Report(Cause.STOPPED_WITH, drive=self.get_fully_qualified_name(), why=why)
        beside = {self._beside(name) for name in self.managed.settings.stop_with}
        self._bus_context.stop_beside(beside - {self.get_name()}, reason)

    def _beside(self, name: str) -> str:
        """Return which drive of this line a name in ``stop_with`` means; ``''``: none."""
        if not is_elsewhere(name):
            return name
        namespace, _, drive = drive_of(stop_of(self, name)).rpartition('/')
        here = namespace == self.get_namespace().rstrip('/') and drive in self._bus_context.names
        return drive if here else ''

    @property
    def later_parameters(self) -> list[str]:
        """The names of the parameters that are declared once the drive is connected."""
        return [parameter.key for parameter in self.managed.drive.model.kept]

    # --- lifecycle ----------------------------------------------------------------------------

    @_guarded
    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Identify the drive and watch it from then on."""
        if self._ending:
            return TransitionCallbackReturn.FAILURE
        try:
            self.managed.connect(retry=self.lifecycle.by_operator)
        except (DriveError, NodeError, ValueError) as error:
            # the bus node reports a lost port, for all its drives
            port_lost = self._bus_context.bus.port_error is not None
            self.lifecycle.complain(self.managed.wording.say(error), known=port_lost)
            return TransitionCallbackReturn.FAILURE
        with self._drive_parameters.alone():
            is_wanted = self.managed.keep()
            if is_wanted:
                self._drive_parameters.declare(self.managed.drive)
        if not is_wanted:
            self.get_logger().info('the settings were changed meanwhile: beginning again')
            self._stop_for('let go', self.managed.disconnect)
            return TransitionCallbackReturn.FAILURE
        self._apply_desired_config()
        self.lifecycle.note_transition()
        return TransitionCallbackReturn.SUCCESS

    @_guarded
    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Poll at full rate and take set-points."""
        if self._ending:
            return TransitionCallbackReturn.FAILURE
        self.lifecycle.note_transition()
        self.managed.drive.activate()
        self._setpoints.be_quiet(False)
        return super().on_activate(state)

    @_guarded
    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the motor and only watch the drive; fails where the stop is not confirmed."""
        self.lifecycle.note_transition()
        if not self._let_go('deactivated'):
            self.managed.drive.activate()
            return TransitionCallbackReturn.FAILURE
        return super().on_deactivate(state)

    @_guarded
    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Release control and disconnect; fails where the stop is not confirmed."""
        self.lifecycle.note_transition()
        if not self._let_go('cleaned up'):
            return TransitionCallbackReturn.FAILURE
        self._stop_for('cleaned up', self.managed.disconnect)
        if self._may_turn:
            # it is disconnected, and can no more be inactive
            return TransitionCallbackReturn.ERROR
        self._drive_parameters.undeclare()
        return TransitionCallbackReturn.SUCCESS

    @_guarded
    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the motor and release control; fails where the stop is not confirmed."""
        self.lifecycle.note_transition()
        if self.managed.drive.identity is not None:
            self._stop_for('shut down', self.managed.drive.stop)
            self._stop_for('shut down', self.managed.disconnect)
        self._drive_parameters.undeclare()
        # after a failure, too, the node is finalized, and the stop goes on
        may_turn = self._may_turn
        return TransitionCallbackReturn.FAILURE if may_turn else TransitionCallbackReturn.SUCCESS

    @_guarded
    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the motor after any error, and begin anew."""
        self._stop_for('an error happened', self.managed.drive.stop)
        self._stop_for('an error happened', self.managed.disconnect)
        self._drive_parameters.undeclare()
        return TransitionCallbackReturn.SUCCESS

    def _apply_desired_config(self) -> None:
        """Write the parameters of the parameter file to the drive, once in a process."""
        before, drive = self._applied_to, self.managed.drive
        if drive is before:
            return
        wanted, write = self._desired, self.get_parameter('apply_parameters').value
        if before is not None:
            # other settings make it another one, which is to have what clients have set since
            wanted, write = possible_config(drive, before.parameters.wanted), False
        self._applied_to = drive
        if wanted:
            drive.parameters.apply(wanted, write=write).result()

    def _let_go(self, what: str) -> bool:
        """
        Stop the motor; false where the drive does not confirm it and the motor may turn.

        A drive that does not respond is let go, unless this driver may have run its motor.
        """
        return self._stop_for(what, self.managed.drive.deactivate) or not self._may_turn

    @property
    def _may_turn(self) -> bool:
        """The motor may turn by this driver: its stop is not confirmed, and goes on."""
        drive = self.managed.drive
        return drive.stop_unconfirmed or drive.stop_overdue

    def _stop_for(self, what: str, command: Callable[[Report], Future[Any]]) -> bool:
        """Send a command that stops the motor; return whether the drive has confirmed it."""
        say, call = self.managed.wording.say, Call(self, '~/change_state', what)
        try:
            stopping = command(Report(Cause.TRANSITION_REQUESTED, by=call))
            call.find()
            longest = _LONGEST_STOP + self.managed.settings.shutdown_timeout
            answer = in_time(stopping, longest, 'the stop')
        except (DriveError, NodeError) as error:
            self.get_logger().error(f'{what}, but: {say(error)}')
            return False
        self.get_logger().info(f'{what}: {say(answer)}' if answer else what)
        return True

    # --- settings -----------------------------------------------------------------------------

    def _drive_settings(self, values: Mapping[str, object]) -> DriveSettings:
        names = {field.name for field in dataclasses.fields(DriveSettings)}
        wanted = {name: value for name, value in values.items() if name in names}
        retries = self._bus_context.retries
        # ROS has checked the types as they were declared
        settings = DriveSettings(**wanted, retries=retries)  # type: ignore[arg-type]
        settings.require_line(self._bus_context.bus.protocol)
        place = settings.address, settings.block_address
        other = self._bus_context.address_conflict(self.get_name(), *place)
        if other is not None:
            raise ValueError(
                f'address {settings.address} belongs to {other} already: '
                'every drive on a bus needs an address of its own'
            )
        self._require_known(settings.stop_with)
        return settings

    def _require_known(self, names: Sequence[str]) -> None:
        known = self._bus_context.names
        for name in filter(None, names):
            if is_elsewhere(name):
                stop_of(self, name)
            elif name not in known:
                raise ValueError(
                    f'stop_with: there is no drive {name!r} on this line: '
                    f'choose of {", ".join(known)}, or write the full name of one of another '
                    f'line, such as /line2/right{did_you_mean(name, known)}'
                )

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters for a client, all or none; nothing else writes to the drive."""
        try:
            coerced = [coerce(parameter, DRIVE_SETTINGS) for parameter in parameter_list]
            validated = self._drive_parameters.validate(coerced)
        except (ValueError, DriveError) as error:
            reason = self.managed.wording.say(error)
            return SetParametersResult(successful=False, reason=reason)
        with self._drive_parameters.from_outside():
            return super().set_parameters_atomically(validated)

    def _check_settings(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._settings_with(parameters)
            changes = self._drive_parameters.write(parameters)
            try:
                # it may have been enabled while that was written
                self._settings_with(parameters)
                for parameter in parameters:
                    if parameter.name == 'drive_timeout':
                        self._try_drive_timeout(parameter.value)
            except (ValueError, NodeError):
                self._drive_parameters.put_back(changes)
                raise
        except (ValueError, DriveError, NodeError) as error:
            reason = self.managed.wording.say(error)
            return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def _settings_with(self, parameters: list[Parameter]) -> DriveSettings:
        """Return the settings as they would be; a ValueError if they make no sense."""
        changed = {
            parameter.name: parameter.value
            for parameter in parameters
            if parameter.name in DRIVE_SETTINGS
        }
        if not changed:
            # a drive has many of its own, and they come one by one
            return self.managed.settings
        values = dataclasses.asdict(self.managed.settings)
        del values['retries']
        _require_own(changed)
        self._require_same_scale(changed)
        # not read_only for rclpy, so that a dump can be loaded
        autostart = self.get_parameter('autostart').value
        if changed.get('autostart', autostart) != autostart:
            raise ValueError('autostart is read when the driver starts: give it then')
        for name in ONLY_UNCONFIGURED:
            self._require_same(name, changed.get(name, values[name]) == values[name])
        settings = self._drive_settings({**values, **changed})
        self.managed.require_possible(settings)
        means_the_same = settings.telegram_speed == self.managed.settings.telegram_speed
        self._require_same('expected_control_mode, by telegram 1,', means_the_same)
        return settings

    def _require_same(self, name: str, is_same: bool) -> None:
        if not (is_same or self.managed.may_be_another):
            raise ValueError(
                f'{name} can only be changed while the node is unconfigured: '
                'deactivate it and clean it up first'
            )

    def _require_same_scale(self, changed: Mapping[str, object]) -> None:
        for setting in DRIVE_SETTINGS.values():
            if setting.change != DISABLED:
                continue
            name = setting.name
            now = self.get_parameter(name).value
            if changed.get(name, now) == now:
                continue
            # the set-points that go on arriving would mean another speed
            if self.managed.drive.following:
                raise ValueError(f'{name} can only be changed while the drive is not enabled')
            # it could be enabled while that is written, which is not always put back
            if self._writes_drive_timeout(changed):
                raise ValueError(f'{name} and drive_timeout: set one after the other')

    def _try_drive_timeout(self, seconds: float) -> None:
        """Set the drive's own time-out, or raise why not; without a drive configure does it."""
        managed = self.managed
        if self._writes_drive_timeout({'drive_timeout': seconds}):
            try:
                in_time(managed.drive.set_drive_timeout(seconds), _LONGEST_STOP, 'drive_timeout')
            except DriveError as error:
                raise NodeError(f'drive_timeout: {managed.wording.say(error)}') from None

    def _writes_drive_timeout(self, changed: Mapping[str, object]) -> bool:
        """Return whether a change of settings is one of the drive's time-out, too."""
        now = self.managed.settings.drive_timeout
        there = self.managed.state in ('inactive', 'active')
        return there and changed.get('drive_timeout', now) != now

    def _take_settings(self, parameters: list[Parameter]) -> None:
        self.managed.change_settings(self._settings_with(parameters))
        self._other_lines.follow()
