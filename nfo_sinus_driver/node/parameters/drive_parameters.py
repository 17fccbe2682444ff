# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The settings of a drive as ROS parameters of its node."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, TimeoutError as FutureTimeoutError
import contextlib
import threading
import time
from typing import TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from nfo_sinus_driver.catalog import Family, Parameter as CatalogParameter, Value
from nfo_sinus_driver.drive import Drive, DriveError, ParameterChange
from nfo_sinus_driver.node.messages.wording import NodeError
from nfo_sinus_driver.node.parameters.parameter_names import require_parameter
from nfo_sinus_driver.node.ros.rclpy_internals import overrides_of, writable

#: How long a change may wait for the bus, s.
_LONGEST_CHANGE = 30.0
#: How often it is checked whether what a client sets has ended, s: a group of rclpy can be asked
#: that, not waited for.
_LOOK_PERIOD = 0.002

_LATER = '; those of the drive are there once the node is configured'
_KINDS = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text'}
_T = TypeVar('_T')


class DriveParameters:
    """
    Keeps the parameters of a node and the settings of its drive the same.

    Both may change: a client that sets a parameter writes to the drive, and a change at the drive
    shows as a parameter event. Declaring and following never write, so the origin of every change
    has to be known: it is this thread, within :meth:`from_outside`, or it is the drive.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._drive: Drive | None = None
        self._declared: set[str] = set()
        self._changed: set[str] = set()
        self._lock = threading.Lock()
        self._outside: int | None = None
        # in the group of the parameter services, so that a value is never changed from both sides
        self._guard = node.create_guard_condition(self._follow, node.default_callback_group)

    # --- from the drive -----------------------------------------------------------------------

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Let what a client sets now end, and keep all parameter services waiting meanwhile."""
        group = self._node.default_callback_group
        while not group.beginning_execution(self._guard):
            time.sleep(_LOOK_PERIOD)
        try:
            yield
        finally:
            group.ending_execution(self._guard)
            if self._node.executor is not None:
                # it did not wait for what could not run
                self._node.executor.wake()

    def declare(self, drive: Drive) -> None:
        """Declare the settings of the drive, with the values that it has; within :meth:`alone`."""
        self._undeclare()
        self._drive = drive
        for key, value in drive.parameters.values.items():
            self._node.declare_parameter(
                key, value, descriptor(drive, key, value), ignore_override=True
            )
            self._declared.add(key)
        # changes in between
        self.note_changes(self._declared)

    def undeclare(self) -> None:
        """Undeclare them: what the drive has is not known any more."""
        # what is being set would be stored after that, and no declaring could follow
        with self.alone():
            self._undeclare()

    def _undeclare(self) -> None:
        self._drive = None
        while self._declared:
            key = self._declared.pop()
            with writable(self._node, key):
                self._node.undeclare_parameter(key)

    def note_changes(self, keys: Collection[str]) -> None:
        """Have parameters follow the drive; may be called from any thread."""
        with self._lock:
            self._changed.update(keys)
        self._guard.trigger()

    def _follow(self) -> None:
        with self._lock:
            changed, self._changed = self._changed, set()
        drive = self._drive
        if drive is None:
            return
        for key in changed & self._declared:
            value = drive.parameters.values.get(key)
            if value is None or value == self._node.get_parameter(key).value:
                continue
            # the drive is right, even where the manual does not allow its value
            parameter = Parameter(key, value=value)
            shown = descriptor(drive, key, value)
            with writable(self._node, key):
                shown.read_only = False
                self._node.set_descriptor(key, shown, parameter.get_parameter_value())
                self._node.set_parameters([parameter])

    # --- to the drive -------------------------------------------------------------------------

    def validate(self, parameters: Iterable[Parameter]) -> list[Parameter]:
        """
        Return parameters as the drive will have them, or raise why not; nothing is sent.

        Read-only ones with the value of the drive are left out: so a dump can be loaded.
        """
        coerced = [self._coerced(parameter) for parameter in parameters]
        return [parameter for parameter in coerced if not self._is_read_only(parameter.name)]

    def _is_read_only(self, name: str) -> bool:
        drive = self._drive
        return drive is not None and name in self._declared and not drive.model[name].is_setting

    def _coerced(self, parameter: Parameter) -> Parameter:
        require_parameter(self._node, parameter.name, '' if self._drive else _LATER)
        drive = self._drive
        unset = parameter.type_ is Parameter.Type.NOT_SET
        if drive is None or unset or parameter.name not in self._declared:
            return parameter
        known = drive.model[parameter.name]
        value = coerce(known, parameter.value)
        if not known.is_setting and value != drive.parameters.values[parameter.name]:
            raise ValueError(f'{parameter.name} is only read: the drive itself changes it')
        return Parameter(parameter.name, value=drive.parameters.validate(parameter.name, value))

    @contextlib.contextmanager
    def from_outside(self) -> Iterator[None]:
        """What this thread sets meanwhile is for the drive."""
        self._outside = threading.get_ident()
        try:
            yield
        finally:
            self._outside = None

    def write(self, parameters: Iterable[Parameter]) -> tuple[ParameterChange, ...]:
        """
        Write parameters to the drive that a client sets, all or none; return what was changed.

        :raises DriveError: why not; the drive is as it was, or the error says what is not.
        :raises NodeError: the bus does not get to it.
        """
        drive = self._drive
        if drive is None or self._outside != threading.get_ident():
            return ()
        wanted = {
            parameter.name: parameter.value
            for parameter in parameters
            if parameter.name in self._declared
        }
        return self._change(drive, wanted) if wanted else ()

    def put_back(self, changes: Sequence[ParameterChange]) -> None:
        """Undo changes, or raise why not."""
        if changes and self._drive is not None:
            self._change(self._drive, {change.key: change.old for change in changes})

    @staticmethod
    def _change(drive: Drive, wanted: Mapping[str, Value]) -> tuple[ParameterChange, ...]:
        return in_time(drive.parameters.change(wanted), _LONGEST_CHANGE, ', '.join(wanted))


def in_time(future: Future[_T], seconds: float, what: str) -> _T:
    """Return what the bus answers within some time; a NodeError says that it may do it yet."""
    try:
        return future.result(seconds)
    except FutureTimeoutError:
        raise NodeError(
            f'{what}: the bus did not get to it within {seconds:g} s, but may do it yet'
        ) from None


def coerce(parameter: CatalogParameter, given: object) -> Value:
    """Return a value in the type of its parameter, as it was meant, or raise why not."""
    meant = parameter.meant(given) if isinstance(given, Value) else given
    if type(meant) is parameter.kind:
        return meant
    wanted = _KINDS[parameter.kind]
    if _has_list(parameter):
        wanted = f'one of {", ".join(parameter.labels.values())}'
    raise ValueError(f'{parameter.key}: {given!r} is given, but it takes {wanted}')


def _has_list(parameter: CatalogParameter) -> bool:
    """Return whether a parameter takes some values alone; a switch is a boolean."""
    return bool(parameter.labels) and parameter.kind is not bool


def desired_config(node: Node, drive: Drive) -> dict[str, Value]:
    """Return the settings of the drive that were given to its node, by file or by ``-p``."""
    given = overrides_of(node)
    wanted: dict[str, Value] = {}
    for parameter in drive.model.settings:
        if parameter.key in given:
            value = coerce(parameter, given[parameter.key].value)
            # what cannot be reached over this line is reported when the drive is connected
            reached = drive.params.is_addressable(parameter.key)
            wanted[parameter.key] = (
                drive.parameters.coerce(parameter.key, value) if reached else value
            )
    return wanted


def possible_config(drive: Drive, wanted: Mapping[str, Value]) -> dict[str, Value]:
    """Return which of the wanted settings of another drive this one can have, too."""
    possible: dict[str, Value] = {}
    for key, value in wanted.items():
        with contextlib.suppress(DriveError):
            possible[key] = drive.parameters.coerce(key, value)
    return possible


def descriptor(drive: Drive, key: str, value: Value) -> ParameterDescriptor:
    """Return what ``ros2 param describe`` shows; its range takes in what the drive has."""
    parameter = drive.model[key]
    text = ': '.join(filter(None, (parameter.name, parameter.description)))
    unit = f' [{parameter.unit}]' if parameter.unit else ''
    shown = ParameterDescriptor(
        name=key,
        type=Parameter.Type.from_parameter_value(value).value,
        read_only=not parameter.is_setting,
        description=f'{text}{unit}',
        additional_constraints='; '.join(_constraints(parameter, drive.model)),
    )
    if isinstance(value, (bool, str)):
        return shown
    low, high, step = drive.params.limits(key)
    if not parameter.on_step(value):
        # rclpy refuses a value between two steps, and the drive is right
        step = 0.0
    low, high = min(low, value), max(high, value)
    if isinstance(value, int):
        # RegAmp is -1 or 1, and nothing between
        span = IntegerRange(from_value=int(low), to_value=int(high), step=max(1, int(step)))
        shown.integer_range = [span]
    else:
        shown.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=step)]
    return shown


def _constraints(parameter: CatalogParameter, model: Family) -> Iterator[str]:
    if _has_list(parameter):
        yield f'one of {", ".join(parameter.labels.values())}'
    if len(parameter.steps) > 1:
        yield f'steps of {parameter.shown_steps}'
    if parameter.option:
        yield f'needs option {parameter.option}'
    if model.needs_standstill(parameter.key):
        yield 'the motor must be stopped'
    if parameter.key in model.communication:
        yield 'needs allow_communication_changes'
