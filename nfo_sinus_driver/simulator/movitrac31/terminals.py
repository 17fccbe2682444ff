# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The binary terminals of a MOVITRAC 31.., and what they are assigned to (P600 to P617)."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.movitrac31.codes import Input, Output

#: The terminal that is always CW/Stop, and the one that is the enable from the factory.
CW, ENABLE = 41, 43
#: The output that always is "Brake released".
_BRAKE = 61

#: The bit of each terminal in index 13 [C73].
_BITS: Mapping[int, int] = {
    number: bit
    for bit, number in enumerate(
        (41, 42, 43, 47, 48, 49, 50, 51, 61, 62, 63, 64, 69, 70, 71, 72, 52, 53, 54)
    )
}
#: The binary inputs that each option card adds, and the outputs [M4 §1].
_MORE_INPUTS: Mapping[str, tuple[int, ...]] = {
    'fea': (48, 49, 50, 51),
    'fio': (48, 49, 50, 51, 52, 53, 54),
}
_MORE_OUTPUTS: Mapping[str, tuple[int, ...]] = {'fea': (63, 64), 'fio': (63, 64, 69, 70, 71, 72)}


class Terminals:
    """
    The terminals that there are, and whether each binary input is closed.

    :param card: the option card, which may bring more of them.

    :ivar inputs: the numbers of the binary inputs.
    :ivar closed: those that are closed.
    """

    def __init__(self, memory: Memory, card: str) -> None:
        self._memory = memory
        self.inputs = (CW, 42, ENABLE, 47, *_MORE_INPUTS.get(card, ()))
        self._outputs = (_BRAKE, 62, *_MORE_OUTPUTS.get(card, ()))
        self.closed: frozenset[int] = frozenset()

    def switch(self, number: int, closed: bool) -> None:
        """Close or open a binary input (ValueError: there is no such input)."""
        if number not in self.inputs:
            known = ', '.join(map(str, self.inputs))
            raise ValueError(f'there is no binary input {number}, only {known}')
        self.closed = self.closed | {number} if closed else self.closed - {number}

    def on(self, function: Input) -> bool:
        """Whether an input that has a function is closed."""
        return any(number in self.closed for number in self._having(function))

    def opened(self, function: Input) -> bool:
        """Whether an input that has a function is open, as for those with a slash."""
        return any(number not in self.closed for number in self._having(function))

    def word(self, active: Collection[Output]) -> int:
        """
        Return index 13: a bit for each terminal.

        :param active: the functions of outputs that are on.
        """
        word = sum(1 << _BITS[number] for number in self.closed)
        for number in self._outputs:
            function = self._memory.number(f'terminal.output_{number}')
            if (Output.BRAKE_RELEASED if number == _BRAKE else function) in active:
                word |= 1 << _BITS[number]
        return word

    def _having(self, function: Input) -> tuple[int, ...]:
        return tuple(number for number in self.inputs if self._function(number) == function)

    def _function(self, number: int) -> float:
        if number == CW:
            return Input.CW
        return self._memory.number(f'terminal.input_{number}')
