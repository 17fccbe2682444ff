# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is published of a drive, and when."""

from __future__ import annotations

import math
import time
from types import SimpleNamespace
from typing import Any

from bench import Bench, wait_until
from builtin_interfaces.msg import Time
from connections import needs
from hypothesis import given, strategies as st
from nfo_sinus_msgs.msg import DriveStatus, InvSt, Telemetry
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32, Header

from nfo_sinus_driver.catalog import Kind, families, load_profile
from nfo_sinus_driver.drive import StopReason
from nfo_sinus_driver.node.drive.reporter import Reporter
from nfo_sinus_driver.node.messages.messages import drive_status, error_log_entry
from nfo_sinus_driver.node.messages.serialized import Stamped, float32

#: What a field of 32 bits may hold: rclpy's limit has ten digits, and refuses the greatest itself.
FLOATS = st.floats(width=32).filter(lambda value: not 3.4028234e38 < abs(value) < math.inf)


def status_of(method: str, reason: StopReason = StopReason.NONE) -> DriveStatus:
    """The status of a drive that is commanded by a method, and otherwise says nothing."""
    nothing = dict.fromkeys(('setpoint', 'setpoint_age', 'actual'), 0.0)
    flags = dict.fromkeys(('connected', 'enabled', 'setpoint_clamped'), False)
    snapshot: Any = SimpleNamespace(
        control_method=method, control_mode='Odd', unit='', status=None, stop_reason=reason,
        **nothing, **flags,
    )
    scale: Any = SimpleNamespace(unit=str, shown=float)
    return DriveStatus(**drive_status(snapshot, scale, ''))


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


def _values(type_: type) -> st.SearchStrategy[dict[str, Any]]:
    """Values for some of the fields of a message, the header aside."""
    of_each = {
        'boolean': st.booleans(),
        'uint8': st.integers(0, 0xFF),
        'uint32': st.integers(0, 0xFFFFFFFF),
        'float': FLOATS,
        'double': st.floats(),
        'string': st.text(st.characters(blacklist_characters='\0', codec='utf-8'), max_size=9),
    }
    fields = {
        name: of_each[kind]
        for name, kind in type_.get_fields_and_field_types().items() if name != 'header'
    }
    return st.fixed_dictionaries({}, optional=fields)


@pytest.mark.parametrize('type_', [DriveStatus, InvSt, Telemetry])
@given(data=st.data())
def test_what_is_packed_is_what_rclpy_serializes(type_: type, data: st.DataObject) -> None:
    pack = Stamped(type_).pack
    for _ in range(2):
        fields = data.draw(_values(type_))
        stamp = Time(sec=data.draw(st.integers(0, 2**31 - 1)), nanosec=data.draw(st.integers(0, 9)))
        frame_id = data.draw(st.sampled_from(['', 'base_link']))
        whole = type_(header=Header(stamp=stamp, frame_id=frame_id), **fields)
        packed, expected = pack(stamp, frame_id, fields), serialize_message(whole)
        # what stands in the gaps between the fields is left to chance
        assert len(packed) == len(expected)
        assert str(deserialize_message(packed, type_)) == str(deserialize_message(expected, type_))


@given(FLOATS)
def test_a_float_is_packed_as_rclpy_serializes_it(value: float) -> None:
    assert float32(value) == serialize_message(Float32(data=value))


def test_a_value_that_is_too_great_is_no_message() -> None:
    with pytest.raises(OverflowError):
        float32(1e39)
    with pytest.raises(OverflowError):
        Stamped(DriveStatus).pack(Time(), '', {'actual': -1e39})


def test_a_message_with_other_fields_is_not_packed() -> None:
    for type_ in (JointState, Float32):
        with pytest.raises(TypeError):
            Stamped(type_)


@pytest.mark.parametrize('change', [
    {'connected': False}, {'enabled': True}, {'text': '5 Overload'}, {'kind': Kind.FAULT},
    {'stop': 'a reason'},
], ids=lambda change: next(iter(change)))
def test_what_is_new_or_subscribed_to_is_published_at_once(change: dict[str, Any]) -> None:
    plain = {
        'connected': True, 'enabled': False, 'text': '24 Stop', 'kind': Kind.STATUS, 'stop': None
    }
    reporter: Any = SimpleNamespace(_heard=False, _newest=None)

    def is_urgent(**fields: Any) -> bool:
        return Reporter._is_urgent(reporter, SimpleNamespace(**fields))  # type: ignore[arg-type]

    assert is_urgent(**plain)
    assert not is_urgent(**plain)
    assert is_urgent(**{**plain, **change})
    assert not is_urgent(**{**plain, **change})
    reporter._heard = True
    assert is_urgent(**{**plain, **change})


@needs('own')
def test_what_the_driver_acts_on_is_published_however_seldom_it_polls(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1))
    bench.driver('-p', 'telemetry_rate:=0.0')
    client = bench.client().connected()
    measured = ('actual_speed', 'actual_frequency')
    wait_until(lambda: all(map(client.latest, measured)), 'it was measured')
    client.set_parameters(poll_rate=0.001)
    # the poll under way ends
    time.sleep(0.5)
    before = [len(client.messages[topic]) for topic in measured]
    assert client.enable().success
    with client.setpoints(20.0):
        client.wait_for(
            'status', lambda status: status.enabled and status.setpoint == 20.0, 'it follows'
        )
        drive.inject('fault', bench.drives.overload.code)
        client.wait_for(
            'status',
            lambda status: status.fault and not status.enabled and status.stop_text,
            'a fault',
        )
        overload = bench.drives.overload.code
        client.wait_for('inv_st', lambda message: message.code == overload, 'which one')
    # no message repeats what was measured before
    assert [len(client.messages[topic]) for topic in measured] == before
