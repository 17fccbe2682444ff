# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What [M0] and [M2] print of the NFO Sinus G2."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
import re

from nfo_sinus_driver.catalog import Access, Address, Parameter, load_family
from support.manual_text import Fact, between, manual

G2 = load_family('sinus_g2')

#: Names that the manuals spell in more than one way, or wrongly [C29], once they are squashed.
SPELLINGS = {
    **{'adress': 'address', 'siadr': 'address', 'sitout': 'siotot', 'ilimit': 'ilimt'},
    **{'kpspdp': 'kpspd', 'tispdp': 'tispd', 'kpsp': 'kpspd', 'tisp': 'tispd'},
    **{'overload/overid': 'overload/overld', 'imagnlow/imagnlow': 'imagnlow/imaglow'},
    **{'curlow/errcnttriescurrentlowalarm': 'curlow/errcnt', 'busfail/autoreset': 'autoreset'},
    **{'busfail/autostop': 'autostop', 'drivecontrolmaskwrite': 'drvctrlwritemask'},
}
#: Names under which the tables of PROFIBUS and CANopen have two parameters of the catalog.
PAIRS = {
    'invst': ['invst+', 'invst'],
    'spdscl': ['spdsclnumerator', 'spdscldenominator'],
    'vlvelocityminmaxamount': ['vlvelocityminamount', 'vlvelocitymaxamount'],
    'vldimensionfactor': ['vldimensionfactornumerator', 'vldimensionfactordenominator'],
    **{
        f'vlvelocity{ramp}': [f'vlvelocity{ramp}deltaspeed', f'vlvelocity{ramp}deltatime']
        for ramp in ('acceleration', 'deceleration')
    },
}
#: Rows that are no parameter: a command, the error log, and what is to be defined [C16].
NO_PARAMETER = re.compile(
    r'Tuning|E-?logg|\.\.|(Frq|Trq|Reg)Scl|(DS 402 Object |Display )?Name|\(|$'
)
#: The tables of parameters of [M0]: protocol, first line, line behind the last.
TABLES = {
    2: ('classic', '### 6.1.6', 'Table 2:'),
    3: ('classic', '### 6.1.7', 'Table 3:'),
    4: ('modbus', '### 6.2.5', 'Table 4:'),
    5: ('modbus', '### 6.2.6', 'Table 5:'),
    9: ('profibus', '## 6.3.6', 'Table 9:'),
    10: ('profibus', '### 6.3.7', 'Table 10:'),
    11: ('canopen', '### 6.4.2', 'Table 11:'),
    12: ('canopen', '### 6.4.3', 'Table 12:'),
    13: ('canopen', '#### 6.4.4', 'Table 13:'),
}

MASK = 'fieldbus.drv_ctrl_write_mask'
#: What is printed as a type, with the reading that is followed.
OTHER_TYPES = {
    # an operating time of which 24 bits count [C26]
    **{('classic', f'status.{time}_time'): 'UINT32' for time in ('op', 'rn', 'br')},
    ('profibus', 'error.overload_s_temp'): 'SINT16',  # it goes down to -100 [C23]
    ('profibus', MASK): 'UINT32',  # two masks in one, to be written in one message
    ('modbus', MASK): 'UINT32',
}
#: Printed among the enumerations, and a word or two numbers here [C46].
NO_ENUMERATIONS = {'pi_reg.reg_amp': 'SINT16'}
#: What PROFIBUS has of another type than Modbus [C23].
OTHER_THAN_MODBUS = {
    *('control.st_mode', 'freque.fr_min', 'freque.fr_max', 'status.i_rms', 'status.p_out'),
    *('fieldbus.inv_st_with_ack', 'fieldbus.inv_st'),
    *('fieldbus.spd_scl_numerator', 'fieldbus.spd_scl_denominator'),
}
#: The second elements of an array on PROFIBUS [M0 table 9, table 10].
SECOND = {
    *('control.accel', 'control.retard'),
    *('fieldbus.inv_st', 'fieldbus.spd_scl_denominator'),
}
#: What the manual lets a master write and the driver never does: its bits are not printed [C38],
#: the order of its words is in doubt [C25].
NEVER_WRITTEN = {
    *('fieldbus.profidrive_control', 'fieldbus.spd_scl_numerator'),
    'fieldbus.spd_scl_denominator',
}
ACCESS = {'R/W': Access.READ_WRITE, 'R': Access.READ, 'W': Access.WRITE}
UNITS = {
    **{name: {name: 1} for name in ('A', 'Ω', 'H', 's', 'h', 'V', '°C', '%')},
    **{'kW': {'kW': 1, 'W': 1000}, 'kwh': {'kWh': 1}, 'mwh': {'kWh': 1000}},
    **{'Unit': {'': 1}, '1': {'': 1}},
}


@dataclass(frozen=True)
class Line:
    """One row of a table: the parameters that it is about, and what is beside the name."""

    parameters: list[Parameter]
    name: str
    cells: list[str]


def squashed(name: str) -> str:
    """What is left of a name without blanks, hyphens and remarks."""
    with_ack = '+' if '(With Ack)' in name else ''
    name = re.sub(r'\(.*?\)|[\s*-]', '', name).casefold()
    return SPELLINGS.get(name, name) + with_ack


def lines_of(table: int) -> Iterator[Line]:
    """The rows of one of the tables of parameters of M0; an unknown name is an error."""
    known = {(squashed(row.group), squashed(row.name)): row for row in G2.values()}
    group = 'fieldbus'
    for name, *cells in between(manual(0), *TABLES[table][1:]):
        if name.startswith('Parameter group '):
            group = squashed(name.removeprefix('Parameter group '))
        elif cells and not NO_PARAMETER.match(name):
            names = PAIRS.get(squashed(name), [squashed(name)]) if table > 5 else [squashed(name)]
            # the set-points stand in Status and among the words of control [C28]
            groups = (group, 'status') if group == 'fieldbus' else (group,)
            keys = [(where, printed) for printed in names for where in groups]
            found = [known[key] for key in keys if key in known]
            assert len(found) == len(names), f'table {table}: unknown: {name} of {group}'
            yield Line(found, name, cells)


def labels_in(text: str) -> dict[int, str]:
    """The enumeration in a cell of M0: codes and labels."""
    text = re.sub(r'</?sup>', '', text).replace('m 3 ', 'm³') + ' '
    pairs = re.findall(r'([0-9A-F]+h|\d+) = (.+?)(?= \(Obsolete| Also | \w+ = | $)', text)
    # blanks lost in print [C29]
    return {
        int(code.removesuffix('h'), 16 if code.endswith('h') else 10): re.sub(
            r'(?<=Fix-\d)(?=R$)', ' ', label.strip()
        )
        for code, label in pairs
    }


def type_of(place: Address) -> str:
    """The type of a codec, as the manual prints it."""
    return place.codec.name.partition('_')[0].upper()


def tables_of_g2() -> Iterator[Fact]:
    """[M0 tables 2 to 13]: address, type, access, factor, labels and firmware of each row."""
    seen: dict[str, set[str]] = {protocol: set() for protocol, *_ in TABLES.values()}
    counts: dict[int, dict[str, int]] = {table: {} for table in (2, 3, 4, 5)}
    for table, (protocol, *_) in TABLES.items():
        for line in lines_of(table):
            for row in line.parameters:
                absent = 'TBD' in line.cells[0]  # to be defined, says the manual [C27]
                # two masks of 32 bits, and an SDO to an index alone carries one
                absent |= protocol == 'canopen' and row.key == MASK
                absent |= protocol == 'canopen' and line.name == 'SetpointSource'
                where = f'table {table}: {row.key}'
                yield where, not absent, protocol in row.addresses
                if absent:
                    continue
                seen[protocol].add(row.key)
                place = row.at(protocol)
                facts = {'profibus': on_profibus, 'canopen': on_canopen}.get(protocol, on_line)
                yield from ((f'{where}, {what}', *both) for what, *both in facts(row, place, line))
                if table in (2, 4, 9):
                    since = re.search(r'Available from FW ?(\d\.\d+)', line.cells[-1])
                    yield f'{where} since', since and Fraction(since[1]), row.since
                    yield f'{where} labels', labels_of(row, line), dict(row.labels)
                if table < 9 and not row.labels:
                    kind, *fact = factor_of(row, protocol, line)
                    counts[table][kind] = counts[table].get(kind, 0) + 1
                    yield f'{where} factor', *fact
    for protocol, keys in seen.items():
        yield protocol, keys, {key for key, row in G2.items() if protocol in row.addresses}
    for table in counts:
        # counted on paper
        found = {kind: counts[table].get(kind, 0) for kind in ('divided', 'scaled', 'plain')}
        control = {'divided': 1, 'scaled': 4, 'plain': 0}
        whole = {'divided': 41, 'scaled': 40, 'plain': 14}
        yield f'table {table}', whole if table in (2, 4) else control, found


def on_line(row: Parameter, place: Address, line: Line) -> Iterator[Fact]:
    """What is printed of a row for Classic and Modbus."""
    numbers = [int(number, 16) for number in re.findall(r'E?([0-9A-F]{4})h?', line.cells[0])]
    kind = line.cells[1]
    if kind == '2 * UINT16':  # its second register has a line of its own
        yield 'address', numbers[:1], list(place.occupied[0])
    else:
        yield 'address', [(number,) for number in numbers], list(place.occupied)
    if kind == 'ENUM':
        kind = NO_ENUMERATIONS.get(row.key, 'UINT16')
    yield 'type', OTHER_TYPES.get((place.protocol, row.key), kind), type_of(place)


def on_profibus(row: Parameter, place: Address, line: Line) -> Iterator[Fact]:
    number = re.match(r'P(\d+)', line.cells[0])
    assert number is not None, line.name
    # the number of U-Nom is printed for P-Nom, too [C1]
    misprint = row.key == 'motor.p_nom'
    yield 'number', int(number[1]), place.index + misprint
    array = line.cells[2].startswith('Array')
    yield 'sub-index', 1 if row.key in SECOND else 0 if array else None, place.sub_index
    yield 'factor', row.factor('modbus'), place.factor
    kind = line.cells[2].split()[-1]
    yield 'type', OTHER_TYPES.get((place.protocol, row.key), kind), type_of(place)
    modbus = type_of(row.at('modbus'))
    yield 'as on Modbus', row.key not in OTHER_THAN_MODBUS, type_of(place) == modbus
    if row.access is Access.ACKNOWLEDGE or row.key in NEVER_WRITTEN:
        yield 'access', True, 'R' in line.cells[1]
    else:
        yield 'access', ACCESS[line.cells[1]], row.access


def on_canopen(row: Parameter, place: Address, line: Line) -> Iterator[Fact]:
    index = re.match(r'([0-9A-F]{4})h', line.cells[0])
    assert index is not None, line.name
    yield 'index', int(index[1], 16), place.index
    if len(line.parameters) > 1:
        yield 'sub-index', line.parameters.index(row) + 1, place.sub_index
    # no type is printed, and Modbus has no objects of the drive profile
    if 'modbus' not in row.addresses:
        return
    yield 'type', type_of(row.at('modbus')), type_of(place)


def labels_of(row: Parameter, line: Line) -> dict[int, str]:
    """The enumeration that is printed, with the misprints put right."""
    labels = labels_in(line.cells[-1])
    if row.key == 'serial.si_prot':
        labels[5] += 's'  # a letter lost in print [C5]
    elif row.key == 'output.re_mode':
        assert labels[1] == 'Freque'
        labels[1] = 'Running'  # slipped up from the rows below [C18]
    elif row.key == 'pi_reg.reg_amp':
        assert line.cells[-1] == '-1 or 1'
        labels = {-1: '-1', 1: '1'}
    return labels


def default_of(scale: str) -> Fraction:
    """What one count is as a drive comes from the factory [M0 §8.3]; of RegScl by [M2 table 1]."""
    tenths = f'Factory default for {scale} is 1/10.' in manual(0) or scale == 'RegScl'
    return Fraction(1, 10) if tenths else Fraction(1)


def factor_of(row: Parameter, protocol: str, line: Line) -> tuple[str, object, object]:
    """How the unit is printed, what that says, and what the catalog has."""
    text = re.sub(r'</?sup>|\s|\*', '', line.cells[2]) if len(line.cells) > 2 else ''
    divided = re.search(r'(°C|%|1|[^\W\d_]+)/10(\d)', text)
    scaled = re.match(r'(Hz|rpm|Nm|Unit)/(FrqScl|SpdScl|TrqScl|RegScl)', text)
    factor = row.factor(protocol)
    if 'SpdScl=' in text:
        return 'none', True, True
    if scaled:
        # torque is in percent of the nominal one, never in Nm [C13]
        unit = {'Nm': '%', 'Unit': ''}.get(scaled[1], scaled[1])
        return 'scaled', (scaled[2], unit, default_of(scaled[2])), (row.scale, row.unit, factor)
    if divided:
        unit = divided[1] if divided[1] in UNITS else divided[1].lower()
        return 'divided', Fraction(UNITS[unit][row.unit]) / 10 ** int(divided[2]), factor
    plain = re.fullmatch(r'V|Hz|rpm|s|W|°C', text)
    return 'plain' if plain else 'none', (plain[0] if plain else '', 1), (row.unit, factor)


# --- the older manual -----------------------------------------------------------------------------


def counts_of(text: str) -> tuple[int | None, int | None]:
    """The raw counts of a range; ``None`` where it depends on the inverter [C34]."""
    both = re.fullmatch(r'\+/- ?(\d+)', text)
    if both is not None:
        return -int(both[1]), int(both[1])
    found = re.fullmatch(r'(\d+|\(.*\)) ?[\u2013-] ?(\d+|\(.*\))', text)
    if found is None:
        assert text in ('', '(*)', '1 or -1'), text
        return (-1, 1) if text == '1 or -1' else (None, None)
    low, high = (int(part) if part.isdigit() else None for part in found.groups())
    return low, high


def rows_of_old_manual() -> Iterator[list[str]]:
    """The rows of [M2 table 1]: id, name, description, range, decimals, unit and type."""
    for cells in between(manual(2), 'ID\tName\tDescription', 'Table 1.'):
        if re.fullmatch(r'E[0-9A-F]{4}', cells[0]) and len(cells) == 7 and cells[1]:
            yield cells


def addresses_on(protocol: str) -> tuple[int, int]:
    """The range of Address [M0 §6.1.2, §6.2.2]; CANopen has no greater node id [C10]."""
    ranges = re.findall(r"'Address' .* Valid range is (\d+) to (\d+)", '\n'.join(manual(0)))
    low, high = map(int, ranges[0 if protocol == 'classic' else 1])
    return low, min(high, 127) if protocol == 'canopen' else high


def old_manual_of_g2() -> Iterator[Fact]:
    """[M2 table 1]: names, ranges, decimals, units, types, codes and descriptions."""
    by_id = {row.at('classic').index: row for row in G2.values() if 'classic' in row.addresses}
    seen: dict[bool, set[str]] = {True: set(), False: set()}
    for cells in rows_of_old_manual():
        row = by_id[int(cells[0][1:], 16)]
        yield cells[0], squashed(cells[1]), squashed(row.name)
        init = 'Init' if row.stopped else 'Init/Run'
        yield f'{row.key} type', cells[6], init if row.is_setting else 'Readonly'
        enumeration = '=' in cells[3]
        seen[enumeration].add(row.key)
        facts = codes_in(row, cells) if enumeration else range_in(row, cells)
        yield from ((f'{row.key} {what}', *both) for what, *both in facts)
        if row.group not in ('Serial', 'Status'):  # in other words here and there, [C22] among them
            printed = re.sub(r' \(The Unit.*|\. .*', '', cells[2].replace('. /', ' /'))
            start = printed.rstrip('.').casefold()
            yield f'{row.key} description', start, row.description.casefold()[: len(start)]
    missing = {row.key for row in G2.settings if not row.labels} - seen[False]
    # newer than that manual [C21], as BusType is
    yield 'missing', {'control.f_sleep', 'error.short_c_err_cnt'}, missing
    for key in missing:
        yield f'range of {key}', (None, None), (G2[key].minimum, G2[key].maximum)
    address = G2['serial.address']
    yield 'addresses', addresses_on('modbus'), (address.minimum, address.maximum)
    yield 'enumerations', 29, len(seen[True])
    # the range of the set-points, in raw counts too, for each mode of control [C33]
    text = '\n'.join(manual(2))
    for mode, count, key, decimals in (
        ('Freque, Pl-reg', 1500, 'status.frq_set', 1),
        ('Speed', 9000, 'status.spd_set', 0),
        ('Torque', 200, 'status.trq_set', 0),
    ):
        assert f'{mode}\t+/- {count}\t' in text
        most = Fraction(count, 10**decimals)
        yield f'range of {key}', (-most, most), (G2[key].minimum, G2[key].maximum)
    # that of PI-Reg stands in a row in Hz, and is the limit of that firmware alone [C113]
    process = G2.profile.setpoints['PI-Reg']
    ours = process.older_most, process.most
    yield 'range of PI-Reg', (150, G2['pi_reg.setmax'].maximum), ours


def codes_in(row: Parameter, cells: list[str]) -> Iterator[Fact]:
    """The codes of an enumeration."""
    codes = {int(code) for code in re.findall(r'= (\d+)', cells[3])}
    if row.key in ('freque.op_mode', 'speed.op_mode'):
        codes -= {193}  # read and never offered [C19]
    ours = set(row.labels)
    if row.key in ('serial.si_baud', 'pi_reg.unit', 'serial.si_prot'):
        yield 'codes', True, codes < ours  # newer drives have more [C5] [C6] [C21]
    else:
        yield 'codes', codes, ours


def range_in(row: Parameter, cells: list[str]) -> Iterator[Fact]:
    """The range, the decimals and the unit of a number."""
    decimals = int(cells[4] or 0)
    bounds = counts_of(cells[3])
    if row.key == 'serial.address':
        yield 'range', (0, 95), bounds  # Modbus has more addresses, and 0 is all drives [C10]
    elif row.key == 'motor.i_limt':
        yield 'range', (None, None, Fraction('0.01')), (*bounds, row.minimum)  # I-magn + 1
    elif row.is_setting:
        scaled = tuple(None if bound is None else Fraction(bound, 10**decimals) for bound in bounds)
        yield 'range', scaled, (row.minimum, row.maximum)
    yield 'unit', cells[5].replace('Unit*', ''), row.unit
    if row.key == 'status.trq_act':
        yield 'decimals', (1, 0), (decimals, row.decimals)  # none in M0 [C13]
        return
    yield 'decimals', decimals, row.decimals
    if not row.scale:
        # what has decimals has them on this bus
        yield 'factor', Fraction(1, 10**decimals), row.factor('classic')


def codes_of_g2() -> Iterator[Fact]:
    """The inverter status of [M0 table 19], and of old firmware [M2 table 3]."""
    seen = set()
    for cells in between(manual(0), '### 8.2', 'Table 19:'):
        if len(cells) < 4 or not cells[0].isdigit():
            continue
        entry = G2.status_code(int(cells[0]))
        seen.add(entry.code)
        ours = entry.text, entry.requires_ack
        yield f'code {entry.code}', (cells[1], cells[2] == 'X'), ours
        if entry.code == 14:
            # over other protocols than Classic it is a time-out alone [C92]
            both = 'SioErr' in entry.description and 'time-out' in entry.description
            yield 'description of 14', True, both
        elif cells[3] and entry.code:
            yield f'description of {entry.code}', cells[3].rstrip('.'), entry.description
    yield 'codes', seen, {*range(41), 45, 46, 47}
    rows = between(manual(2), 'Value\tDisplay Text', 'Table 3 Values')
    old = {int(cells[0]): cells[1] for cells in rows if cells[0].isdigit()}
    yield 'old texts', old, {code: G2.status_code(code).old_text for code in range(48)}
