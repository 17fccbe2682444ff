# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""Status codes, control and status words [M0 tables 14 to 19]."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given, strategies as st
import pytest
from support.addresses import packed

from nfo_sinus_driver.catalog import Kind, Meaning, State, load_family
from nfo_sinus_driver.families.sinus_g2.words import Control, Mode, Scmd, Status, state_of

G2 = load_family('sinus_g2')

#: The display texts of [M0 table 19]; 41 to 44 are from [M2 table 3].
TEXTS = [
    'Erased',
    'Par Fail',
    'AC Fail',
    'Temp Hi',
    'PTC Temp',
    'Overload',
    'Ain Fail',
    'DC Low',
    'DC High',
    'GND Fail',
    'ImagnLow',
    'Cur Low',
    'Cur High',
    'Run Fail',
    'Sio Fail',
    'Bus Fail',
    'TunFailP',
    'TunFailM',
    'NFO Fail',
    'CopReset',
    'NfoReset',
    'CommRest',
    'ParRange',
    'ExeTimeE',
    'Stop',
    'Wait...',
    'Brake Ch',
    'Cur Limt',
    'Tuning',
    'St still',
    'Final fr',
    'Loc Acc',
    'Loc Ret',
    'Ext Stby',
    'Ext Run',
    'Ext Acc',
    'Ext Ret',
    'Bus Stby',
    'Bus Run',
    'Bus Acc',
    'Bus Ret',
    'Bus Stby',
    'Bus Run',
    'Bus Acc',
    'Bus Ret',
    'TuningOK',
    'RsMeasOK',
    'ParClcOK',
]
#: What firmware before 4.28 shows for 37 to 40 [C3].
OLD_TEXTS = {37: 'Sio Stby', 38: 'Sio Run', 39: 'Sio Acc', 40: 'Sio Ret'}

#: The patterns of [M0 table 16], copied from the manual once more.
PATTERNS = [
    ('00XX XXXX X0XX 0000', State.NOT_READY_TO_SWITCH_ON),
    ('00XX XXXX X1XX 0000', State.SWITCH_ON_DISABLED),
    ('00XX XXXX X01X 0001', State.READY_TO_SWITCH_ON),
    ('00XX XXXX X01X 0011', State.SWITCHED_ON),
    ('00XX XXXX X01X 0111', State.OPERATION_ENABLED),
    ('01XX XXXX X01X 0011', State.OPERATION_ENABLED),
    ('10XX XXXX X01X 0111', State.STOPPING),
    ('11XX XXXX X01X 0011', State.STOPPING),
    ('10XX XXXX X00X 0111', State.QUICK_STOP),
    ('11XX XXXX X00X 0011', State.QUICK_STOP),
    ('10XX XXXX X0XX 1111', State.FAULT_REACTION_ACTIVE),
    ('11XX XXXX X0XX 1011', State.FAULT_REACTION_ACTIVE),
    ('00XX XXXX X0XX 1000', State.FAULTED),
]


def fixed_bits(printed: str) -> tuple[int, int]:
    """Which bits a pattern of the manual fixes, and what they are."""
    mask = fixed = 0
    for bit in printed.replace(' ', ''):
        mask = mask << 1 | (bit != 'X')
        fixed = fixed << 1 | (bit == '1')
    return mask, fixed


@pytest.mark.parametrize('code', range(48))
def test_inverter_status(code: int) -> None:
    entry = G2.status_code(code)
    assert (entry.code, entry.text) == (code, TEXTS[code])
    assert entry.old_text == OLD_TEXTS.get(code, TEXTS[code])
    assert entry.requires_ack == (1 <= code <= 23 and code != 15)
    expected = Kind.FAULT if 1 <= code <= 23 else Kind.ALARM if code == 27 else Kind.STATUS
    assert entry.kind is expected
    assert entry.description
    # who reads of a fault wants to know what to do
    assert bool(entry.remedy) == (entry.kind is not Kind.STATUS)


@pytest.mark.parametrize(
    ('firmware', 'old'),
    [('4.27', True), ('3.9', True), ('4.28', False), ('4.38', False), ('5', False)],
)
def test_texts_of_old_firmware(firmware: str, old: bool) -> None:
    for code, text in enumerate(TEXTS):
        expected = OLD_TEXTS.get(code, text) if old else text
        assert G2.status_code(code).shown(Fraction(firmware)) == expected


def test_texts_of_firmware_as_it_is_read() -> None:
    # SWVer comes as a binary fraction, a hair beside 4.28
    for raw, text in ((428, 'Bus Stby'), (427, 'Sio Stby')):
        firmware = Fraction(G2['fieldbus.sw_ver'].decode(packed(raw)))
        assert G2.status_code(37).shown(firmware) == text


def test_texts_of_unknown_firmware() -> None:
    assert [G2.status_code(code).shown(None) for code in range(48)] == TEXTS


@pytest.mark.parametrize('code', [48, 99, 0xFFFF])
def test_unlisted_status_code(code: int) -> None:
    entry = G2.status_code(code)
    assert (entry.code, entry.text, entry.kind) == (code, f'Code {code}', Kind.STATUS)
    assert not entry.requires_ack
    assert entry.shown(Fraction('4.20')) == f'Code {code}'


def meaning(*meanings: Meaning) -> set[int]:
    """The codes that mean one of these."""
    return {code.code for one in meanings for code in G2.codes(one)}


def called(*starts: str) -> set[int]:
    """The codes whose texts begin so."""
    return {code for code in range(48) if TEXTS[code].startswith(starts)}


def test_meanings_of_status_codes() -> None:
    assert called('Bus Stby') == meaning(Meaning.BUS_STANDBY)
    assert called('Bus ') - called('Bus Stby', 'Bus Fail') == meaning(Meaning.BUS_RUNNING)
    assert called('St still', 'Final', 'Loc ') == meaning(Meaning.KEYPAD)
    assert called('Ext ') == meaning(Meaning.TERMINALS)
    assert meaning(Meaning.KEYPAD, Meaning.TERMINALS) - called('Ext Stby') == meaning(
        Meaning.LOCAL_RUNNING
    )
    assert called('Brake Ch', 'Cur Limt') == meaning(Meaning.RUNNING)
    assert called('Brake Ch', 'Cur Limt', 'Wait') == meaning(Meaning.ANONYMOUS)
    # the chopper takes what a motor gives back that slows down
    assert called('Bus Ret', 'Brake Ch') == meaning(Meaning.SLOWING)
    assert called('Cur Limt') == meaning(Meaning.CURRENT_LIMIT)
    assert called('Wait') == meaning(Meaning.START_DELAY)
    assert called('Tuning') - called('TuningOK') == meaning(Meaning.TUNING)
    assert called('TuningOK', 'RsMeasOK', 'ParClcOK') == meaning(Meaning.TUNED)
    assert called('TunFail') == meaning(Meaning.TUNING_FAILED)
    assert called('Sio Fail') == meaning(Meaning.SERIAL_FAILURE)
    assert called('Bus Fail') == meaning(Meaning.FIELDBUS_FAILURE)


def test_codes_of_mode() -> None:
    assert {mode.name: mode.value for mode in Mode} == {'INHIBIT': 0, 'STOP': 1, 'EXT': 2, 'BUS': 3}


def test_codes_of_scmd() -> None:
    # [M0 table 18]
    printed = {
        'STOP': 0x00,
        'ANALOG_F': 0x03,
        'ANALOG_R': 0x05,
        'OP_MODE': 0x41,
        'TERMINAL': 0x81,
        'FIELDBUS': 0x101,
        'FULL_TUNING': 0x201,
        'BASIC_TUNING': 0x301,
        'RS_MEASURE': 0x401,
        'PAR_CALC': 0x501,
        'ERASE_E_LOG': 0x800,
        'RESET_E_OUT': 0x900,
    }
    fixed = [0x0B, 0x0D, 0x13, 0x15, 0x1B, 0x1D, 0x23, 0x25, 0x2B, 0x2D, 0x33, 0x35, 0x3B, 0x3D]
    names = [f'FIX_{number}_{way}' for number in range(1, 8) for way in 'FR']
    assert {code.name: code.value for code in Scmd} == {
        **printed,
        **dict(zip(names, fixed, strict=True)),
    }


def test_bits_of_the_words() -> None:
    # [M0 tables 14 and 15]; 8 and 9 of the one, 7, 12 and 13 of the other are reserved
    assert {bit.name: bit.value.bit_length() - 1 for bit in Control} == {
        'SWITCH_ON': 0,
        'ENABLE_VOLTAGE': 1,
        'DISABLE_QUICK_STOP': 2,
        'ENABLE_OP': 3,
        'ENABLE_RFG': 4,
        'UNLOCK_RFG': 5,
        'USE_REF_FOR_RFG': 6,
        'RESET_MALFUNCTION': 7,
        'EVENT_TRIGGERED_OP': 10,
        'OVERRIDE_COAST': 11,
        'AUTO_INIT': 12,
        'ENABLE_REV_OP': 13,
        'NET_CTRL': 14,
        'NET_REF': 15,
    }
    assert {bit.name: bit.value.bit_length() - 1 for bit in Status} == {
        'READY_TO_SWITCH_ON': 0,
        'SWITCHED_ON': 1,
        'OP_ENABLED': 2,
        'FAULTED': 3,
        'VOLTAGE_ENABLED': 4,
        'QUICK_STOP_DISABLED': 5,
        'SWITCH_ON_DISABLED': 6,
        'REF_FROM_NET': 8,
        'CTRL_FROM_NET': 9,
        'SETPOINT_REACHED': 10,
        'LIMIT_ACTIVE': 11,
        'REV_OP_ENABLED': 14,
        'STOPPING': 15,
    }


@pytest.mark.parametrize(('printed', 'state'), PATTERNS)
@given(free=st.integers(0, 0xFFFF))
def test_state_of_a_pattern(printed: str, state: State, free: int) -> None:
    mask, fixed = fixed_bits(printed)
    assert state_of(fixed | free & ~mask & 0xFFFF) is state


def test_no_word_is_two_states() -> None:
    counts = dict.fromkeys(State, 0)
    patterns = [(*fixed_bits(printed), state) for printed, state in PATTERNS]
    for word in range(0x10000):
        states = {state for mask, fixed, state in patterns if word & mask == fixed}
        assert len(states) <= 1, f'{word:04X}'
        assert state_of(word) is next(iter(states), State.UNKNOWN), f'{word:04X}'
        counts[state_of(word)] += 1
    assert all(counts.values())


def test_words_that_are_no_state() -> None:
    # forward and reverse at once, and a status word of ones
    assert state_of(0x4027) is State.UNKNOWN
    assert state_of(0xFFFF) is State.UNKNOWN


def test_faulted_bit_is_set_in_the_fault_states_alone() -> None:
    for word in range(0x10000):
        faulty = state_of(word) in (State.FAULTED, State.FAULT_REACTION_ACTIVE)
        if state_of(word) is not State.UNKNOWN:
            assert faulty == bool(word & Status.FAULTED)
