# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Each setting and each measured value of a G2, where the manual prints it: written, and read."""

from __future__ import annotations

from typing import Any, cast

import pytest
from support.addresses import packed
from support.ends import Ends, of_g2
from support.rig import Rig

from nfo_sinus_driver.catalog import Role, Value
from nfo_sinus_driver.link import Address, Reply
from nfo_sinus_driver.simulator.classic import Server as ClassicServer
from nfo_sinus_driver.simulator.modbus import server

#: In an order in which none is refused: the current limit before what has to be less.
_LAST = ('motor.i_magn',)


def stands(rig: Rig, ends: Ends) -> bytes | None:
    """What stands at the place that the manual prints; ``None``: there it prints no number."""
    if rig.connection.protocol == 'modbus_rtu':
        return packed(*server(rig.far).read(ends.places[0], len(ends.places)))
    if rig.connection.protocol == 'classic':
        classic = cast(ClassicServer, rig.far.servers['classic'])
        return packed(*map(classic.enquiry, ends.places))
    return None


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'canopen'])
def test_every_setting_is_written_to_where_the_manual_has_it_and_read_from_there(
    connection: str,
) -> None:
    with Rig(connection, allow_communication_changes=True, poll_rate=1.0) as rig:
        rig.connect(parameters=True)
        parameters = rig.drive.parameters
        rows = of_g2(rig.connection.protocol)
        assert len(rows) == (120 if connection == 'classic' else 119)
        assert rows.keys() == parameters.values.keys()
        wrong: list[tuple[str, Value]] = []
        for ends in sorted(rows.values(), key=lambda ends: ends.name in _LAST):
            before = parameters.values[ends.name]
            # and back, so that address and rate stay those of the line
            # what ends all communication is refused
            cut_off = rig.drive.model.profile.cuts_off.get(ends.name)
            wanted = ends.high if ends.low in (before, cut_off) else ends.low
            changes = rig.result(parameters.change({ends.name: wanted}))
            there = stands(rig, ends)
            done = (
                len(changes) == (wanted != before)
                and there in (packed(*ends.words(wanted)), None)
                and rig.far.peek(ends.name) == wanted == parameters.values[ends.name]
                and rig.result(rig.drive.measure(ends.name)) == wanted
            )
            rig.result(parameters.change({ends.name: before}))
            if not done or rig.far.peek(ends.name) != before:
                wrong.append((ends.name, wanted))
        assert wrong == []


# --- what is measured -----------------------------------------------------------------------------

#: By hand from [M0 tables 2, 4, 12]: register and count of words, ids, object; the number there, of
#: Modbus and of Classic, and what that is.
MEASURED: dict[Role | str, tuple[int, int, tuple[int, ...], int, int, int, float]] = {
    Role.OUTPUT_VOLTAGE: (0x3E8, 1, (0xDA,), 0x2077, 231, 231, 231.0),
    Role.OUTPUT_CURRENT: (0x3EC, 2, (0x95,), 0x2078, 81230, 8123, 81.23),
    Role.OUTPUT_POWER: (0x3F0, 2, (0xD9,), 0x2079, 1234, 1234, 1234.0),
    Role.POWER_FACTOR: (0x3F4, 1, (0xDB,), 0x207A, 810, 81, 0.81),
    Role.DC_LINK_VOLTAGE: (0x3F8, 1, (0x14,), 0x207B, 543, 5430, 543.0),
    Role.ACTUAL_FREQUENCY: (0x400, 1, (0xB6,), 0x207D, -123, -123, -12.3),
    Role.ACTUAL_SPEED: (0x264, 1, (0x94,), 0x2016, -345, -345, -345.0),
    Role.ACTUAL_TORQUE: (0x40C, 1, (0x97,), 0x2080, -67, -67, -67.0),
    Role.MOTOR_TEMPERATURE: (0x41C, 1, (0x58,), 0x2084, 456, 456, 45.6),
    Role.PT1000_TEMPERATURE: (0x418, 1, (0x4D,), 0x2083, -87, -87, -8.7),
    Role.OPERATING_TIME: (0x2A8, 2, (0x27, 0x127), 0x2027, 123456, 123456, 12345.6),
    Role.RUNNING_TIME: (0x2AC, 2, (0x28, 0x128), 0x2028, 98765, 98765, 9876.5),
    Role.BRAKE_TIME: (0x420, 2, (0xDD, 0xDE), 0x2085, 87654, 87654, 87654.0),
    Role.ENERGY: (0x5B0, 2, (0xFA, 0xFB), 0x20E9, 1234567, 1234567, 1234.567),
    # thousandths of an MWh
    Role.TOTAL_ENERGY: (0x5B4, 2, (0xFC, 0xFD), 0x20EA, 7654321, 7654321, 7654321.0),
    'status.reg_act': (0x414, 1, (0x4F,), 0x2082, -234, -234, -23.4),
    'status.frq_set': (0x3FC, 1, (0x20,), 0x207C, 211, 211, 21.1),
    'status.spd_set': (0x25C, 1, (0x96,), 0x2014, -1432, -1432, -1432.0),
    'status.trq_set': (0x408, 1, (0x21,), 0x207F, 43, 43, 43.0),
    'status.reg_set': (0x410, 1, (0x4E,), 0x2081, 345, 345, 34.5),
}


def planted(protocol: str) -> dict[tuple[int, int | None], bytes]:
    """What is read where, by index and sub-index, or the ids of a Classic value one by one."""
    found: dict[tuple[int, int | None], bytes] = {}
    for register, count, ids, index, number, coarse, _ in MEASURED.values():
        words = [number >> 16 * place & 0xFFFF for place in range(2)]
        if protocol == 'modbus_rtu':
            found[register, None] = packed(*words[:count])
        elif protocol == 'canopen':
            found[index, None] = number.to_bytes(2 * count, 'little', signed=True)
        else:
            for place, id_ in enumerate(ids):
                found[id_, None] = packed(coarse >> 16 * place & 0xFFFF)
    return found


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'canopen'])
def test_every_measured_value_is_what_stands_where_the_manual_has_it(
    connection: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    named = [key for key in MEASURED if isinstance(key, str)]
    monitor: Any = {'control_method': 'monitor', 'measured': named}
    with Rig(connection, **monitor) as rig:
        there = planted(rig.connection.protocol)
        read = rig.link.read

        def instead(unit: int, address: Address, once: bool) -> Reply:
            reply = read(unit, address, once)
            data = there.get((address.index, address.sub_index))
            return reply if data is None else Reply(data, reply.arrived)

        monkeypatch.setattr(rig.link, 'read', instead)
        rig.connect()
        # the first one is whole
        rig.wait_until(lambda: rig.notes.telemetry)
        shown = rig.notes.telemetry[0]
        found: dict[Role | str, float] = {**shown.values, **shown.measured}
        wanted = {key: pytest.approx(row[-1]) for key, row in MEASURED.items()}
        assert {key: found[key] for key in wanted} == wanted
