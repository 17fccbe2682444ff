# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A G2 as its drive profile shows it: what is another than by the other control methods."""

from __future__ import annotations

from dataclasses import replace

from nfo_sinus_driver.families.sinus_g2 import profile
from nfo_sinus_driver.families.sinus_g2.ds402.method import SETPOINTS, Ds402
from nfo_sinus_driver.families.sinus_g2.ds402.words import STATUS_WORD

PROFILE = replace(
    profile.PROFILE,
    status_word=STATUS_WORD,
    setpoints=SETPOINTS,
    measured=(
        *(target.key for target in SETPOINTS.values()),
        'fieldbus.vl_velocity_demand',
        'status.reg_act',
    ),
    may_lack={'canopen': Ds402.needs},
)
