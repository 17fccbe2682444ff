# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""A G2 as its drive profile shows it: what is another than by the other control methods."""

from __future__ import annotations

from dataclasses import replace

from nfo_sinus_driver.catalog.profile import Status, Steps
from nfo_sinus_driver.families.sinus_g2 import profile
from nfo_sinus_driver.families.sinus_g2.ds402.method import (
    CONTROL_WORD,
    SETPOINTS,
    STATUS_WORD,
    Ds402,
)
from nfo_sinus_driver.families.sinus_g2.ds402.words import STATUS_WORD as WORD


def _in_charge(status: Status | None) -> Steps[str]:
    """Return the control method: MODE and SCMD leave StatusWord as it is."""
    yield from ()
    return 'ds402'


PROFILE = replace(
    profile.PROFILE,
    status_word=WORD,
    methods={'ds402': Ds402},
    setpoints=SETPOINTS,
    in_charge=_in_charge,
    may_lack={'canopen': (CONTROL_WORD, STATUS_WORD)},
)
