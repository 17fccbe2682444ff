# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""How a simulated G2 is on CANopen where the manual leaves it open ([M0 §6.4], [C102])."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from nfo_sinus_driver.simulator.canopen import Profile301
from nfo_sinus_driver.simulator.family import Option

BARE, MINIMAL, FULL = 'bare', 'minimal', 'full'
TABLE, NARROW, WIDE = 'table', 'narrow', 'wide'
FROM_ONE, FROM_ZERO = 'from_one', 'from_zero'
FIRST, SECOND = 'first', 'second'
BY_SHAPE, NONE, HEARTBEAT, GUARDING, BOTH = 'by_shape', 'none', 'heartbeat', 'guarding', 'both'
PRINTED, SHIFTED = '2F7C', '4F7D'
HELD, FREE = 'held', 'free'


def _one_of(usual: str, *others: str, text: str) -> str:
    """Return a field that can be several things, and what it is by default."""
    choices = (usual, *others)
    found: str = field(default=usual, metadata={'choices': choices, 'text': text})
    return found


@dataclass(frozen=True)
class CanopenShape:
    """
    One way to read the chapter on CANopen.

    :ivar canopen_profile: what there is of the communication profile, which the manual leaves
        "TBD". ``full``: identity, texts, heartbeats, guarding; ``minimal``: device type, error
        register, vendor and the heartbeat that a node sends; ``bare``: no object at all. A node
        tells its boot-up and obeys network management in any case.
    :ivar canopen_watch: what it watches a master by: its heartbeat (1016h), guarding (100Ch,
        100Dh), ``both`` or ``none``; ``by_shape``: both where the profile is full, else none.
    :ivar canopen_types: how many bytes values have, which the manual does not print: those of the
        ``table``; ``narrow``: enumerations have one; ``wide``: everything has four.
    :ivar canopen_sub_indices: the elements of arrays count ``from_one``, and sub-index 0 tells how
        many there are; or ``from_zero``, as on PROFIBUS.
    :ivar canopen_acknowledging: which element of InvSt acknowledges: by the order in which
        [M0 table 10] prints them the ``first``.
    :ivar canopen_error_log: where the error log stands: at the index that is printed, at the one
        that its parameters' numbers give [C2], or nowhere.
    :ivar canopen_bus_mode: bus mode is ``held`` as soon as there is communication [M0 §6.4]; or the
        drive is ``free`` to leave it, as on other buses.
    :raises ValueError: one of them cannot be that.
    """

    canopen_profile: str = _one_of(
        FULL, MINIMAL, BARE, text='how much of the communication profile there is'
    )
    canopen_watch: str = _one_of(
        BY_SHAPE, NONE, HEARTBEAT, GUARDING, BOTH, text='what a master can be watched by'
    )
    canopen_types: str = _one_of(TABLE, NARROW, WIDE, text='how many bytes values have')
    canopen_sub_indices: str = _one_of(
        FROM_ONE, FROM_ZERO, text='how the elements of arrays are numbered'
    )
    canopen_acknowledging: str = _one_of(
        FIRST, SECOND, text='which element of InvSt acknowledges'
    )
    canopen_error_log: str = _one_of(PRINTED, SHIFTED, NONE, text='where the error log stands')
    canopen_bus_mode: str = _one_of(
        HELD, FREE, text='whether the module holds the drive in bus mode'
    )

    def __post_init__(self) -> None:
        for one in fields(self):
            if getattr(self, one.name) not in one.metadata['choices']:
                raise ValueError(f'{one.name}: choose one of {", ".join(one.metadata["choices"])}')

    @property
    def profile(self) -> Profile301:
        """What the node has of the communication profile."""
        watch = self.canopen_watch
        if watch == BY_SHAPE:
            watch = BOTH if self.canopen_profile == FULL else NONE
        return Profile301(
            mandatory=self.canopen_profile != BARE,
            optional=self.canopen_profile == FULL,
            consumes_heartbeats=watch in (HEARTBEAT, BOTH),
            guards=watch in (GUARDING, BOTH),
        )


def _option(name: str, text: str, choices: tuple[str, ...]) -> Option:
    return Option(name, f'on CANopen: {text} (default: {choices[0]})', choices)


#: The same as options of a drive.
OPTIONS = tuple(
    _option(one.name, one.metadata['text'], one.metadata['choices'])
    for one in fields(CanopenShape)
)
#: Their names.
NAMES = frozenset(option.name for option in OPTIONS)
