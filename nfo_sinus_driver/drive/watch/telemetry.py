# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The telemetry of one drive: what is measured beside the polls, at a rate of its own."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import DriveError
from nfo_sinus_driver.drive.known.snapshot import NAN, Telemetry
from nfo_sinus_driver.link import LinkError, Refused

#: Read every time, but by the mailbox of a PLC, which has other work.
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
#: Polled anyway, where the line is not too slow for that.
_POLLED = (Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED)

#: How a drive answers that does not have a parameter, and how often until that is believed.
_NONE_SUCH = frozenset((Refused.ILLEGAL_ADDRESS, Refused.ILLEGAL_FUNCTION))
_DENIALS = 3
#: How often the settings are checked while telemetry is turned off, s.
_OFF_PERIOD = 0.5


async def watch_telemetry(state: DriveState, yields: Callable[[], bool]) -> None:
    """
    Measure at ``telemetry_rate`` until cancelled; a value the drive does not have stays NaN.

    One that it refuses is NaN until the next reading: it may only have been busy, or tuning.

    :param yields: whether the line is left to another drive now.
    """
    key_of, measurements = state.model.key, state.measurements
    #: By key: what was measured, and how often in a row the drive has denied it.
    values: dict[str, float] = {}
    denied: Counter[str] = Counter()
    by_mailbox = [role for role in FAST if state.params.by_mailbox(key_of(role))]
    fast = [role for role in FAST if role not in by_mailbox]
    current = key_of(Role.OUTPUT_CURRENT)
    # what is too slow for the polls
    unpolled = [role for role in _POLLED if state.params.by_mailbox(key_of(role))]
    scale = state.settings.method_class.unfollowed_scale if unpolled else ()
    # the first time all are read, so that the first message is whole
    due = deque((*map(key_of, (*by_mailbox, *SLOW)), *scale))
    first = True

    async def measure(key: str) -> None:
        values.setdefault(key, NAN)
        # which firmware it has may be known only later
        if denied[key] >= _DENIALS or not state.nameplate.has(key):
            return
        try:
            value = await measurements.measure(key, Priority.TELEMETRY, state.status)
            values[key] = measurements.shown(state.model.role_of.get(key), value)
            denied[key] = 0
        except Refused as error:
            values[key] = NAN
            # over Classic it refuses everything so while it tunes
            denied[key] += error.code in _NONE_SUCH and not state.tuning
        if key == current:
            measurements.take_value(Role.OUTPUT_CURRENT, values[key])

    def take_polled(role: Role) -> None:
        above, below = map(values.get, scale, (NAN, NAN)) if scale else (1.0, 1.0)
        # one that is impossible, or not known, is that of the factory [C114]
        scaled = above != below and min(above, below) > 0
        measurements.take_value(role, NAN if scaled else values[key_of(role)])

    while True:
        started = state.bus.now()
        rate = state.settings.telemetry_rate
        if not rate:
            for role in unpolled:
                measurements.take_value(role, NAN)
        if rate and state.contact.connected and state.contact.responsive and not yields():
            try:
                keys = map(key_of, (*fast, *unpolled))
                named = state.measured_keys
                # by a mailbox it would be read too seldom to tell a jam
                needed = (current,) if state.settings.jam_current else ()
                for key in dict.fromkeys((*keys, *needed, *(due if first else (due[0],)), *named)):
                    await measure(key)
                for role in unpolled:
                    take_polled(role)
                due.rotate(-1)
                first = False
                by_role = {role: values.get(key_of(role), NAN) for role in (*FAST, *SLOW)}
                for role in _POLLED:
                    by_role[role] = measurements.shown(role, measurements.last(role).value)
                by_key = {key: values[key] for key in named}
                measurements.note_beside(by_key)
                state.listener.on_telemetry(Telemetry(state.bus.now(), by_role, by_key))
            except (LinkError, DriveError):
                # the poll reports it if the drive is lost, or has to be recognised anew
                state.missed()
                values.update(dict.fromkeys((*map(key_of, FAST), *state.measured_keys), NAN))
                for role in (*unpolled, Role.OUTPUT_CURRENT):
                    measurements.take_value(role, NAN)
        period = 1 / rate if rate else _OFF_PERIOD
        await state.bus.sleep(period - (state.bus.now() - started))
