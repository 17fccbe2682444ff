# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""An answer to a write that names another value: whose it is."""

from __future__ import annotations

import pytest

from nfo_sinus_driver.link import AnotherValue, DamagedAnswer
from nfo_sinus_driver.link.modbus.other_values import OtherValues
from nfo_sinus_driver.link.modbus.pdu import Write

MEMORY = 0.8


def write(value: int, register: int = 0x10) -> Write:
    return Write(5, register, value.to_bytes(2, 'big'))


def answer(value: int, register: int = 0x10) -> bytes:
    return bytes((5, 6)) + register.to_bytes(2, 'big') + value.to_bytes(2, 'big')


@pytest.fixture
def values() -> OtherValues:
    return OtherValues(MEMORY)


def test_it_is_believed_when_it_comes_again(values: OtherValues) -> None:
    values.sent(write(20), 1.0)
    assert isinstance(values.error_of(write(20), answer(10)), DamagedAnswer)
    values.sent(write(20), 1.4)
    error = values.error_of(write(20), answer(10))
    assert isinstance(error, AnotherValue)
    assert error.data == b'\0\x0a'
    assert error.responded
    assert error.maybe_done


def test_that_of_an_earlier_write_may_be_late(values: OtherValues) -> None:
    values.sent(write(10), 1.0)
    for now in (1.2, 1.4, 1.79):
        values.sent(write(20), now)
        assert values.error_of(write(20), answer(10)) is None
    for now, kind in ((1.81, DamagedAnswer), (2.0, AnotherValue)):
        values.sent(write(20), now)
        assert isinstance(values.error_of(write(20), answer(10)), kind)


def test_two_that_differ_are_not_believed(values: OtherValues) -> None:
    for value in (10, 11, 10, 12):
        values.sent(write(20), 1.0)
        assert isinstance(values.error_of(write(20), answer(value)), DamagedAnswer)


def test_one_that_was_taken_between_is_not_believed(values: OtherValues) -> None:
    values.sent(write(20), 1.0)
    assert isinstance(values.error_of(write(20), answer(10)), DamagedAnswer)
    values.took(write(20))
    assert isinstance(values.error_of(write(20), answer(10)), DamagedAnswer)


def test_another_register_is_no_answer(values: OtherValues) -> None:
    values.sent(write(20), 1.0)
    for _ in range(3):
        assert values.error_of(write(20), answer(20, register=0x11)) is None
        assert values.error_of(write(20), answer(20)) is None
