# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How long it takes to know every parameter of a drive, and to see a change at its keypad.

One drive at 19200 bit/s, as it leaves the factory, polled as fast as the line allows. Prints four
figures; the aims are in docs/performance.md.
"""

from __future__ import annotations

import argparse
import statistics
import time

from driver_rig import NAMES, DriverRig
from rcl_interfaces.srv import GetParameters, ListParameters
from rig import PATIENCE, use_domain
import trace_file
from trace_file import Frame

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.simulator.control import Client

_BAUD_RATE = 19200
_KEY = 'control.accel'
_PLACES = {p.key: p.addresses.get('modbus') for p in load_family('sinus_g2').settings}
_SETTINGS = {place.index for place in _PLACES.values() if place is not None}
_POLLED = {
    load_family('sinus_g2')[key].at('modbus').index
    for key in ('fieldbus.drive_status', 'fieldbus.inv_st', 'status.frq_act', 'status.spd_act')
}


class _Rig(DriverRig):
    """A rig that notes when the parameters are served, before it settles."""

    served_at = 0.0

    def _while_starting(self) -> None:
        client = self.listener.create_client(
            ListParameters, f'/{NAMES[0]}/list_parameters'
        )
        if not client.wait_for_service(PATIENCE):
            raise RuntimeError('there is no service list_parameters')
        while True:
            answer = client.call(ListParameters.Request(), timeout_sec=PATIENCE)
            if answer is not None and _KEY in answer.result.names:
                self.served_at = time.monotonic()
                return
            time.sleep(0.002)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--changes', type=int, default=10, help='changes at the keypad')
    parser.add_argument(
        '--domain', type=int, metavar='ID', help='ROS domain (default: one of its own)'
    )
    options = parser.parse_args()
    use_domain(options.domain)
    with _Rig(_BAUD_RATE, 1) as rig:
        reading = _reading(rig.frames())
        took = reading[-1].last - reading[0].first
        limit = rig.line.limit(reading) - rig.line.gap
        print(f'parameters read: {len(reading) // 2}')
        print(f'reading them all: {took:.3f} s, {took / limit:.3f} of the limit {limit:.3f} s')
        waited = rig.served_at - reading[-1].last
        print(f'declared and served after the last answer: {waited:.3f} s')
        seen = _keypad(rig, options.changes)
        print(
            f'change at the keypad to ros2 param get: median {statistics.median(seen):.1f} s, '
            f'longest {max(seen):.1f} s of {len(seen)}'
        )
        window = rig.watch(rig.driver, 20.0)
        polls, others = _shares(window.frames, rig)
        print(f'of the time, the poll has {100 * polls:.1f} %, reading again {100 * others:.1f} %')
        print(f'without reading again it would poll {1 + others / polls:.3f} times as often,')
        print(f'so it keeps {100 * polls / (polls + others):.1f} % of its rate')


def _reading(frames: list[Frame]) -> list[Frame]:
    """Return the transactions of the first round: from the first setting to the last new one."""
    known: set[int] = set()
    found: list[Frame] = []
    for number, frame in enumerate(frames):
        register = trace_file.read_register(frame.data) if frame.is_request else None
        # before it, the time-out of the drive is read, which are settings too
        if register in _SETTINGS and (found or _follows(frames[number:])):
            if register in known:
                break
            known.add(register)
            found += frames[number : number + 2]
        elif frame.is_request and found:
            break
    return found


def _follows(frames: list[Frame]) -> bool:
    """Tell whether a whole row of settings begins here."""
    requests = [frame for frame in frames if frame.is_request][:5]
    return all(trace_file.read_register(frame.data) in _SETTINGS for frame in requests)


def _keypad(rig: DriverRig, changes: int) -> list[float]:
    """Return how long each change at the keypad takes to the ROS parameter, s."""
    client = rig.listener.create_client(GetParameters, f'/{NAMES[0]}/get_parameters')
    took = []
    with Client.at_link(rig.port) as drive:
        for number in range(changes):
            # at any moment of the round
            time.sleep(0.7 * number % 3)
            value = 6.0 + number
            drive.inject('set', _KEY, value)
            changed_at = time.monotonic()
            while True:
                answer = client.call(GetParameters.Request(names=[_KEY]), timeout_sec=PATIENCE)
                if answer.values[0].double_value == value:
                    break
                time.sleep(0.01)
            took.append(time.monotonic() - changed_at)
    return took


def _shares(frames: list[Frame], rig: DriverRig) -> tuple[float, float]:
    """Return the part of the line that polls have, and that reading parameters again has."""
    spent = {'poll': 0.0, 'settings': 0.0, 'other': 0.0}
    whose = 'other'
    for frame in frames:
        if frame.is_request:
            register = trace_file.read_register(frame.data)
            whose = 'settings' if register in _SETTINGS else 'other'
            whose = 'poll' if register in _POLLED else whose
        spent[whose] += rig.line.limit([frame])
    total = sum(spent.values())
    return spent['poll'] / total, spent['settings'] / total


if __name__ == '__main__':
    main()
