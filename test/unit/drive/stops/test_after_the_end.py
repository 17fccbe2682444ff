# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What comes when the bus has ended is answered, and nothing is sent for it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest
from support.rig import Rig

from nfo_sinus_driver.catalog import Procedure
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive.broadcast import broadcast_stop
from nfo_sinus_driver.drive.detect import detect_model

CALLS: dict[str, Callable[[Rig], Future[Any]]] = {
    'connect': lambda rig: rig.drive.connect(),
    'enable': lambda rig: rig.drive.enable(),
    'stop': lambda rig: rig.drive.stop(),
    'disconnect': lambda rig: rig.drive.disconnect(1.0),
    'set a parameter': lambda rig: rig.drive.parameters.apply(
        {'control.accel': 1.0}, write=True
    ),
    'tune': lambda rig: rig.drive.tune(next(iter(Procedure))),
    'detect': lambda rig: detect_model(rig.bus, 1),
    'broadcast': lambda rig: broadcast_stop(rig.bus, [rig.drive]),
}


@pytest.mark.parametrize('closed', [True, False], ids=['closed', 'closing'])
@pytest.mark.parametrize('call', CALLS)
def test_a_command_that_comes_then_ends_with_an_error_that_says_so(call: str, closed: bool) -> None:
    with Rig('rtu') as rig:
        rig.connect()
        before = len(rig.line.frames)
        if closed:
            rig.bus.close()
            future = CALLS[call](rig)
        else:
            future = CALLS[call](rig)
            rig.bus.close()
        assert Cause.ENDING in rig.answer(future).causes
        assert len(rig.line.frames) == before
