# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Writing and reading in one transaction (function 23)."""

from __future__ import annotations

from identify_bench import ONE, TWO, Unit, refuses, write_and_read_request
import pytest
from support.addresses import packed

from nfo_sinus_driver.link.interface import NoAnswer, NotReady
from nfo_sinus_driver.link.modbus_pdu import WriteAndRead


def test_write_and_read() -> None:
    unit = Unit()
    reply = unit.link.write_and_read(1, TWO, packed(1, 2), ONE)
    assert reply.data == packed(1)
    assert reply.arrived == unit.wire.now
    request = WriteAndRead(1, 0x258, packed(1, 2), 0x2A5, 1)
    assert unit.wire.sent[-1][1] == write_and_read_request(request)


def test_its_answer_is_put_in_quarantine_as_that_of_a_read() -> None:
    unit = Unit()
    unit.late[23] = 1.5
    with pytest.raises(NoAnswer) as error:
        unit.link.write_and_read(1, ONE, packed(7), ONE)
    assert error.value.maybe_done
    unit.late.clear()
    # what is written is never held back: it goes alone, for its answer names it
    assert unit.link.write_and_read(1, ONE, packed(7), ONE).data == b''
    assert unit.functions == [23, 6]


def test_what_a_unit_refuses_to_do_in_one_transaction_is_only_written() -> None:
    unit = Unit()
    unit.answers[23] = refuses
    for value in (7, 8):
        assert unit.link.write_and_read(1, ONE, packed(value), ONE).data == b''
    assert unit.functions == [23, 6, 6]


def test_a_stop_goes_between_a_refusal_and_what_is_only_written() -> None:
    unit = Unit()
    unit.answers[23] = refuses
    unit.link.end_listening_if(lambda: bool(unit.functions))
    with pytest.raises(NotReady):
        unit.link.write_and_read(1, ONE, packed(7), ONE)
    assert unit.functions == [23]
