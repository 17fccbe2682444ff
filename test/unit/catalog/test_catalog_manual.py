# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""The catalog against the manuals' own text, where that lies beside the clone."""

from __future__ import annotations

from fractions import Fraction
import re

from manual_text import G2, between, labels_in, lines_of, manual, settings_of_m2
import pytest

from nfo_sinus_driver.catalog import Access, Address

#: What is misprinted, by key and table, with the reading that is followed.
MISPRINTS = {
    ('motor.p_nom', 9): (1006, 1005),  # the number of U-Nom [C1]
}
#: What PROFIBUS has of another type than Modbus [C23].
OTHER_TYPES = {
    'control.st_mode',
    'freque.fr_min',
    'freque.fr_max',
    'status.i_rms',
    'status.p_out',
    'fieldbus.inv_st_with_ack',
    'fieldbus.inv_st',
    'fieldbus.spd_scl_numerator',
    'fieldbus.spd_scl_denominator',
}
#: The second elements of an array on PROFIBUS [M0 table 9, table 10].
SECOND = {
    'control.accel',
    'control.retard',
    'fieldbus.inv_st',
    'fieldbus.spd_scl_denominator',
}
#: What counts on Classic of what is printed as SINT32 [C26].
_24_BITS = {
    'status.op_time': 'uint32_ws[0:23]',
    'status.rn_time': 'uint32_ws[0:23]',
    'status.br_time': 'uint32_ws[0:23]',
}
#: What the manual lets a master write and the driver never does.
NEVER_WRITTEN = {
    'fieldbus.profidrive_control',  # its bits are not printed [C38]
    'fieldbus.spd_scl_numerator',  # the order of its words is in doubt [C25]
    'fieldbus.spd_scl_denominator',
}
#: Printed among the enumerations, and a word or two numbers here [C46].
NO_LABELS = {
    'pi_reg.reg_amp',
    'fieldbus.inv_st_with_ack',
    'fieldbus.inv_st',
    'fieldbus.mode',
    'fieldbus.scmd',
}


def keys_on(protocol: str) -> set[str]:
    """The parameters that one protocol reaches."""
    return {key for key, row in G2.items() if protocol in row.addresses}


def type_of(place: Address) -> str:
    """The type of a codec, as the manual prints it."""
    return place.codec.name.partition('_')[0].upper()


def on_bus(key: str, printed: str) -> set[str]:
    """What the catalog may call a type that the manual prints."""
    if printed == 'ENUM' and key in NO_LABELS:
        return {'SINT16' if key == 'pi_reg.reg_amp' else 'UINT16'}
    if printed == 'ENUM':
        return {'UINT16'}
    # two masks in one, to be written in one message
    return {'UINT32'} if printed == '2 * UINT16' else {printed}


def test_classic_ids_and_types() -> None:
    seen = set()
    for table in (2, 3):
        for line in lines_of(table):
            (row,) = line.parameters
            ids = tuple(int(number, 16) for number in re.findall(r'E([0-9A-F]{4})', line.cells[0]))
            if not ids:
                assert 'TBD' in line.cells[0]  # to be defined, says the manual [C27]
                assert 'classic' not in row.addresses
                continue
            place = row.at('classic')
            assert place.numbers == ids, row.key
            if row.key in _24_BITS:
                assert (line.cells[1], place.codec.name) == ('SINT32', _24_BITS[row.key])
            else:
                assert type_of(place) in on_bus(row.key, line.cells[1]), row.key
            seen.add(row.key)
    assert seen == keys_on('classic')


def test_modbus_registers_and_types() -> None:
    seen = set()
    for table in (4, 5):
        for line in lines_of(table):
            (row,) = line.parameters
            registers = [int(number, 16) for number in re.findall(r'([0-9A-F]{4})h', line.cells[0])]
            place = row.at('modbus')
            assert place.index == registers[0], row.key
            assert type_of(place) in on_bus(row.key, line.cells[1]), row.key
            if line.cells[1] != '2 * UINT16':  # its second register has a line of its own
                assert place.occupied == [(number,) for number in registers], row.key
            seen.add(row.key)
    assert seen == keys_on('modbus')


def test_profibus_numbers_types_and_access() -> None:
    seen = set()
    for table in (9, 10):
        for line in lines_of(table):
            number = re.match(r'P(\d+)', line.cells[0])
            assert number is not None, line.name
            for row in line.parameters:
                printed = int(number[1])
                misprint = MISPRINTS.get((row.key, table))
                if misprint is not None:
                    assert printed == misprint[0], 'no misprint any more'
                    printed = misprint[1]
                place = row.at('profibus')
                assert place.index == printed, row.key
                sub_index = 0 if line.cells[2].startswith('Array') else None
                if row.key in SECOND:
                    sub_index = 1
                assert place.sub_index == sub_index, row.key
                assert place.factor == row.factor('modbus')
                expected = line.cells[2].split()[-1]
                if row.key == 'error.overload_s_temp':
                    assert expected == 'UINT16'
                    expected = 'SINT16'  # it goes down to -100 [C23]
                elif row.key == 'fieldbus.drv_ctrl_write_mask':
                    assert expected == 'UINT16'
                    expected = 'UINT32'  # the two masks are an array here
                assert type_of(place) == expected, row.key
                modbus = type_of(row.at('modbus'))
                assert (type_of(place) == modbus) == (row.key not in OTHER_TYPES), row.key
                allowed = {'R/W': Access.READ_WRITE, 'R': Access.READ, 'W': Access.WRITE}
                if row.access is Access.ACKNOWLEDGE or row.key in NEVER_WRITTEN:
                    assert 'R' in line.cells[1]
                else:
                    assert row.access is allowed[line.cells[1]], row.key
                seen.add(row.key)
    assert seen == {key for key, row in G2.items() if 'profibus' in row.addresses}


def test_canopen_indices() -> None:
    seen = set()
    for table in (12, 13):
        for line in lines_of(table):
            index = re.match(r'([0-9A-F]{4})h', line.cells[0])
            if index is None:
                assert line.name == 'SetpointSource'
                continue
            for row in line.parameters:
                if row.key == 'fieldbus.drv_ctrl_write_mask':
                    # two masks of 32 bits, and an SDO to an index alone carries one
                    assert 'canopen' not in row.addresses
                    continue
                place = row.at('canopen')
                assert place.index == int(index[1], 16), row.key
                # no type is printed
                assert type_of(place) == type_of(row.at('modbus')), row.key
                seen.add(row.key)
    assert seen == {key for key, row in G2.items() if 'canopen' in row.addresses}


@pytest.mark.parametrize('table', [2, 4, 9])
def test_enumerations(table: int) -> None:
    seen = set()
    for line in lines_of(table):
        (row,) = line.parameters
        labels = labels_in(line.cells[-1])
        if row.key == 'serial.si_prot':
            labels[5] += 's'  # a letter lost in print [C5]
        elif row.key == 'output.re_mode':
            assert labels[1] == 'Freque'
            labels[1] = 'Running'  # slipped up from the rows below [C18]
        elif row.key == 'pi_reg.reg_amp':
            assert line.cells[-1] == '-1 or 1'
            labels = {-1: '-1', 1: '1'}
        # blanks lost in print [C29]
        labels = {code: re.sub(r'(?<=Fix-\d)(?=R$)', ' ', text) for code, text in labels.items()}
        if labels or row.labels:
            assert labels == row.labels, row.key
            seen.add(row.key)
    # AnyBus is on Classic only
    assert len(seen) == (31 if table == 2 else 30)


@pytest.mark.parametrize('table', [2, 3, 4, 5])
def test_factors(table: int) -> None:
    protocol = 'classic' if table < 4 else 'modbus'
    units = {'kW': {'kW': 1, 'W': 1000}, 'kwh': {'kWh': 1}, 'mwh': {'kWh': 1000}}
    units |= {'Unit': {'': 1}, '1': {'': 1}}
    units |= {name: {name: 1} for name in ('A', 'Ω', 'H', 's', 'h', 'V', '°C', '%')}
    counts = {'divided': 0, 'scaled': 0, 'plain': 0}
    for line in lines_of(table):
        (row,) = line.parameters
        if row.labels or protocol not in row.addresses:
            continue
        text = re.sub(r'</?sup>|\s|\*', '', line.cells[2]) if len(line.cells) > 2 else ''
        divided = re.search(r'(°C|%|1|[^\W\d_]+)/10(\d)', text)
        scaled = re.match(r'(Hz|rpm|Nm|Unit)/(FrqScl|SpdScl|TrqScl|RegScl)', text)
        plain = re.fullmatch(r'V|Hz|rpm|s|W|°C', text)
        if 'SpdScl=' in text:
            continue
        factor = row.factor(protocol)
        if scaled:
            assert row.scale == scaled[2], row.key
            # torque is in percent of the nominal one, never in Nm [C13]
            unit = {'Nm': '%', 'Unit': ''}.get(scaled[1], scaled[1])
            assert row.unit == unit, row.key
            counts['scaled'] += 1
        elif divided:
            unit = divided[1] if divided[1] in units else divided[1].lower()
            times = Fraction(units[unit][row.unit])
            assert factor == times / 10 ** int(divided[2]), row.key
            counts['divided'] += 1
        elif plain:
            assert (row.unit, factor) == (plain[0], 1), row.key
            counts['plain'] += 1
        else:
            assert (row.unit, factor) == ('', 1), row.key
    # counted on paper
    control = {'divided': 1, 'scaled': 4, 'plain': 0}
    assert counts == ({'divided': 41, 'scaled': 40, 'plain': 14} if table in (2, 4) else control)


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


def test_ranges_decimals_units_and_types() -> None:
    seen = set()
    for row, cells in settings_of_m2():
        if '=' in cells[3]:
            continue  # an enumeration
        place = row.at('classic')
        decimals = int(cells[4] or 0)
        low, high = counts_of(cells[3])
        if row.key == 'serial.address':
            assert (low, high) == (0, 95)  # Modbus has more addresses, and 0 is all drives [C10]
        elif row.key == 'motor.i_limt':
            assert (low, high, row.minimum) == (None, None, Fraction('0.01'))  # I-magn + 1
        elif row.is_setting:
            for bound, count in ((row.minimum, low), (row.maximum, high)):
                expected = None if count is None else Fraction(count, 10**decimals)
                assert bound == expected, row.key
        if row.key == 'status.trq_act':
            assert (decimals, row.decimals) == (1, 0)  # none in M0 [C13]
        else:
            assert row.decimals == decimals, row.key
        assert row.unit == cells[5].replace('Unit*', ''), row.key
        if row.is_setting:
            assert cells[6] == ('Init' if row.stopped else 'Init/Run'), row.key
        else:
            assert cells[6] == 'Readonly', row.key
        # what has decimals has them on this bus
        if not row.scale and row.key != 'status.trq_act':
            assert place.factor == Fraction(1, 10**decimals), row.key
        seen.add(row.key)
    missing = {row.key for row in G2.settings if not row.labels} - seen
    assert missing == {'control.f_sleep', 'error.short_c_err_cnt'}  # newer than that manual [C21]


def test_range_of_the_setpoint() -> None:
    # in raw counts too, and for each mode of control [C33]
    text = '\n'.join(manual('M2'))
    for mode, count, key, decimals in (
        ('Freque, Pl-reg', 1500, 'status.frq_set', 1),
        ('Speed', 9000, 'status.spd_set', 0),
        ('Torque', 200, 'status.trq_set', 0),
    ):
        assert f'{mode}\t+/- {count}\t' in text
        row = G2[key]
        assert row.maximum == Fraction(count, 10**decimals)
        assert row.minimum == -row.maximum
    # that of PI-Reg stands in a row in Hz, and is the limit of that firmware alone [C113]
    process = G2.profile.setpoints['PI-Reg']
    assert process.older_most == 150.0 and process.most == G2['pi_reg.setmax'].maximum


def test_codes_and_types_of_enumerations() -> None:
    seen = set()
    for row, cells in settings_of_m2():
        pairs = re.findall(r'= (\d+)', cells[3])
        if not pairs:
            continue
        codes = {int(code) for code in pairs}
        if row.key in ('freque.op_mode', 'speed.op_mode'):
            codes -= {193}  # read and never offered [C19]
        if row.key in ('serial.si_baud', 'pi_reg.unit', 'serial.si_prot'):
            assert codes < set(row.labels)  # newer drives have more [C5] [C6] [C21]
        else:
            assert codes == set(row.labels), row.key
        assert cells[6] == ('Init' if row.stopped else 'Init/Run'), row.key
        seen.add(row.key)
    # BusType is newer than that manual [C21], RegAmp has numbers
    assert len(seen) == 29


def test_descriptions() -> None:
    for row, cells in settings_of_m2():
        printed = re.sub(r' \(The Unit.*|\. .*', '', cells[2].replace('. /', ' /')).rstrip('.')
        if row.group in ('Serial', 'Status'):
            continue  # in other words here and there, [C22] among them
        assert row.description.casefold().startswith(printed.casefold()), row.key


def test_what_newer_firmware_has() -> None:
    for table in (2, 4, 9):
        for line in lines_of(table):
            (row,) = line.parameters
            since = re.search(r'Available from FW ?(\d\.\d+)', line.cells[-1])
            assert row.since == (None if since is None else Fraction(since[1])), row.key


def test_inverter_status() -> None:
    seen = set()
    for cells in between(manual('M0'), '### 8.2', 'Table 19:'):
        if len(cells) < 4 or not cells[0].isdigit():
            continue
        entry = G2.status_code(int(cells[0]))
        assert entry.text == cells[1]
        assert entry.requires_ack == (cells[2] == 'X')
        if entry.code == 14:
            # over other protocols than Classic it is a time-out alone [C92]
            assert 'SioErr' in entry.description and 'time-out' in entry.description
        elif cells[3] and entry.code:
            assert entry.description == cells[3].rstrip('.')
        seen.add(entry.code)
    assert seen == {*range(41), 45, 46, 47}


def test_inverter_status_of_old_firmware() -> None:
    seen = set()
    for cells in between(manual('M2'), 'Value\tDisplay Text', 'Table 3 Values'):
        if cells[0].isdigit():
            assert G2.status_code(int(cells[0])).old_text == cells[1]
            seen.add(int(cells[0]))
    assert seen == set(range(48))
