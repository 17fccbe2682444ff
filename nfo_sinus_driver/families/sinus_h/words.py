# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The status word of the Sinus H [M3 §7.2].

Bits 1, 2, 4, 5 and 9 of ZSW1 come back as they were sent [C104]: that they stand says that the
drive has heard, and nothing of the motor, for which the actual value speaks.
"""

from __future__ import annotations

from nfo_sinus_driver.catalog.status import Fact, State
from nfo_sinus_driver.families._telegram1 import method
from nfo_sinus_driver.families._telegram1.method import Words
from nfo_sinus_driver.families._telegram1.profidrive import Status, state_of

STATUS_WORD = Words(
    state=state_of,
    by_bit={
        Status.READY_ON: Fact.READY,
        Status.FAULT: Fact.FAULT,
        Status.SWITCHING_ON_INHIBITED: Fact.SWITCH_ON_DISABLED,
        Status.WARNING: Fact.ALARM,
        Status.SETPOINT_REACHED: Fact.SETPOINT_REACHED,
        # the drive has received that the PLC commands it
        Status.CONTROL_REQUESTED: Fact.NETWORK_CONTROL,
    },
    # bit 2 is what the driver has commanded: with the state it reports that [C63]
    by_state={State.OPERATION_ENABLED: Fact.OPERATION_ENABLED},
    stateless=True,
    code=method.code_by(state_of, fault=Status.FAULT, warning=Status.WARNING),
    by_frequency=True,
    only_frequency=True,
)
