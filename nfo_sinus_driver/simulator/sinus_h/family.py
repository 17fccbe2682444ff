# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the simulator has to know of a Sinus H."""

from __future__ import annotations

from typing import Any

from nfo_sinus_driver.simulator.family import Option, SimulatedFamily
from nfo_sinus_driver.simulator.injections import Argument, Target, Verb
from nfo_sinus_driver.simulator.sinus_h import keypad
from nfo_sinus_driver.simulator.sinus_h.control_unit import CHOICES, KEYS, SinusHControlUnit
from nfo_sinus_driver.simulator.sinus_h.telegram1 import Server


def _press(target: Target, given: dict[str, Any]) -> None:
    unit = target.one.control_unit
    assert isinstance(unit, SinusHControlUnit)
    unit.press(given['key'])


FAMILY = SimulatedFamily(
    control_unit=SinusHControlUnit,
    factory=keypad.FACTORY,
    machine=keypad.with_keypad,
    servers={'telegram1': Server},
    options=(
        Option(
            'unlisted_exits',
            'of the Sinus H: exits of its states that the manual does not list (default: none)',
            CHOICES['unlisted_exits'],
        ),
        Option(
            'echo_bits',
            'of the Sinus H: bits 1 and 2 of ZSW1 tell the state, or those of the control word '
            '(default: state)',
            CHOICES['echo_bits'],
        ),
        Option(
            'keypad_stop',
            'of the Sinus H: what STOP at the keypad does while the fieldbus commands '
            '(default: stops)',
            CHOICES['keypad_stop'],
        ),
    ),
    verbs={
        'keypad': Verb(
            'press a key: start and stop of the keypad, reset of a fault',
            _press,
            (Argument('key', str, 'start, stop or reset', choices=KEYS),),
        ),
    },
)
