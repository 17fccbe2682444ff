# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Registers and coils of a description: what makes parameters of them, and finds what is wrong."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction

from nfo_sinus_driver.catalog.codec import codec_of
from nfo_sinus_driver.catalog.declared.description import Condition, LineDefaults, StatusPlace
from nfo_sinus_driver.catalog.declared.registers import PULSES, Registers, Use
from nfo_sinus_driver.catalog.declared.yaml_file import Node, Problems
from nfo_sinus_driver.catalog.parameter import Access, Address, Parameter
from nfo_sinus_driver.catalog.profile import Write

WORD = 0xFFFF
_SIGN = 0x8000
#: The group of all that commands the drive and reports its status.
_FIELDBUS = 'Fieldbus'
STATUS_KEY = 'line.status'
#: The number of the fault, where it stands in no register of the status.
FAULT_KEY = 'line.fault'
#: Coils each of which is a command: what is written is the number of the one that is set.
PULSE_KEY = 'line.pulse'
_TYPES = {
    'uint16': 'uint16_be', 'int16': 'sint16_be', 'bcd16': 'bcd16', 'bcd32': 'bcd32',
    'uint32': 'uint32_be', 'int32': 'sint32_be',
}
_LOW_FIRST = {'uint32': 'uint32_ws', 'int32': 'sint32_ws'}
#: More registers are no status that is read as one.
_MOST_OF_STATUS = 8


@dataclass(frozen=True)
class PlacedCondition:
    """A condition as the file has it: the bits of one register, or one coil."""

    register: int
    coil: bool
    mask: int
    values: frozenset[int]
    inverted: bool
    line: int

    def in_place(self, status: StatusPlace) -> Condition:
        """Return the condition on the status word."""
        shift = status.shift(self.register)
        values = frozenset(value << shift for value in self.values)
        return Condition(self.mask << shift, values, self.inverted)


class RegisterMap:
    """
    Makes parameters of what a file says of registers and coils.

    :ivar made: those of commands and status, by key.
    :ivar registers: the use of each register and coil.
    """

    def __init__(self, file: Node, line: LineDefaults, problems: Problems) -> None:
        self._problems = problems
        self._numbering = file.get('line').integer('numbering')
        self._coil_numbering = file.get('line').integer('coil_numbering')
        self._line = line
        self._status_register = file.get('status').get('register')
        #: The status is read by function 04.
        self._inputs = file.get('status').text('table') == 'input'
        self.made: dict[str, Parameter] = {}
        #: Registers as the file has them, by the number that is sent.
        self._written: dict[int, str] = {}
        self.registers = Registers(problems)

    @property
    def functions(self) -> tuple[int, ...]:
        """The functions by which registers are written."""
        return self._line.write

    @property
    def most_registers(self) -> int:
        """How many there may be in one message."""
        return self._line.most_registers

    # --- numbers ---

    def register(self, node: Node) -> int:
        """Return the register as it is sent."""
        sent = self._sent(node, self._numbering, 'register')
        self._written.setdefault(sent, node.written)
        return sent

    def written(self, register: int) -> str:
        """Return a register as the file has it, or would have it."""
        return self._written.get(register) or str(register + self._numbering)

    def coil(self, node: Node) -> int:
        """Return the coil as it is sent."""
        return self._sent(node, self._coil_numbering, 'coil')

    def _sent(self, node: Node, numbering: int, what: str) -> int:
        printed = node.scalar if isinstance(node.scalar, int) else 0
        sent = printed - numbering
        if not 0 <= sent <= WORD:
            self._problems.add(
                node.line,
                f'{what} {printed} cannot be sent: with numbering {numbering} they go from '
                f'{numbering} to {numbering + WORD}',
            )
            return 0
        return sent

    # --- conditions ---

    def condition(self, node: Node, what: str) -> PlacedCondition | None:
        """Return what a condition says; ``None`` if it is none."""
        try:
            return self._condition(node, what)
        except ValueError as error:
            self._problems.add(node.line, str(error))
            return None

    def _condition(self, node: Node, what: str) -> PlacedCondition:
        coil = 'coil' in node
        place = node.get('coil') if coil else node.get('register')
        if place.scalar is None and not coil:
            place = self._status_register
        if coil and 'register' in node:
            raise ValueError(f'{what} names a register and a coil: remove one of both')
        if place.scalar is None:
            raise ValueError(
                f'{what} says not where: add register (or register under status), or coil'
            )
        mask, values, inverted = self._bits(node, what, coil=coil)
        number = self.coil(place) if coil else self.register(place)
        # a whole word may be a value as well, and its highest bit the sign of one
        if mask not in (WORD, _SIGN):
            space = 'coil' if coil else self._status_space
            self.registers.note_use(Use.BITS, what, node.line, space, number)
        return PlacedCondition(number, coil, mask, values, inverted, node.line)

    def _bits(
        self, node: Node, what: str, *, coil: bool
    ) -> tuple[int, frozenset[int], bool]:
        chosen = [name for name in ('bit', 'bits', 'mask') if name in node]
        if len(chosen) > 1 or (coil and chosen):
            raise ValueError(f'{what}: one of bit, bits and mask is enough')
        given = [name for name in ('is', 'value', 'values', 'except') if name in node]
        if len(given) > 1:
            raise ValueError(f'{what}: one of is, value, values and except is enough')
        shift, mask = self._mask(node)
        if coil or 'bit' in node:
            if given and given != ['is']:
                raise ValueError(f'{what}: of one bit say "is: 0" or "is: 1"')
            bit = 1 if coil else mask
            return bit, frozenset((bit if node.integer('is', 1) else 0,)), False
        if not given or given == ['is']:
            raise ValueError(f'{what} says not what the bits are: add value')
        return self._values(node, what, shift, mask)

    def _mask(self, node: Node) -> tuple[int, int]:
        if 'bit' in node:
            return 0, 1 << node.integer('bit')
        if 'bits' in node:
            low, high = (int(item.scalar or 0) for item in node['bits'].items)
            return low, ((1 << max(high - low + 1, 0)) - 1) << low
        return 0, node.integer('mask', WORD)

    def _values(
        self, node: Node, what: str, shift: int, mask: int
    ) -> tuple[int, frozenset[int], bool]:
        if not 0 < mask <= WORD:
            raise ValueError(f'{what}: a register has the bits 0 to 15')
        inverted = 'except' in node
        listed = node.get('except') if inverted else node.get('values')
        numbers = [node.get('value'), *listed.items]
        raw = [int(item.scalar) for item in numbers if isinstance(item.scalar, int)]
        values = {(value & WORD) << shift for value in raw}
        outside = [value for value in values if value & ~mask]
        if outside:
            wrong = f'{outside[0] >> shift:X}h has bits that the mask {mask:X}h leaves out'
            raise ValueError(f'{what} can never be true: {wrong}')
        if len(values) == 1 << mask.bit_count():
            raise ValueError(f'{what} is always the same: it lists every value')
        return mask, frozenset(values), inverted

    # --- parameters of commands and status ---

    def word(self, what: str, node: Node, *words: int) -> str:
        """Return the key of what writes a word to a register, or several in one message."""
        register, count = self.register(node), len(words)
        for number, word in enumerate(words, register):
            use = Use.COMMAND if word else Use.ZERO
            self.registers.note_use(use, what, node.line, 'register', number)
        key = f'line.r{register:04x}' + (f'_{count}' if count > 1 else '')
        self._make(key, self._writes, register, f'uint{16 * count}_be', f'register {node.written}')
        return key

    def coil_key(self, what: str, node: Node) -> str:
        """Return the key of a coil."""
        coil = self.coil(node)
        self.registers.note_use(Use.COMMAND, what, node.line, 'coil', coil)
        key = f'line.coil_{coil}'
        self._make(key, 'coil', coil, 'uint8', f'coil {node.written}')
        return key

    def pulse(self, what: str, node: Node) -> Write:
        """Return what sets a coil that is a command by itself."""
        coil = self.coil(node)
        self.registers.note_use(Use.PULSE, what, node.line, 'coil', coil)
        if PULSE_KEY not in self.made:
            codec = codec_of('uint16_be')
            address = Address('modbus', *PULSES, None, codec, Fraction(1), '')
            self.made[PULSE_KEY] = internal(PULSE_KEY, 'pulse of a coil', address, Access.WRITE)
        return Write(PULSE_KEY, coil)

    @property
    def _status_space(self) -> str:
        return 'input' if self._inputs else self._writes

    @property
    def _writes(self) -> str:
        return 'register' if 6 in self._line.write else 'register_16'

    def _make(self, key: str, space: str, index: int, codec: str, name: str) -> None:
        if key not in self.made:
            address = Address('modbus', space, index, None, codec_of(codec), Fraction(1), '')
            self.made[key] = internal(key, name, address, Access.READ_WRITE)

    def status(self, conditions: Iterable[PlacedCondition], block: Node) -> StatusPlace:
        """Return where the status stands, with a parameter that reads it as one."""
        found = list(conditions)
        wanted = {condition.register for condition in found}
        if any(condition.coil for condition in found):
            return self._coils(found, block)
        if 'register' in block:
            first = self.register(block['register'])
            blocks = [list(range(first, first + block.integer('count', 1)))]
            rest = sorted(wanted - set(blocks[0]))
            blocks += runs(rest)
        else:
            blocks = runs(sorted(wanted))
        # what says most stands in the lowest bits, which are published
        first = found[0].register if found else 0
        return self._registers(sorted(blocks, key=lambda run: (len(run), first in run)), block)

    def _registers(self, blocks: list[list[int]], block: Node) -> StatusPlace:
        count = sum(map(len, blocks))
        if not blocks:
            return StatusPlace((0,))
        if len(blocks) > 2 or len(blocks[0]) > 1 < len(blocks) or count > _MOST_OF_STATUS:
            ends = (sorted({run[0], run[-1]}) for run in blocks)
            where = ', '.join(' to '.join(map(self.written, both)) for both in ends)
            self._problems.add(
                block.line,
                f'the status stands at {where}: registers in one row, and one register elsewhere, '
                f'are possible, {_MOST_OF_STATUS} at most; say with block: what may be read in one '
                'message; such a drive needs a profile in Python otherwise',
            )
        first, *others = blocks
        sub_index = others[0][0] if others else None
        codec = codec_of(f'uint{16 * min(count, _MOST_OF_STATUS)}_be')
        address = Address(
            'modbus', self._status_space, first[0], sub_index, codec, Fraction(1), ''
        )
        name = f'status (register {self.written(first[0])})'
        self.made[STATUS_KEY] = internal(STATUS_KEY, name, address, Access.READ)
        registers = tuple(register for run in blocks for register in run)
        return StatusPlace(registers, inputs=self._inputs)

    def _coils(self, conditions: Sequence[PlacedCondition], block: Node) -> StatusPlace:
        if not all(condition.coil for condition in conditions):
            self._problems.add(
                block.line, 'the status stands in registers and in coils: only one of both is read'
            )
        coils = [condition.register for condition in conditions if condition.coil]
        first = min(coils)
        count = 16 if max(coils) - first < 16 else 32
        if max(coils) - first >= count:
            self._problems.add(block.line, 'the coils of the status are more than 32 apart')
        codec = codec_of(f'uint{count}_le')
        address = Address('modbus', 'coil', first, None, codec, Fraction(1), '')
        name = f'status (coil {first + self._coil_numbering})'
        self.made[STATUS_KEY] = internal(STATUS_KEY, name, address, Access.READ)
        registers = [condition.register for condition in conditions]
        return StatusPlace((*range(first, first + count), *registers), coils=True)

    # --- values ---

    def address(
        self, node: Node, what: str, *, writable: bool = False, use: Use = Use.VALUE
    ) -> Address:
        """Return where a value stands."""
        factor = self._factor(node, what)
        if 'coil' in node and 'register' in node:
            self._problems.add(
                node.line, f'{what} names a register and a coil: remove one of both'
            )
        if 'coil' in node:
            coil = self.coil(node['coil'])
            self.registers.note_use(use, what, node.line, 'coil', coil)
            return Address('modbus', 'coil', coil, None, codec_of('uint8'), factor, '')
        if 'register' not in node:
            self._problems.add(node.line, f'{what} says not where: add register or coil')
            return Address('modbus', 'register', 0, None, codec_of('uint16_be'), factor, '')
        kind, register = node.text('type', 'uint16'), self.register(node['register'])
        codec = _LOW_FIRST.get(kind, '') if node.text('order') == 'low_first' else ''
        codec = codec or _TYPES[kind]
        if node.text('order') == 'low_first' and kind not in _LOW_FIRST:
            self._problems.add(node.line, f'{what}: order is for the types uint32 and int32')
        made = codec_of(self._with_bits(node, what, codec, writable=writable))
        if made.size == 4:
            self._check_wide(node, what, register, writable=writable)
        space = 'input' if node.text('table') == 'input' else self._writes
        if space == 'input' and writable:
            self._problems.add(node.line, f'{what}: an input register cannot be written')
        if 'bits' not in node:
            self.registers.note_use(use, what, node.line, space, register, made.size // 2)
        return Address('modbus', space, register, None, made, factor, '')

    def _check_wide(self, node: Node, what: str, register: int, *, writable: bool) -> None:
        if register == WORD:
            self._problems.add(node.line, f'{what} takes two registers, and this is the last one')
        if self._line.most_registers < 2:
            self._problems.add(node.line, f'{what} takes two registers, and most_registers is 1')
        if writable and 16 not in self._line.write:
            self._problems.add(
                node.line, f'{what} takes two registers, and the line has no function 16'
            )

    def _with_bits(self, node: Node, what: str, codec: str, *, writable: bool) -> str:
        if 'bits' not in node:
            return codec
        low, high = (int(item.scalar or 0) for item in node['bits'].items)
        if not codec.startswith('uint') or not low <= high < codec_of(codec).size * 8:
            self._problems.add(node.line, f'{what} has no bits {low} to {high}')
            return codec
        if writable:
            self._problems.add(
                node.line, f'{what}: some bits of a register cannot be written; add access: r'
            )
        return f'{codec}[{low}:{high}]'

    def _factor(self, node: Node, what: str) -> Fraction:
        found = node.get('factor').scalar
        if isinstance(found, str):
            return Fraction(found)
        factor = node.number('factor')
        factor = Fraction(1) if factor is None else factor
        if factor <= 0:
            self._problems.add(
                node.get('factor').line, f'the factor of {what} has to be more than 0'
            )
            return Fraction(1)
        return factor


def runs(numbers: Sequence[int]) -> list[list[int]]:
    """Return numbers in order, as rows without a hole."""
    found: list[list[int]] = []
    for number in numbers:
        if found and found[-1][-1] == number - 1:
            found[-1].append(number)
        else:
            found.append([number])
    return found


def place_of(node: Node, what: str) -> str:
    """Return the name of a value, with the register or coil as the file has it."""
    kind = 'coil' if 'coil' in node else 'register'
    return f'{what} ({kind} {node.get(kind).written})'


def internal(key: str, name: str, address: Address, access: Access, unit: str = '') -> Parameter:
    """Return a parameter that is no setting."""
    group = {'measured': 'Status'}.get(key.partition('.')[0], _FIELDBUS)
    return Parameter(
        key=key, name=name, group=group, addresses={'modbus': address}, access=access, unit=unit
    )
