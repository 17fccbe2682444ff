# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A line as slow as it can be: what is still coming is not late, and a drive is used."""

from __future__ import annotations

import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause

SLOWEST = {'rtu': 1200, 'ascii': 1200, 'optimal ascii': 1200, 'classic': 1200, 'movitrac': 9600}


@pytest.mark.parametrize('way', SLOWEST)
def test_a_drive_is_identified_and_turns(way: str) -> None:
    with Rig(way, line={'baud': SLOWEST[way]}) as rig:
        rig.turn()
        assert rig.drive.identity is not None
        assert rig.drive.identity.serial or way not in ('rtu', 'ascii')
        rig.pass_time(10.0)
        assert abs(rig.far.motor.frequency - 20) < 0.2
        assert not rig.notes.said(Cause.LOST_IN_USE)
        assert rig.bus.statistics().timeouts == rig.bus.statistics().damaged == 0
