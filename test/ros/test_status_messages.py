# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a family of one's own may have that the messages have no constant for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from builtin_interfaces.msg import Time
from nfo_sinus_msgs.msg import DriveStatus
import pytest

from nfo_sinus_driver.catalog import families, load_profile
from nfo_sinus_driver.drive import StopReason
from nfo_sinus_driver.node.messages import drive_status, error_log_entry


def status_of(method: str, reason: StopReason = StopReason.NONE) -> DriveStatus:
    """The status of a drive that is commanded by a method, and otherwise says nothing."""
    nothing = dict.fromkeys(('setpoint', 'setpoint_age', 'actual'), 0.0)
    flags = dict.fromkeys(('connected', 'enabled', 'setpoint_clamped'), False)
    snapshot: Any = SimpleNamespace(
        control_method=method, control_mode='Odd', unit='', status=None, stop_reason=reason,
        **nothing, **flags,
    )
    scale: Any = SimpleNamespace(unit=str, shown=float)
    return drive_status(snapshot, Time(), '', scale, '')


# also the names of constants that mean something else
@pytest.mark.parametrize('method', ['four_bits', 'faulted', 'valid_ready', 'speed'])
def test_a_control_method_with_a_name_of_its_own_is_published_as_custom(method: str) -> None:
    status = status_of(method)
    assert status.control_method == DriveStatus.CUSTOM
    assert status.control_mode == DriveStatus.UNKNOWN


def test_every_shipped_control_method_has_its_constant() -> None:
    methods = {method for name in families() for method in load_profile(name).methods}
    for method in {*methods, 'monitor', 'ds402'}:
        assert status_of(method).control_method == getattr(DriveStatus, method.upper())


def test_every_reason_of_a_stop_has_its_constant_and_every_constant_its_reason() -> None:
    constants = {name: getattr(DriveStatus, name) for name in dir(DriveStatus)}
    prefix = 'REASON_'
    declared = {name: value for name, value in constants.items() if name.startswith(prefix)}
    assert declared == {f'{prefix}{reason.name}': reason for reason in StopReason}
    for reason in StopReason:
        assert status_of('monitor', reason).stop_reason == reason


def test_a_code_beyond_one_byte_in_the_error_log_is_published() -> None:
    entry: Any = SimpleNamespace(code=300, full_text='Odd', operating_time=1.0, age=0.0)
    assert error_log_entry(entry, Time()).code == 255
