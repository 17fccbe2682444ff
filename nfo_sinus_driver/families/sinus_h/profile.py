# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a Sinus H is commanded: by telegram 1, through a PLC on PROFINET [M3].

Every word has bit 10 set, for without it all of it is ignored. OperationDisable stops the motor as
ADV-8 says; out of S4 there is no other way than that, QuickStop and CoastStop [C107].
"""

from __future__ import annotations

from nfo_sinus_driver.catalog.own_parameters import OwnAddresses
from nfo_sinus_driver.catalog.profile import Profile, Read, Steps, Until
from nfo_sinus_driver.catalog.status import Role, State
from nfo_sinus_driver.families._telegram1 import method
from nfo_sinus_driver.families._telegram1.method import Telegram1
from nfo_sinus_driver.families._telegram1.profidrive import OFF, ON, RUN, ControlWord, state_of
from nfo_sinus_driver.families.sinus_h.module import MODULE
from nfo_sinus_driver.families.sinus_h.words import STATUS_WORD


class HTelegram1(Telegram1):
    """Control by telegram 1: switched on, then enabled."""

    coasts = True
    stop_ramp = True
    caution = (
        'at its keypad set PRT-12 Lost Cmd Mode to Free-Run or Dec (from the factory it is None, '
        'and the motor runs on), and PRT-13 to the time after which it does that'
    )
    ready = int(OFF)
    runs = int(ControlWord.ENABLE_OPERATION)
    # bit 9 of ZSW1 is bit 10 of STW1 [C104]
    echoes = True

    def take_control(self) -> Steps[None]:
        """Go to S2, from S4 by way of S3; without its echo S4 does not show [C116]."""
        word = int((yield Read(method.STATUS)))
        if state_of(word & 0xFFFF) is State.OPERATION_ENABLED or not word & self.control:
            yield method.begin(int(ON))
            yield Until(lambda status: status.state is not State.OPERATION_ENABLED)
        yield method.begin(self.ready)
        yield Until(
            lambda status: status.state is State.READY_TO_SWITCH_ON and status.from_bus
        )

    def run(self) -> Steps[None]:
        """SwitchON, then OperationEnable when the drive shows S3."""
        yield method.following(int(ON))
        yield Until(lambda status: status.state is State.SWITCHED_ON)
        yield method.following(int(RUN), retry=False)

    def stopping(self, word: int) -> int:
        """Return OperationDisable: SwitchOFF does not leave S4, whatever ZSW1 shows [C116]."""
        return int(ON)

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Release the motor by CoastStop, which leaves S4 for S1; control is kept [M3 §7.2.1]."""
        yield method.begin(int(OFF & ~ControlWord.NO_COAST_STOP))

    def rapid_stop(self, control_mode: str) -> Steps[None]:
        """Stop by QuickStop, as ADV-8 says, which leaves S4 for S1; control is kept [M3 §6]."""
        yield method.begin(int(OFF & ~ControlWord.NO_QUICK_STOP))


PROFILE = Profile(
    title='Sinus H',
    status_word=STATUS_WORD,
    holders={},
    methods={'telegram1': HTelegram1},
    setpoints=method.setpoints(327.67, forward_only=True),
    module=MODULE,
    bit_fields=method.BIT_FIELDS | {'telegram.alarm_info'},
    active_method=method.active_method,
    writes_and_reads=True,
    # the operation command and STW1 [M3 §7.2.1]
    own_addresses=OwnAddresses('drive_address', frozenset((0x0382, 0x047F)), 'M3 §10; C124'),
    most={Role.ACTUAL_FREQUENCY: 327.67},
)
