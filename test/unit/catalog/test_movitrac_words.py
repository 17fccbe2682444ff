# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""What the status word of the MOVITRAC 31 says, index 284, however its numbers are coded [C105]."""

from __future__ import annotations

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.catalog import Fact, Kind, State, load_family
from nfo_sinus_driver.families.movitrac31 import words

MOVITRAC = load_family('movitrac31')
WORD = MOVITRAC.profile.status_word
ENABLED, CLOCKWISE = 10, 1 << 4
FAULTS = sorted(code - 100 for code in MOVITRAC.status_codes if code >= 100)

#: What each status number shows.
STATES = {
    0: State.SWITCH_ON_DISABLED,
    1: State.READY_TO_SWITCH_ON,
    2: State.OPERATION_ENABLED,
    3: State.STOPPING,
    4: State.SWITCHED_ON,
    5: State.SWITCHED_ON,
    6: State.STOPPING,
    7: State.SWITCHED_ON,
    8: State.OPERATION_ENABLED,
    9: State.OPERATION_ENABLED,
    10: State.OPERATION_ENABLED,
    11: State.OPERATION_ENABLED,
    12: State.STOPPING,
    13: State.QUICK_STOP,
    14: State.OPERATION_ENABLED,
    15: State.STOPPING,
    16: State.OPERATION_ENABLED,
    17: State.OPERATION_ENABLED,
    18: State.OPERATION_ENABLED,
    19: State.SWITCH_ON_DISABLED,
}


def word(number: int, fault: int = 0, low: int = 0) -> int:
    """A status word whose bytes 0 and 1 are these."""
    return fault << 24 | number << 16 | low


def decimal(number: int) -> int:
    """A number as two packed digits."""
    return int(str(number), 16)


@pytest.mark.parametrize(('number', 'state'), STATES.items())
def test_decimal_numbers(number: int, state: State) -> None:
    told = word(decimal(number))
    assert words.code_of(told) == number
    assert words.state_of(told) is state
    assert MOVITRAC.status_code(number).text


@pytest.mark.parametrize('number', range(16))
def test_binary_numbers(number: int) -> None:
    assert words.code_of(word(number)) == number
    assert words.state_of(word(number)) is STATES[number]


@pytest.mark.parametrize(('binary', 'shown'), [(16, 10), (17, 11), (18, 12), (19, 13)])
def test_numbers_that_both_codings_have_are_decimal(binary: int, shown: int) -> None:
    assert words.code_of(word(binary)) == shown
    assert words.state_of(word(binary)) is STATES[shown]


def test_coast_and_rapid_stop_are_no_run() -> None:
    # 13h is the one or the other
    shown = {words.state_of(word(byte)) for byte in (0x0D, 0x13, 0x19)}
    assert State.OPERATION_ENABLED not in shown


@pytest.mark.parametrize('byte', [*range(0x1A, 0x20), 0x20, 0x45, 0x64, 0x70, 0xFF])
def test_a_number_that_is_none(byte: int) -> None:
    assert words.code_of(word(byte)) not in MOVITRAC.status_codes
    assert words.state_of(word(byte)) is State.UNKNOWN
    assert not WORD.may_say(word(byte))


@pytest.mark.parametrize('fault', FAULTS)
def test_binary_faults(fault: int) -> None:
    assert words.code_of(word(1, fault)) == 100 + fault


@pytest.mark.parametrize('fault', FAULTS)
def test_decimal_faults(fault: int) -> None:
    byte = decimal(fault)
    # a byte that is a fault both ways is binary
    assert words.code_of(word(1, byte)) == 100 + (byte if byte in FAULTS else fault)


@pytest.mark.parametrize('byte', [0x2D, 0x45])
def test_the_time_out_of_the_line_is_always_told(byte: int) -> None:
    assert MOVITRAC.status_code(words.code_of(word(13, byte))).text == 'PC time out'


@pytest.mark.parametrize(
    ('number', 'state'),
    [
        (0, State.FAULTED),
        (1, State.FAULTED),
        (0x19, State.FAULTED),
        (ENABLED, State.FAULT_REACTION_ACTIVE),
        (12, State.FAULT_REACTION_ACTIVE),
        (13, State.FAULT_REACTION_ACTIVE),
        (0xFF, State.FAULT_REACTION_ACTIVE),
    ],
)
def test_a_fault_may_ramp_or_coast(number: int, state: State) -> None:
    told = word(number, 45)
    assert words.state_of(told) is state
    assert Fact.FAULT in WORD.facts(told, Kind.FAULT)
    assert WORD.kind(told, Kind.FAULT) is Kind.FAULT


@pytest.mark.parametrize('number', range(16))
def test_reverse_is_the_bit_that_is_clear(number: int) -> None:
    assert Fact.REVERSE in WORD.facts(word(number), Kind.STATUS)
    assert Fact.REVERSE not in WORD.facts(word(number, low=CLOCKWISE), Kind.STATUS)
    assert Fact.REVERSE in WORD.valid


@pytest.mark.parametrize(
    ('number', 'facts'),
    [
        (0, Fact.SWITCH_ON_DISABLED),
        (1, Fact.READY),
        (7, Fact.READY | Fact.SWITCHED_ON),
        (10, Fact.READY | Fact.SWITCHED_ON | Fact.OPERATION_ENABLED),
        (12, Fact.SWITCHED_ON | Fact.STOPPING),
        (13, Fact.SWITCHED_ON | Fact.STOPPING | Fact.QUICK_STOP_ACTIVE),
    ],
)
def test_facts(number: int, facts: Fact) -> None:
    assert WORD.facts(word(number, low=CLOCKWISE), Kind.STATUS) == facts


def test_what_is_published_of_it() -> None:
    assert WORD.shown == 0xFFFF
    assert WORD.by_frequency
    assert WORD.tells_sign


@given(st.integers(0, 0xFFFFFFFF))
def test_every_word_has_a_code_and_a_state(told: int) -> None:
    code = words.code_of(told)
    assert 0 <= code <= 255
    # whether there is a fault is told by the code, too
    assert (code >= 100) == bool(told >> 24) == (Fact.FAULT in WORD.facts(told, Kind.STATUS))
    assert words.state_of(told) in State


def test_bits_of_the_terminals() -> None:
    bits = [words.TERMINALS[number] for number in (41, 42, 43, 47, 48, 49, 50, 51, 52, 53, 54)]
    assert bits == [1, 2, 4, 8, 16, 32, 64, 128, 1 << 16, 1 << 17, 1 << 18]


def test_function_bits() -> None:
    assert [int(bit) for bit in words.Bits] == [1, 2, 4, 8, 0x40, 0x100, 0x1000, 0x8000]
