# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Another master reads the same line, against its law: no false value is published, no loss."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from random import Random
from typing import Any

import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, Snapshot
from nfo_sinus_driver.link.modbus import ascii, rtu
from nfo_sinus_driver.link.modbus.link import ReadDevice, ReportSlaveId
from nfo_sinus_driver.link.modbus.pdu import Read, Write, read_of
from nfo_sinus_driver.link.pairs import classic, movitrac

SECONDS = 40.0


def _classic(unit: int, address: Any) -> bytes:
    return classic.encode(classic.Enquiry(unit, address.index))


#: How another master asks a drive for a parameter.
ENCODE: dict[str, Callable[[int, Any], bytes]] = {
    'rtu': lambda unit, address: rtu.encode(read_of(unit, address)),
    'ascii': lambda unit, address: ascii.encode(read_of(unit, address)),
    'classic': _classic,
    'classic v5.0': _classic,
    'movitrac': lambda unit, address: movitrac.encode(movitrac.Enquiry(unit, address.index)),
}
#: How long a status may be missing: a line of 9600 baud has hardly room for two masters.
LONGEST_BREAK = {'rtu': 1.0, 'ascii': 1.0}


def another_master(rig: Rig, connection: str, unit: int, *keys: str) -> None:
    """Let another master ask one drive for parameters in turn, one every 0.1 s."""
    for number, key in enumerate(keys):
        frame = ENCODE[connection](unit, rig.drive.params.address(key))
        rig.line.later(
            rig.clock.now + 0.1 * number,
            lambda frame=frame: rig.line.another_asks(frame, 0.1 * len(keys)),
        )


def require_truth(rig: Rig, connection: str) -> None:
    """Ensure that nothing is published but a motor that runs at 20 Hz, without a long break."""
    published: list[tuple[float, Snapshot]] = []
    rig.notes.on_snapshot = (  # type: ignore[method-assign]
        lambda snapshot: published.append((rig.clock.now, snapshot))
    )
    rig.pass_time(SECONDS)
    for _, shown in published:
        assert abs(shown.frequency - 20) < 0.3, shown
        assert abs(shown.actual - 20) < 0.3, shown
        assert shown.enabled and shown.text == published[0][1].text, shown
    times = [at for at, _ in published] + [rig.clock.now]
    assert max(after - at for at, after in pairwise(times)) < LONGEST_BREAK.get(connection, 3.0)
    assert not rig.notes.said(Cause.LOST_IN_USE)
    (remark,) = rig.bus.remarks
    assert 'another' in remark and 'master' in remark and 'disconnect it' in remark
    assert rig.bus.statistics().foreign_frames > SECONDS / 4


@pytest.mark.parametrize('poll_rate', [50.0, 5.0])
@pytest.mark.parametrize('connection', ENCODE)
def test_nothing_false_is_published_and_the_drive_is_not_lost(
    connection: str, poll_rate: float
) -> None:
    with Rig(connection, poll_rate=poll_rate) as rig:
        rig.turn()
        assert rig.bus.remarks == ()
        key = 'status.dc_link_voltage' if connection == 'movitrac' else 'status.dc_link'
        another_master(rig, connection, 1, key)
        require_truth(rig, connection)


@pytest.mark.parametrize('request_', [ReportSlaveId(1), ReadDevice(1)])
@pytest.mark.parametrize('connection', ['rtu', 'ascii'])
def test_a_master_that_asks_what_the_drive_is_is_another_master(
    connection: str, request_: Any
) -> None:
    with Rig(connection, poll_rate=5.0) as rig:
        rig.turn()
        encode = rtu.encode if connection == 'rtu' else ascii.encode
        rig.line.another_asks(encode(request_), 0.5)
        require_truth(rig, connection)


@pytest.mark.parametrize(('connection', 'rate'), [('rtu', 15.0), ('ascii', 5.0)])
def test_no_reading_and_no_refusal_of_another_master_is_taken_for_ours(
    connection: str, rate: float
) -> None:
    nowhere = 0xEEE0
    encode = rtu.encode if connection == 'rtu' else ascii.encode
    random = Random(1)
    rig = Rig(connection, line={'turnaround': 0.02}, poll_rate=10.0)
    rig.turn()
    requests: list[Any] = [
        read_of(1, rig.drive.params.address('status.dc_link')),
        Read(1, nowhere, 1), Read(1, nowhere, 2),
        Write(1, nowhere, b'\0\1'), Write(1, nowhere, b'\0\1\0\2'),
    ]

    def ask() -> None:
        rig.line.another_sends(encode(random.choice(requests)), rig.clock.now)
        rig.line.later(rig.clock.now + random.uniform(0.5, 1.5) / rate, ask)

    rig.notes.snapshots.clear()
    ask()
    rig.pass_time(20.0)
    assert all(-0.3 < shown.frequency < 20.3 for shown in rig.notes.snapshots)
    assert len(rig.notes.snapshots) > 40
    assert not rig.notes.said(Cause.LOST_IN_USE)
    rig.send(None)
    enabled = 0
    for _ in range(6):
        rig.answer(rig.drive.stop())
        answer = rig.answer(rig.drive.enable())
        assert 'exception' not in answer
        enabled += 'enabled' in answer
    assert enabled >= 3
    assert not rig.notes.said(Cause.CHANGED_AT_DRIVE)
    # the laws of the line are not for what another master asks
    rig.kill()


@pytest.mark.parametrize('connection', ['rtu', 'ascii'])
def test_an_echo_and_another_master_from_the_first_request_are_no_loss(connection: str) -> None:
    with Rig(connection, line={'echo': True}, poll_rate=5.0) as rig:
        another_master(rig, connection, 1, 'status.dc_link')
        rig.connect()
        # a write that meets a request of the other on the line is lost: enable is called again
        assert any('enabled' in rig.answer(rig.drive.enable()) for _ in range(5))
        rig.send(20.0)
        rig.pass_time(3.0)
        rig.notes.events.clear()
        require_truth(rig, connection)


@pytest.mark.parametrize('connection', ['classic', 'movitrac'])
def test_what_another_drive_says_to_another_master_is_not_taken_for_ours(connection: str) -> None:
    keys = (
        ('status.frequency', 'fieldbus.inverter_status') if connection == 'movitrac'
        else ('status.frq_act', 'fieldbus.inv_st')
    )
    with Rig(connection, drives=2, poll_rate=5.0) as rig:
        rig.connect()
        rig.enable()
        # the other drive stands
        rig.send(20.0, 1)
        rig.pass_time(2.0)
        another_master(rig, connection, 2, *keys)
        require_truth(rig, connection)


@pytest.mark.parametrize('connection', ENCODE)
def test_no_other_master_is_reported_where_there_is_only_noise_or_an_echo(connection: str) -> None:
    with Rig(connection, line={'echo': True}) as rig:
        rig.turn()
        random = Random(34)
        for number in range(100):
            noise = random.randbytes(random.randrange(1, 30))
            rig.line.later(
                rig.clock.now + number / 5, lambda noise=noise: rig.line.send(noise)
            )
        rig.pass_time(20.0)
        assert rig.bus.remarks == () and rig.bus.statistics().foreign_frames == 0
