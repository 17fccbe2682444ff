# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive behind a PLC that is looked at seldom, as one of many at a gateway."""

from __future__ import annotations

import pytest
from support.rig import WAYS, Rig


@pytest.mark.parametrize('way', [way for way in WAYS if way.startswith('telegram1')])
def test_a_motor_that_is_loaded_is_not_stopped_although_it_is_looked_at_seldom(way: str) -> None:
    with Rig(way, poll_rate=4.0) as rig:
        rig.turn()
        advance_to = rig.far.advance_to

        def loaded(now: float) -> None:
            advance_to(now)
            rig.far.motor.rotor *= 0.93
            rig.far.motor.ramp *= 0.93

        rig.far.advance_to = loaded  # type: ignore[method-assign]
        rig.pass_time(3.0)
        assert min(one.frequency for one in rig.notes.snapshots[-8:]) < 19
        assert rig.drive.armed, rig.notes.events
