# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How an Optimal is commanded by telegram 1, through a PLC [M1].

PLC control, then Enable, then Switch on, each once ZSW1 has confirmed the one before. A stop takes
Switch on away, and the motor ramps; Enable taken away would release it [C109].
"""

from __future__ import annotations

from nfo_sinus_driver.catalog.profile import (
    Profile,
    Read,
    Status as InverterStatus,
    Steps,
    Until,
    one_step,
    try_steps,
)
from nfo_sinus_driver.catalog.speed_mode import SpeedMode
from nfo_sinus_driver.catalog.status import Role
from nfo_sinus_driver.families._telegram1 import method
from nfo_sinus_driver.families._telegram1.method import Telegram1, Words
from nfo_sinus_driver.families.sinus_optimal.words import STATUS_WORD, Status, state_of

_PLC_CONTROL = 1 << 10
_ENABLE = 1 << 3
_SWITCH_ON = 1 << 0
#: The motor is driven, be it to a stop.
_DRIVEN = Status.SWITCHED_ON | Status.STOPPING


class OptimalTelegram1(Telegram1):
    """Control by telegram 1; it has no quick stop [C96]."""

    ready = _PLC_CONTROL
    runs = _SWITCH_ON

    def take_control(self) -> Steps[None]:
        """
        Have PLC control, without Switch on; a motor that still ramps keeps Enable.

        Where Enable is taken away the drive has to show that, too: else what it has shown before
        would be taken for the answer to the Enable that follows [C109].
        """
        word = self.stopping(int((yield Read(method.STATUS))))
        yield method.begin(word)
        enabled = bool(word & _ENABLE)

        def is_taken(status: InverterStatus) -> bool:
            word = status.word or 0
            return bool(word & self.control) and bool(word & Status.ENABLED) == enabled

        yield Until(is_taken)

    def run(self) -> Steps[None]:
        """Enable, then switch on, when the drive shows that it is enabled."""
        yield method.following(self.ready | _ENABLE)
        yield Until(lambda status: bool((status.word or 0) & Status.ENABLED))
        yield method.following(self.ready | _ENABLE | _SWITCH_ON, retry=False)

    def force_stop(self, control_mode: str) -> Steps[bool]:
        """Clear Switch on, then take Enable away, by which the motor is released [C109]."""
        yield from self.remove(control_mode)
        return (yield from try_steps(one_step(method.begin(self.ready))))

    def stopping(self, word: int) -> int:
        """Return the word that keeps Enable where the motor is driven, so that it ramps."""
        return self.ready | _ENABLE if word & _DRIVEN else self.ready


PROFILE = Profile(
    title='NFO Sinus Optimal',
    enable_input='RUN input (DIN1)',
    status_word=Words(
        state=lambda word: state_of(word & 0xFFFF),
        by_bit=STATUS_WORD.by_bit,
        by_state=STATUS_WORD.by_state,
        stateless=True,
        frequency_beside=True,
        code=method.code_by(state_of, fault=Status.FAULT_ACTIVE, warning=Status.ALARM_ACTIVE),
    ),
    holders={},
    methods={'telegram1': OptimalTelegram1},
    setpoints=method.setpoints(150.0),
    active_method=method.active_method,
    writes_and_reads=True,
    # a tenth above what a set-point may be, for a motor may be overhauled
    most={Role.ACTUAL_FREQUENCY: 165.0},
    # 8192 are the nominal speed, and 24576 the most [M1]
    speed_mode=SpeedMode(
        (method.ACTUAL, method.SETPOINT),
        count=lambda nominal: nominal / 8192,
        most=lambda nominal: 3 * nominal,
    ),
)
