# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The telemetry of one drive: what is measured beside the polls, at a rate of its own."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.snapshot import NAN, Telemetry
from nfo_sinus_driver.link import LinkError, Refused

#: Read every time.
FAST = (
    Role.OUTPUT_VOLTAGE,
    Role.OUTPUT_CURRENT,
    Role.OUTPUT_POWER,
    Role.POWER_FACTOR,
    Role.DC_LINK_VOLTAGE,
    Role.ACTUAL_TORQUE,
)
#: Read one after the other, one each time, for they change slowly.
SLOW = (
    Role.MOTOR_TEMPERATURE,
    Role.PT1000_TEMPERATURE,
    Role.OPERATING_TIME,
    Role.RUNNING_TIME,
    Role.BRAKE_TIME,
    Role.ENERGY,
    Role.TOTAL_ENERGY,
)

#: What a drive answers that does not have a parameter, and how often until it is believed.
_NONE_SUCH = frozenset((Refused.ILLEGAL_ADDRESS, Refused.ILLEGAL_FUNCTION))
_DENIALS = 3
#: How often the settings are looked at while telemetry is turned off, s.
_OFF_PERIOD = 0.5


async def watch_telemetry(state: DriveState, yields: Callable[[], bool]) -> None:
    """
    Measure at ``telemetry_rate`` until cancelled; a value the drive does not have stays NaN.

    One that it refuses is NaN until it is asked again: it may only have been busy, or tuning.

    :param yields: tells whether the line is left to others just now.
    """
    values = dict.fromkeys((*FAST, *SLOW), NAN)
    #: How often in a row the drive said that it has none of them.
    denied = dict.fromkeys(values, 0)
    # the first time all are read, so that the first message is whole
    due = deque(SLOW)
    first = True

    async def measure(role: Role) -> None:
        # which firmware it has may be known only later
        if denied[role] >= _DENIALS or not state.nameplate.has(state.model.key(role)):
            return
        try:
            values[role] = await state.measure(role, Priority.TELEMETRY)
            denied[role] = 0
        except Refused as error:
            values[role] = NAN
            # over Classic it says so of everything while it tunes
            denied[role] += error.code in _NONE_SUCH and not state.tuning

    while True:
        started = state.bus.now()
        rate = state.settings.telemetry_rate
        if rate and state.connected and state.responsive and not yields():
            try:
                for role in (*FAST, *due) if first else (*FAST, due[0]):
                    await measure(role)
                due.rotate(-1)
                first = False
                # these two are polled anyway
                polled = {
                    Role.ACTUAL_FREQUENCY: state.frequency,
                    Role.ACTUAL_SPEED: state.speed,
                }
                state.listener.on_telemetry(Telemetry(state.bus.now(), {**values, **polled}))
            except LinkError:
                # the poll says so if the drive is lost
                state.missed()
                values.update(dict.fromkeys(FAST, NAN))
        period = 1 / rate if rate else _OFF_PERIOD
        await state.bus.sleep(period - (state.bus.now() - started))
