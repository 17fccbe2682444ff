# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How a simulated MOVITRAC 31.. is fitted out, and what it does where the manual is open."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

from nfo_sinus_driver.simulator.family import Option
from nfo_sinus_driver.simulator.movitrac31.option_cards import CARDS


def _one_of(usual: str, *others: str, text: str) -> str:
    """Return a field that can be several things, and what it is by default."""
    choices = (usual, *others)
    found: str = field(default=usual, metadata={'choices': choices, 'text': text})
    return found


@dataclass(frozen=True)
class Variant:
    """
    One way to fit out a drive, and to read the manual: by default the one its words are nearest to.

    :ivar option_card: the card that is plugged in.
    :ivar interface: what its line is; on ``rs232`` its address is of no significance [M4 §2.4.4].
    :ivar negative_nibble: the first half-byte of a negative number [C70]: the figure is missing.
    :ivar status_numbers: how status and fault stand in index 284 [C105].
    :ivar enable_bit: ``ored``: with an enable at the terminals the bit for it changes nothing, for
        "all subsequent bits are ORed with the terminal signals"; ``anded``: both are needed;
        ``either``: the bit alone will do.
    :ivar timeout_stop: what fault 45 does to the motor: it ``coasts``, or the drive ``ramps`` it
        down as if the enable were gone.
    :ivar outside_remote_control: what becomes of bits and set-point that the control mode has no
        use for [C110]: ``refused``, ``ignored``, or ``taken`` and followed once the mode allows.
    :ivar stop_status: what a drive shows at standstill with an enable and no direction, after
        Normal stop on the way down: ``no_enable``, or ``normal_stop`` still; or ``enable``, then
        and on the way down.
    :ivar settings_need: what a setting is not written without: ``nothing``; ``output_off``, so that
        a driven motor refuses it (1Ch); or the controller ``inhibit`` (2Bh). The manual has these
        return codes and does not say for which parameters.
    :ivar bits_after_power_on: what becomes of bits and set-point by power-off: they are ``cleared``
        or ``kept``.
    :ivar bits_in_fault: what a fault does to the bits: they are ``kept``, or ``cleared``.
    :raises ValueError: one of them cannot be that.
    """

    option_card: str = _one_of(*CARDS, text='the option card that is plugged in')
    interface: str = _one_of('rs485', 'rs232', text='what its line is')
    negative_nibble: str = _one_of('F', '8', '1', text='first half-byte of a negative number')
    status_numbers: str = _one_of(
        'binary', 'bcd', text='how status and fault number stand in index 284'
    )
    enable_bit: str = _one_of(
        'ored',
        'anded',
        'either',
        text='whether the enable of the terminals will do, the bit is needed too, or either does',
    )
    timeout_stop: str = _one_of(
        'coasts', 'ramps', text='what fault 45, PC time-out, does to the motor'
    )
    outside_remote_control: str = _one_of(
        'ignored',
        'refused',
        'taken',
        text='what becomes of function bits and set-point without use in the control mode',
    )
    stop_status: str = _one_of(
        'no_enable',
        'normal_stop',
        'enable',
        text='what is shown at standstill with an enable but no direction',
    )
    settings_need: str = _one_of(
        'nothing', 'output_off', 'inhibit', text='what has to be so for a setting to be written'
    )
    bits_after_power_on: str = _one_of(
        'cleared', 'kept', text='what becomes of function bits and set-point by power-off'
    )
    bits_in_fault: str = _one_of('kept', 'cleared', text='what a fault does to the function bits')

    def __post_init__(self) -> None:
        for one in fields(self):
            if getattr(self, one.name) not in one.metadata['choices']:
                raise ValueError(f'{one.name}: choose one of {", ".join(one.metadata["choices"])}')


def _option(name: str, text: str, choices: tuple[str, ...]) -> Option:
    return Option(name, f'of a MOVITRAC: {text} (default: {choices[0]})', choices)


#: The same as options of a drive.
OPTIONS = tuple(
    _option(one.name, one.metadata['text'], one.metadata['choices']) for one in fields(Variant)
)
