# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What ends a run is carried out at once, and answered, however full the line is."""

from __future__ import annotations

from neighbour import neighbour
import pytest
from support.rig import Rig

_STATUS, _INV_ST, _SCMD = 'fieldbus.drive_status', 'fieldbus.inv_st', 'fieldbus.scmd'
#: What the others ask for.
_CHATTER = 'status.frq_act'


def crowd(rig: Rig) -> None:
    """Let others ask without end, as the polls of a long line do."""
    for _ in range(4):
        rig.bus.run(neighbour(rig.bus, rig.drive.params.address(_CHATTER)))


def asked(rig: Rig) -> list[str]:
    """Return what was asked for or written, in order."""
    return [key for _, key, _ in rig.asked]


@pytest.mark.parametrize(
    ('shown_by', 'event'),
    [
        # of a lost RUN input the inverter status says no more than that the motor slows down
        (_STATUS, 'run input'),
        (_STATUS, 'ext'),
        (_STATUS, 'stop'),
        (_INV_ST, 'ext'),
        (_INV_ST, 'stop'),
    ],
)
def test_a_drive_that_stops_is_sent_the_stop_before_others_are_asked(
    shown_by: str, event: str
) -> None:
    with Rig(poll_rate=50.0) as rig:
        rig.turn()
        crowd(rig)
        rig.pass_time(0.5)
        begun = len(rig.asked)

        def happen(key: str, data: bytes | None) -> None:
            """Let it happen just before the next read of this."""
            if (key, data) == (shown_by, None):
                rig.meet = lambda key, data: None
                if event == 'run input':
                    rig.far.set_run_input(False)
                else:
                    rig.far.control_unit.press(event)

        rig.meet = happen
        rig.wait_until(lambda: _SCMD in asked(rig)[begun:], 5.0)
        requests = asked(rig)
        stop = requests.index(_SCMD, begun)
        # the half that showed it, and the other half
        order = [_STATUS, _INV_ST] if shown_by == _STATUS else [_INV_ST, _STATUS]
        assert requests[stop - 2 : stop] == order


def test_a_changed_control_mode_is_answered_before_others_are_asked() -> None:
    with Rig(poll_rate=50.0) as rig:
        rig.connect()
        rig.enable()
        crowd(rig)
        rig.pass_time(0.5)
        begun = len(rig.asked)
        rig.far.set_from_keypad('control.mode', 'Speed')
        rig.wait_until(lambda: _SCMD in asked(rig)[begun:], 5.0)
        assert not rig.drive.following
        requests = asked(rig)
        assert requests[requests.index(_SCMD, begun) - 1] == 'control.mode'


def test_what_goes_on_as_it_did_has_no_claim_on_the_line() -> None:
    with Rig(poll_rate=50.0) as rig:
        rig.turn()
        crowd(rig)
        rig.pass_time(0.5)
        begun = len(rig.asked)
        rig.pass_time(1.0)
        requests = asked(rig)[begun:]
        after = [requests[number + 1] for number, what in enumerate(requests[:-1])
                 if what == _STATUS]
        assert _CHATTER in after
        assert _INV_ST not in after
