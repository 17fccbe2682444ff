# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""What is published of one poll is of one moment: a status does not lag behind the commands."""

from __future__ import annotations

import pytest
from support.rig import Rig


@pytest.mark.parametrize('way', ['rtu', 'rtu, control word', 'classic', 'movitrac'])
def test_a_fault_that_was_acknowledged_is_not_published_any_more(way: str) -> None:
    with Rig(way) as rig:
        rig.connect()
        rig.enable()
        for phase in range(8):
            rig.far.trip(101 if way == 'movitrac' else 5)
            rig.pass_time(0.5 + phase / 200.0)
            rig.acknowledged += 1
            assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
            rig.notes.snapshots.clear()
            rig.enable()
            rig.pass_time(0.2)
            seen = rig.notes.snapshots
            assert any(one.enabled for one in seen)
            assert not any(one.status and one.status.faulted for one in seen), phase
