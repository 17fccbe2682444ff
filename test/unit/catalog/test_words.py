# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Status codes, commands, control and status words of all families, by the manuals' tables."""

from __future__ import annotations

from fractions import Fraction
import re

from hypothesis import given, strategies as st
import pytest
from support.addresses import packed
from support.places import MSG_DEFS

from nfo_sinus_driver.catalog import Fact, Family, Kind, Meaning, Role, State, families, load_family
from nfo_sinus_driver.families.movitrac31 import words as movitrac
from nfo_sinus_driver.families.sinus_g2 import words as g2
from nfo_sinus_driver.families.sinus_optimal import words as optimal

G2, OPTIMAL = load_family('sinus_g2'), load_family('sinus_optimal')
MOVITRAC = load_family('movitrac31')
DRIVE_STATUS = MSG_DEFS / 'msg' / 'DriveStatus.msg'
WORD = st.integers(0, 0xFFFF)
KIND = st.sampled_from(Kind)
#: What firmware before 4.28 of the G2 shows for 37 to 40 [C3].
OLD_TEXTS = {37: 'Sio Stby', 38: 'Sio Run', 39: 'Sio Acc', 40: 'Sio Ret'}


# --- status codes; the texts are compared with the manuals in test_manuals.py -------------------


def of_kind(family: Family, kind: Kind) -> set[int]:
    return {code for code, entry in family.status_codes.items() if entry.kind is kind}


def test_how_grave_a_status_code_is() -> None:
    assert set(G2.status_codes) == set(range(48)) and set(OPTIMAL.status_codes) == set(range(64))
    assert of_kind(G2, Kind.FAULT) == set(range(1, 24))
    assert of_kind(G2, Kind.ALARM) == {27}
    alarms = {7, 27, 53, 55, 56, 57}
    assert of_kind(OPTIMAL, Kind.FAULT) == {*range(1, 24), *range(48, 52)} - alarms
    assert of_kind(OPTIMAL, Kind.ALARM) == alarms
    # 88 faults less the one that is no fault and the 37 without a function
    faults = of_kind(MOVITRAC, Kind.FAULT)
    assert set(MOVITRAC.status_codes) - faults == set(range(20)) and len(faults) == 88 - 1 - 37
    for family in (G2, OPTIMAL, MOVITRAC):
        for code, entry in family.status_codes.items():
            assert entry.code == code and entry.description, (family.name, code)
            # who reads of a fault wants to know what to do
            if entry.kind is not Kind.STATUS or family is not MOVITRAC:
                assert bool(entry.remedy) == (entry.kind is not Kind.STATUS), (family.name, code)
            # of the Optimal a fault "may require ack", an alarm does "not require ack" [M1]
            needs_ack = entry.kind is Kind.FAULT and not (family is G2 and code == 15)
            assert entry.requires_ack == needs_ack, (family.name, code)


def test_texts_of_older_firmware() -> None:
    for code, entry in G2.status_codes.items():
        old = OLD_TEXTS.get(code, entry.text)
        shown = [entry.shown(Fraction(version)) for version in ('3.9', '4.27', '4.28', '4.38', '5')]
        assert shown == [old, old, entry.text, entry.text, entry.text], code
        assert (entry.shown(None), entry.old_text) == (entry.text, old), code
    # SWVer comes as a binary fraction, a hair beside 4.28
    for raw, text in ((428, 'Bus Stby'), (427, 'Sio Stby')):
        firmware = Fraction(G2['fieldbus.sw_ver'].decode(packed(raw)))
        assert G2.status_code(37).shown(firmware) == text
    assert all(entry.old_text == entry.text for entry in OPTIMAL.status_codes.values())


def test_unlisted_status_code() -> None:
    for family, code in ((G2, 48), (G2, 0xFFFF), (OPTIMAL, 64)):
        entry = family.status_code(code)
        assert (entry.code, entry.text, entry.kind) == (code, f'Code {code}', Kind.STATUS)
        assert not entry.requires_ack
        assert entry.shown(Fraction('4.20')) == f'Code {code}'


def test_codes_that_mean_something_else_on_the_optimal() -> None:
    # [C49]
    for code in (1, 9, *range(18, 24), 29, 31, 32, *range(41, 45)):
        assert OPTIMAL.status_code(code).text != G2.status_code(code).text, code
    # its list of parameters is not available, so no remedy names one of the G2 [C58]
    for code, entry in OPTIMAL.status_codes.items():
        assert not re.findall(r'\w+\.\w+', entry.remedy), code


#: The beginnings of the texts of what means something, less others.
MEANINGS = {
    'sinus_g2': {
        Meaning.BUS_STANDBY: ('Bus Stby', ''),
        Meaning.BUS_RUNNING: ('Bus ', 'Bus Stby|Bus Fail'),
        Meaning.KEYPAD: ('St still|Final|Loc ', ''),
        Meaning.TERMINALS: ('Ext ', ''),
        Meaning.LOCAL_RUNNING: ('St still|Final|Loc |Ext ', 'Ext Stby'),
        Meaning.RUNNING: ('Brake Ch|Cur Limt', ''),
        Meaning.ANONYMOUS: ('Brake Ch|Cur Limt|Wait', ''),
        # the chopper takes what a motor gives back that slows down
        Meaning.SLOWING: ('Bus Ret|Brake Ch', ''),
        Meaning.CURRENT_LIMIT: ('Cur Limt', ''),
        Meaning.START_DELAY: ('Wait', ''),
        Meaning.TUNING: ('Tuning', 'TuningOK'),
        Meaning.TUNED: ('TuningOK|RsMeasOK|ParClcOK', ''),
        Meaning.TUNING_FAILED: ('TunFail', ''),
        Meaning.SERIAL_FAILURE: ('Sio Fail', ''),
        Meaning.FIELDBUS_FAILURE: ('Bus Fail', ''),
    },
    'sinus_optimal': {
        Meaning.BUS_STANDBY: ('Bus Stby', ''),
        Meaning.BUS_RUNNING: ('Bus ', 'Bus Stby|Bus Fail'),
        Meaning.TERMINALS: ('Ext ', ''),
        # of these [M1] does not say who controls: no other is left
        Meaning.KEYPAD: ('Final Freq|Accel|Decel', ''),
        Meaning.LOCAL_RUNNING: ('Ext ', 'Ext Stby'),
        Meaning.RUNNING: ('Brake Ch|Cur Limit|Final Freq|Accel|Decel', ''),
        Meaning.ANONYMOUS: (
            'Brake Ch|Cur Limit|Final Freq|Accel|Decel|Stop|Wait|Delay ', ''
        ),
        Meaning.SLOWING: ('Brake Ch|Decel|Bus Ret', ''),
        Meaning.CURRENT_LIMIT: ('Cur Limit', ''),
        Meaning.START_DELAY: ('Delay Run', ''),
        Meaning.TUNING: ('Tuning', ''),
        Meaning.TUNED: ('BasicTun|Full Tun|RsMeas Ok|ParCalc', ''),
        Meaning.TUNING_FAILED: ('Tun Fail|RsMeasFail|TuneCnvFail', ''),
        Meaning.SERIAL_FAILURE: ('Sio Fail', ''),
        Meaning.FIELDBUS_FAILURE: ('Bus Fail', ''),
    },
    'movitrac31': {
        # who has control is reported by P841 alone
        Meaning.ANONYMOUS: ('', ''),
        Meaning.SERIAL_FAILURE: ('PC time out', ''),
    },
}


@pytest.mark.parametrize('name', MEANINGS)
def test_meanings_of_status_codes(name: str) -> None:
    family, wrong = load_family(name), {}
    for meaning, (starts, but) in MEANINGS[name].items():
        called = {
            code
            for code, entry in family.status_codes.items()
            if entry.text.startswith(tuple(starts.split('|')))
            and not (but and entry.text.startswith(tuple(but.split('|'))))
        }
        found = {entry.code for entry in family.codes(meaning)}
        if found != called:
            wrong[meaning] = found ^ called
    assert wrong == {}


# --- commands and bits, by name -------------------------------------------------------------------

SCMD = (
    *(('STOP', 0x00), ('ANALOG_F', 0x03), ('ANALOG_R', 0x05), ('OP_MODE', 0x41)),
    *(('TERMINAL', 0x81), ('FIELDBUS', 0x101), ('FULL_TUNING', 0x201), ('BASIC_TUNING', 0x301)),
    *(('RS_MEASURE', 0x401), ('PAR_CALC', 0x501), ('ERASE_E_LOG', 0x800), ('RESET_E_OUT', 0x900)),
    *((f'FIX_{number}_F', 8 * number + 3) for number in range(1, 8)),
    *((f'FIX_{number}_R', 8 * number + 5) for number in range(1, 8)),
)


def test_codes_of_commands() -> None:
    # [M0 table 18] and [M1]; 3 alone is common [C51], and the three codes are codes of SCMD
    assert {code.name: code.value for code in g2.Scmd} == dict(SCMD)
    modes = {'INHIBIT': 0, 'STOP': 1, 'EXT': 2, 'BUS': 3}
    assert {mode.name: mode.value for mode in g2.Mode} == modes
    assert {mode.name: mode.value for mode in optimal.Mode} == {'MANUAL': 1, 'AUTO': 2, 'BUS': 3}
    smode = {'STOP': 0, 'TERMINAL': 0x081, 'FIELDBUS': 0x101}
    assert {code.name: code.value for code in optimal.Smode} == smode
    with pytest.raises(ValueError, match='65 is not a valid Smode'):
        optimal.Smode(0x41)  # OpMode of the G2
    assert (set(G2.profile.holders), set(OPTIMAL.profile.holders)) == (
        set(g2.Mode), set(optimal.Mode)
    )


#: The bits of the words from bit 0 on, with a hyphen for what is reserved [M0 tables 14, 15], [M1].
BITS = {
    g2.ControlWord: 'SWITCH_ON ENABLE_VOLTAGE DISABLE_QUICK_STOP ENABLE_OP ENABLE_RFG UNLOCK_RFG '
    'USE_REF_FOR_RFG RESET_MALFUNCTION - - EVENT_TRIGGERED_OP OVERRIDE_COAST AUTO_INIT '
    'ENABLE_REV_OP NET_CTRL NET_REF',
    g2.Status: 'READY_TO_SWITCH_ON SWITCHED_ON OP_ENABLED FAULTED VOLTAGE_ENABLED '
    'QUICK_STOP_DISABLED SWITCH_ON_DISABLED - REF_FROM_NET CTRL_FROM_NET SETPOINT_REACHED '
    'LIMIT_ACTIVE - - REV_OP_ENABLED STOPPING',
    optimal.ControlWord: 'SWITCH_ON ECHO_1 ECHO_2 ENABLE - - - FAULT_ACK - - - - - - BUS_CONTROL -',
    optimal.Status: 'READY SWITCHED_ON ENABLED FAULT_ACTIVE ECHO_1 ECHO_2 DISABLED ALARM_ACTIVE - '
    'CONTROL_FROM_BUS SETPOINT_REACHED LIMIT_ACTIVE SLEEP_ACTIVE STOPMODE_BRAKE REVERSE STOPPING',
}


@pytest.mark.parametrize('word', BITS, ids=lambda word: f'{word.__module__}.{word.__name__}')
def test_bits_of_the_words(word: type[g2.ControlWord]) -> None:
    names = {bit.value.bit_length() - 1: bit.name for bit in word}
    assert [names.get(bit, '-') for bit in range(16)] == BITS[word].split()


def test_bits_of_the_movitrac() -> None:
    bits = [movitrac.TERMINALS[number] for number in (41, 42, 43, *range(47, 55))]
    assert bits == [1, 2, 4, 8, 16, 32, 64, 128, 1 << 16, 1 << 17, 1 << 18]
    assert [int(bit) for bit in movitrac.Bits] == [1, 2, 4, 8, 0x40, 0x100, 0x1000, 0x8000]


# --- the state that a word shows ------------------------------------------------------------------

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


def test_every_word_of_the_g2_is_the_state_of_its_pattern_or_none() -> None:
    patterns = []
    for printed, state in PATTERNS:
        bits = printed.replace(' ', '')
        mask = int(re.sub('[01]', '1', bits).replace('X', '0'), 2)
        patterns.append((mask, int(bits.replace('X', '0'), 2), state))
    wrong = []
    for word in range(0x10000):
        states = {state for mask, fixed, state in patterns if word & mask == fixed} or {
            State.UNKNOWN
        }
        shown = g2.state_of(word)
        faulty = shown in (State.FAULTED, State.FAULT_REACTION_ACTIVE)
        if states != {shown} or (shown is not State.UNKNOWN and faulty != bool(word & 8)):
            wrong.append((f'{word:04X}', states, shown))
    assert wrong == []


#: What a word of the Optimal shows, by the example of [M1] and its bit tables.
OPTIMAL_STATES = {
    State.UNKNOWN: (0x0000, 0x0200, 0x0030, 0x2680),  # echoes among them
    State.READY_TO_SWITCH_ON: (0x0201,),  # control from bus, ready to be enabled
    State.SWITCHED_ON: (0x0205, 0x0204),  # enabled: it waits for the run command
    # switched on; set-point reached; the other way round; current limit, with its alarm; by the
    # keypad; asleep: it starts again by itself
    State.OPERATION_ENABLED: (0x0207, 0x0607, 0x4207, 0x0A87, 0x0002, 0x0042, 0x1205),
    State.STOPPING: (0xA207, 0x8205),
    State.SWITCH_ON_DISABLED: (0x0240, 0x0245),  # no RUN input
    State.FAULTED: (0x0208, 0x0049),
    State.FAULT_REACTION_ACTIVE: (0x820A,),
}


def test_states_of_the_optimal() -> None:
    shown = {word: state for state, words in OPTIMAL_STATES.items() for word in words}
    assert {word: optimal.state_of(word) for word in shown} == shown
    # one that is enabled and waits looks to the G2's eyes like no state at all
    assert G2.profile.status_word.state(0x0205) is State.UNKNOWN
    assert OPTIMAL.profile.status_word.state(0x0205) is State.SWITCHED_ON


@given(WORD)
def test_what_speaks_of_danger_goes_first(word: int) -> None:
    state = optimal.state_of(word)
    assert (state in (State.FAULTED, State.FAULT_REACTION_ACTIVE)) == bool(word & 0x0008)
    if word & 0x0002:
        # while the output stage is active the motor is never said to stand
        driven = {State.OPERATION_ENABLED, State.STOPPING, State.FAULT_REACTION_ACTIVE}
        assert state in driven
    assert state not in (State.QUICK_STOP, State.NOT_READY_TO_SWITCH_ON)  # no bit shows them


#: What each status number of the MOVITRAC shows.
NUMBERS = {
    State.SWITCH_ON_DISABLED: (0, 19),
    State.READY_TO_SWITCH_ON: (1,),
    State.OPERATION_ENABLED: (2, 8, 9, 10, 11, 14, 16, 17, 18),
    State.STOPPING: (3, 6, 12, 15),
    State.SWITCHED_ON: (4, 5, 7),
    State.QUICK_STOP: (13,),
}
FAULTS = sorted(code - 100 for code in MOVITRAC.status_codes if code >= 100)


def word_of(number: int, fault: int = 0, low: int = 0) -> int:
    """A status word of the MOVITRAC whose bytes 0 and 1 are these."""
    return fault << 24 | number << 16 | low


def shown_by(word: int) -> tuple[int, State]:
    return movitrac.code_of(word), movitrac.state_of(word)


def test_numbers_of_the_movitrac_are_decimal_or_binary() -> None:
    # [C105]
    states = {number: state for state, numbers in NUMBERS.items() for number in numbers}
    assert sorted(states) == list(range(20))
    decimal = {number: shown_by(word_of(int(str(number), 16))) for number in states}
    assert decimal == {number: (number, state) for number, state in states.items()}
    # what both codings have is decimal
    binary = {number: shown_by(word_of(number)) for number in states}
    meant = {number: number - 6 if number >= 16 else number for number in states}
    assert binary == {number: (meant[number], states[meant[number]]) for number in states}
    # 13h is coast or rapid stop: no run
    shown = {movitrac.state_of(word_of(byte)) for byte in (0x0D, 0x13, 0x19)}
    assert State.OPERATION_ENABLED not in shown
    for byte in (*range(0x1A, 0x21), 0x45, 0x64, 0x70, 0xFF):
        code, state = shown_by(word_of(byte))
        assert code not in MOVITRAC.status_codes and state is State.UNKNOWN, byte
        assert not MOVITRAC.profile.status_word.may_say(word_of(byte)), byte


def test_faults_of_the_movitrac_are_binary_or_decimal() -> None:
    for fault in FAULTS:
        assert movitrac.code_of(word_of(1, fault)) == 100 + fault
        byte = int(str(fault), 16)
        # a byte that is a fault both ways is binary
        meant = byte if byte in FAULTS else fault
        assert movitrac.code_of(word_of(1, byte)) == 100 + meant, fault
    for byte in (0x2D, 0x45):
        code = movitrac.code_of(word_of(13, byte))
        assert MOVITRAC.status_code(code).text == 'PC time out'


def test_a_fault_of_the_movitrac_may_ramp_or_coast() -> None:
    tells = MOVITRAC.profile.status_word
    for number in (0, 1, 0x19, 10, 12, 13, 0xFF):
        word = word_of(number, 45)
        stands = number in (0, 1, 0x19)
        state = State.FAULTED if stands else State.FAULT_REACTION_ACTIVE
        assert movitrac.state_of(word) is state, number
        assert Fact.FAULT in tells.facts(word, Kind.FAULT)
        assert tells.kind(word, Kind.FAULT) is Kind.FAULT


@given(st.integers(0, 0xFFFFFFFF))
def test_every_word_of_the_movitrac_has_a_code_and_a_state(word: int) -> None:
    code, state = shown_by(word)
    assert 0 <= code <= 255 and state in State
    # whether there is a fault is reported by the code, too
    facts = MOVITRAC.profile.status_word.facts(word, Kind.STATUS)
    assert (code >= 100) == bool(word >> 24) == (Fact.FAULT in facts)


# --- the facts ------------------------------------------------------------------------------------


def test_facts_are_those_of_the_message() -> None:
    text = DRIVE_STATUS.read_text(encoding='utf-8')
    printed = {name: int(value) for name, value in re.findall(r'uint32 VALID_(\w+)=(\d+)', text)}
    assert printed == {fact.name: fact.value for fact in Fact}


#: The fact of each bit, from bit 0 on; the Optimal's bit 2 is not the G2's "operation enabled",
#: 4 and 5 are echoes, 6 is the RUN input, 8 is not used [C55].
FACTS = {
    'sinus_g2': 'READY SWITCHED_ON OPERATION_ENABLED FAULT VOLTAGE_ENABLED - SWITCH_ON_DISABLED - '
    'NETWORK_REFERENCE NETWORK_CONTROL SETPOINT_REACHED LIMIT_ACTIVE - - '
    'OPERATION_ENABLED|REVERSE STOPPING',
    'sinus_optimal': 'READY SWITCHED_ON|OPERATION_ENABLED - FAULT - - RUN_INPUT_MISSING ALARM - '
    'NETWORK_CONTROL SETPOINT_REACHED LIMIT_ACTIVE SLEEPING|OPERATION_ENABLED STOP_MODE_BRAKE '
    'REVERSE STOPPING',
}
#: And what is never reported.
NOT_REPORTED = {
    'sinus_g2': Fact.SLEEPING | Fact.STOP_MODE_BRAKE | Fact.RUN_INPUT_MISSING,
    'sinus_optimal': Fact.VOLTAGE_ENABLED | Fact.QUICK_STOP_ACTIVE | Fact.SWITCH_ON_DISABLED
    | Fact.NETWORK_REFERENCE,
}


def facts_of(text: str) -> Fact:
    facts = Fact(0)
    for name in text.split('|') if text != '-' else ():
        facts |= Fact[name]
    return facts


@pytest.mark.parametrize('name', FACTS)
def test_facts_of_each_bit(name: str) -> None:
    tells = load_family(name).profile.status_word
    assert Fact(0x1FFFF) & ~tells.valid == NOT_REPORTED[name]
    expected = [facts_of(text) for text in FACTS[name].split()]
    for kind in Kind if name == 'sinus_optimal' else (Kind.STATUS,):
        assert [tells.facts(1 << bit, kind) for bit in range(16)] == expected


def test_quick_stop_of_the_g2_shows_in_the_state() -> None:
    for word, quick in ((0x8007, True), (0xC003, True), (0x8027, False), (0x0000, False)):
        facts = G2.profile.status_word.facts(word, Kind.STATUS)
        assert (Fact.QUICK_STOP_ACTIVE in facts) == quick, word


def test_facts_of_the_movitrac() -> None:
    tells, clockwise = MOVITRAC.profile.status_word, 1 << 4
    ready_on = Fact.READY | Fact.SWITCHED_ON
    expected = {
        0: Fact.SWITCH_ON_DISABLED,
        1: Fact.READY,
        7: ready_on,
        10: ready_on | Fact.OPERATION_ENABLED,
        12: Fact.SWITCHED_ON | Fact.STOPPING,
        13: Fact.SWITCHED_ON | Fact.STOPPING | Fact.QUICK_STOP_ACTIVE,
    }
    for number, facts in expected.items():
        assert tells.facts(word_of(number, low=clockwise), Kind.STATUS) == facts, number
        # reverse is the bit that is clear
        assert tells.facts(word_of(number), Kind.STATUS) == facts | Fact.REVERSE, number
    assert Fact.REVERSE in tells.valid
    assert (tells.shown, tells.by_frequency) == (0xFFFF, True)
    assert tells.sizes == {Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED}


@pytest.mark.parametrize('name', families())
@given(word=WORD, listed=KIND)
def test_no_fact_is_reported_that_is_not_valid(name: str, word: int, listed: Kind) -> None:
    tells = load_family(name).profile.status_word
    facts = tells.facts(word, listed)
    assert not facts & ~tells.valid
    # the bits and the kind never contradict each other
    kind = tells.kind(word, listed)
    assert (kind is Kind.FAULT) == (Fact.FAULT in facts)
    assert kind is not Kind.ALARM or Fact.ALARM in facts


def test_the_bits_have_the_last_word() -> None:
    # [C50], [C95]: word, kind of the code, kind on the G2, on the Optimal
    for word, listed, on_g2, on_optimal in (
        (0x0008, Kind.STATUS, Kind.FAULT, Kind.FAULT),
        (0x0008, Kind.FAULT, Kind.FAULT, Kind.FAULT),
        (0x0088, Kind.ALARM, Kind.FAULT, Kind.FAULT),
        (0x0080, Kind.STATUS, Kind.STATUS, Kind.ALARM),
        (0x0080, Kind.FAULT, Kind.ALARM, Kind.ALARM),
        (0x0000, Kind.FAULT, Kind.ALARM, Kind.STATUS),
        (0x0000, Kind.ALARM, Kind.ALARM, Kind.STATUS),
        (0x0000, Kind.STATUS, Kind.STATUS, Kind.STATUS),
    ):
        kinds = [family.profile.status_word.kind(word, listed) for family in (G2, OPTIMAL)]
        assert kinds == [on_g2, on_optimal], (word, listed)
