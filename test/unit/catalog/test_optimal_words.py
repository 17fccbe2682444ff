# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""The Optimal's status codes and words, transcribed once more from [M1]; both dialects."""

from __future__ import annotations

from pathlib import Path
import re

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.catalog import Fact, Kind, Meaning, State, families, load_family
from nfo_sinus_driver.families.sinus_g2 import words
from nfo_sinus_driver.families.sinus_optimal.words import Control, Mode, Smode, Status, state_of

G2 = load_family('sinus_g2')
OPTIMAL = load_family('sinus_optimal')
DRIVE_STATUS = Path(__file__).resolve().parents[3] / 'msg_defs' / 'msg' / 'DriveStatus.msg'
WORD = st.integers(0, 0xFFFF)
KIND = st.sampled_from(Kind)

#: The texts on the display, and how grave they are: blank a status, ! an alarm, X a fault.
TEXTS = """\
  Erased
X GND Fail R
X AC Fail
X Temp Hi
X PTC Temp
X Overload
X Ain Fail
! DC Low
X DC High
X GND Fail S
X Imagn Low
X Cur Low
X Cur High
X Run Fail
X Sio Fail
X Bus Fail
X Tun Fail P
X Tun Fail M
X RsMeasFail
X TuneCnvFail
X Dsp ComErr
X Cop Restrt
X Dsp SysErr
X Cop ComErr
  Stop
  Wait
  Brake Ch
! Cur Limit
  Tuning
  Sleep
  Final Freq
  Accel
  Decel
  Ext Stby
  Ext Run
  Ext Acc
  Ext Ret
  Bus Stby
  Bus Run
  Bus Acc
  Bus Ret
  PI Reg
  Calibrating
  Calibr Done
  BasicTun Ok
  Full Tun Ok
  RsMeas Ok
  ParCalc Ok
X Short Circ
X DC Low Trip
X SampleTime
X Motor Volt
  Unused
! Not Tuned
  Delay Run
! DC Low Ctrl
! DC High Ctrl
! Fact Reset
  Cop FwUpdt
  Dsp FwUpdt
  Gui FwUpdt
  Unused
  Unused
  Unused
""".splitlines()
KINDS = {' ': Kind.STATUS, '!': Kind.ALARM, 'X': Kind.FAULT}

#: What a word shows, by the example of [M1] and its bit tables.
STATES = [
    (0x0000, State.UNKNOWN),
    (0x0200, State.UNKNOWN),
    (0x0030, State.UNKNOWN),  # echoes
    (0x2680, State.UNKNOWN),
    (0x0201, State.READY_TO_SWITCH_ON),  # control from bus, ready to be enabled
    (0x0205, State.SWITCHED_ON),  # enabled: it waits for the run command
    (0x0204, State.SWITCHED_ON),
    (0x0207, State.OPERATION_ENABLED),  # switched on
    (0x0607, State.OPERATION_ENABLED),  # set-point reached
    (0x4207, State.OPERATION_ENABLED),  # the other way round
    (0x0A87, State.OPERATION_ENABLED),  # current limit, with its alarm
    (0x0002, State.OPERATION_ENABLED),  # by the keypad
    (0x0042, State.OPERATION_ENABLED),
    (0x1205, State.OPERATION_ENABLED),  # asleep: it starts again by itself
    (0xA207, State.STOPPING),
    (0x8205, State.STOPPING),
    (0x0240, State.SWITCH_ON_DISABLED),  # no RUN input
    (0x0245, State.SWITCH_ON_DISABLED),
    (0x0208, State.FAULTED),
    (0x0049, State.FAULTED),
    (0x820A, State.FAULT_REACTION_ACTIVE),
]


@pytest.mark.parametrize('code', range(64))
def test_inverter_status(code: int) -> None:
    entry = OPTIMAL.status_code(code)
    assert (entry.code, entry.text) == (code, TEXTS[code][2:])
    assert entry.old_text == entry.text
    assert entry.kind is KINDS[TEXTS[code][0]]
    # a fault "may require ack", an alarm does "not require ack" [M1]
    assert entry.requires_ack == (entry.kind is Kind.FAULT)
    assert entry.description
    assert bool(entry.remedy) == (entry.kind is not Kind.STATUS)


def test_there_are_64_codes() -> None:
    assert len(TEXTS) == 64
    assert OPTIMAL.status_code(64).text == 'Code 64'


def test_remedies_name_no_parameter_of_the_g2() -> None:
    # the Optimal's list of parameters is not available [C58]
    for code in range(64):
        assert not set(re.findall(r'\w+\.\w+', OPTIMAL.status_code(code).remedy)), code


def test_codes_that_mean_something_else_than_on_the_g2() -> None:
    # [C49]
    for code in (1, 9, *range(18, 24), 29, 31, 32, *range(41, 45)):
        assert OPTIMAL.status_code(code).text != G2.status_code(code).text, code


def meaning(*meanings: Meaning) -> set[int]:
    """The codes that mean one of these."""
    return {code.code for one in meanings for code in OPTIMAL.codes(one)}


def test_meanings_of_status_codes() -> None:
    def called(*starts: str) -> set[int]:
        return {code for code in range(64) if TEXTS[code][2:].startswith(starts)}

    assert meaning(Meaning.BUS_STANDBY) == called('Bus Stby')
    assert meaning(Meaning.BUS_RUNNING) == called('Bus ') - called('Bus Stby', 'Bus Fail')
    assert meaning(Meaning.TERMINALS) == called('Ext ')
    # of Final Freq, Accel and Decel [M1] does not say who controls: nobody else is left
    assert meaning(Meaning.KEYPAD) == called('Final Freq', 'Accel', 'Decel')
    assert meaning(Meaning.LOCAL_RUNNING) == called('Ext ') - called('Ext Stby')
    unknown = called('Brake Ch', 'Cur Limit', 'Final Freq', 'Accel', 'Decel')
    assert meaning(Meaning.RUNNING) == unknown
    assert meaning(Meaning.ANONYMOUS) == unknown | called('Stop', 'Wait', 'Delay ')
    assert meaning(Meaning.SLOWING) == called('Brake Ch', 'Decel', 'Bus Ret')
    assert meaning(Meaning.CURRENT_LIMIT) == called('Cur Limit')
    assert meaning(Meaning.START_DELAY) == called('Delay Run')
    assert meaning(Meaning.TUNING) == called('Tuning')
    assert meaning(Meaning.TUNED) == called('BasicTun', 'Full Tun', 'RsMeas Ok', 'ParCalc')
    assert meaning(Meaning.TUNING_FAILED) == called('Tun Fail', 'RsMeasFail', 'TuneCnvFail')
    assert meaning(Meaning.SERIAL_FAILURE) == called('Sio Fail')
    assert meaning(Meaning.FIELDBUS_FAILURE) == called('Bus Fail')


def test_codes_of_mode_and_smode() -> None:
    assert {mode.name: mode.value for mode in Mode} == {'MANUAL': 1, 'AUTO': 2, 'BUS': 3}
    assert {code.name: code.value for code in Smode} == {
        'STOP': 0,
        'TERMINAL': 0x081,
        'FIELDBUS': 0x101,
    }
    with pytest.raises(ValueError, match='65 is not a valid Smode'):
        Smode(0x41)  # OpMode of the G2
    # 3 alone is common [C51], and the three codes are codes of SCMD
    assert Mode.BUS == words.Mode.BUS
    assert {code.value for code in Smode} < {code.value for code in words.Scmd}


def test_bits_of_the_words() -> None:
    assert {bit.name: bit.value.bit_length() - 1 for bit in Control} == {
        'SWITCH_ON': 0,
        'ECHO_1': 1,
        'ECHO_2': 2,
        'ENABLE': 3,
        'FAULT_ACK': 7,
        'BUS_CONTROL': 14,
    }
    assert {bit.name: bit.value.bit_length() - 1 for bit in Status} == {
        'READY': 0,
        'SWITCHED_ON': 1,
        'ENABLED': 2,
        'FAULT_ACTIVE': 3,
        'ECHO_1': 4,
        'ECHO_2': 5,
        'DISABLED': 6,
        'ALARM_ACTIVE': 7,
        'CONTROL_FROM_BUS': 9,
        'SETPOINT_REACHED': 10,
        'LIMIT_ACTIVE': 11,
        'SLEEP_ACTIVE': 12,
        'STOPMODE_BRAKE': 13,
        'REVERSE': 14,
        'STOPPING': 15,
    }


@pytest.mark.parametrize(('word', 'state'), STATES, ids=[f'{word:04X}' for word, _ in STATES])
def test_state(word: int, state: State) -> None:
    assert state_of(word) is state


@given(WORD)
def test_what_speaks_of_danger_goes_first(word: int) -> None:
    state = state_of(word)
    assert (state in (State.FAULTED, State.FAULT_REACTION_ACTIVE)) == bool(word & 0x0008)
    if word & 0x0002:
        # while the output stage is active the motor is never said to stand
        driven = {State.OPERATION_ENABLED, State.STOPPING, State.FAULT_REACTION_ACTIVE}
        assert state in driven
    assert state not in (State.QUICK_STOP, State.NOT_READY_TO_SWITCH_ON)  # nothing tells them


def test_facts_are_those_of_the_message() -> None:
    text = DRIVE_STATUS.read_text(encoding='utf-8')
    printed = {name: int(value) for name, value in re.findall(r'uint32 VALID_(\w+)=(\d+)', text)}
    assert printed == {fact.name: fact.value for fact in Fact}


@pytest.mark.parametrize(
    ('bit', 'facts'),
    [
        (0, Fact.READY),
        (1, Fact.SWITCHED_ON | Fact.OPERATION_ENABLED),
        (2, Fact(0)),  # ready for the run command: not the G2's "operation enabled" [C55]
        (3, Fact.FAULT),
        (4, Fact(0)),
        (5, Fact(0)),
        (6, Fact.RUN_INPUT_MISSING),
        (7, Fact.ALARM),
        (8, Fact(0)),
        (9, Fact.NETWORK_CONTROL),
        (10, Fact.SETPOINT_REACHED),
        (11, Fact.LIMIT_ACTIVE),
        (12, Fact.SLEEPING | Fact.OPERATION_ENABLED),
        (13, Fact.STOP_MODE_BRAKE),
        (14, Fact.REVERSE),
        (15, Fact.STOPPING),
    ],
)
def test_fact_of_a_bit(bit: int, facts: Fact) -> None:
    for listed in Kind:
        assert OPTIMAL.profile.status_word.facts(1 << bit, listed) == facts


@pytest.mark.parametrize(
    ('bit', 'facts'),
    [
        (0, Fact.READY),
        (1, Fact.SWITCHED_ON),
        (2, Fact.OPERATION_ENABLED),
        (3, Fact.FAULT),
        (4, Fact.VOLTAGE_ENABLED),
        (5, Fact(0)),
        (6, Fact.SWITCH_ON_DISABLED),
        (7, Fact(0)),
        (8, Fact.NETWORK_REFERENCE),
        (9, Fact.NETWORK_CONTROL),
        (10, Fact.SETPOINT_REACHED),
        (11, Fact.LIMIT_ACTIVE),
        (12, Fact(0)),
        (13, Fact(0)),
        (14, Fact.OPERATION_ENABLED | Fact.REVERSE),
        (15, Fact.STOPPING),
    ],
)
def test_fact_of_a_bit_of_the_g2(bit: int, facts: Fact) -> None:
    assert G2.profile.status_word.facts(1 << bit, Kind.STATUS) == facts


@pytest.mark.parametrize(
    ('word', 'quick'), [(0x8007, True), (0xC003, True), (0x8027, False), (0x0000, False)]
)
def test_quick_stop_of_the_g2_is_told_by_the_state(word: int, quick: bool) -> None:
    assert (Fact.QUICK_STOP_ACTIVE in G2.profile.status_word.facts(word, Kind.STATUS)) == quick


def test_facts_that_a_model_does_not_tell() -> None:
    everything = Fact(0x1FFFF)
    assert everything & ~G2.profile.status_word.valid == (
        Fact.SLEEPING | Fact.STOP_MODE_BRAKE | Fact.RUN_INPUT_MISSING
    )
    # C55: bits 4 and 5 are echoes, 6 is the RUN input, 8 is not used
    assert everything & ~OPTIMAL.profile.status_word.valid == (
        Fact.VOLTAGE_ENABLED
        | Fact.QUICK_STOP_ACTIVE
        | Fact.SWITCH_ON_DISABLED
        | Fact.NETWORK_REFERENCE
    )


@pytest.mark.parametrize('name', families())
@given(word=WORD, listed=KIND)
def test_nothing_is_told_that_is_not_valid(name: str, word: int, listed: Kind) -> None:
    tells = load_family(name).profile.status_word
    facts = tells.facts(word, listed)
    assert not facts & ~tells.valid
    # the bits and the kind never contradict each other
    kind = tells.kind(word, listed)
    assert (kind is Kind.FAULT) == (Fact.FAULT in facts)
    assert kind is not Kind.ALARM or Fact.ALARM in facts


@pytest.mark.parametrize(
    ('word', 'listed', 'g2', 'optimal'),
    [
        (0x0008, Kind.STATUS, Kind.FAULT, Kind.FAULT),
        (0x0008, Kind.FAULT, Kind.FAULT, Kind.FAULT),
        (0x0088, Kind.ALARM, Kind.FAULT, Kind.FAULT),
        (0x0080, Kind.STATUS, Kind.STATUS, Kind.ALARM),
        (0x0080, Kind.FAULT, Kind.ALARM, Kind.ALARM),
        (0x0000, Kind.FAULT, Kind.ALARM, Kind.STATUS),
        (0x0000, Kind.ALARM, Kind.ALARM, Kind.STATUS),
        (0x0000, Kind.STATUS, Kind.STATUS, Kind.STATUS),
    ],
)
def test_the_bits_have_the_last_word(word: int, listed: Kind, g2: Kind, optimal: Kind) -> None:
    # [C50], [C95]
    assert G2.profile.status_word.kind(word, listed) is g2
    assert OPTIMAL.profile.status_word.kind(word, listed) is optimal


def test_each_family_has_its_own_words() -> None:
    assert (set(G2.profile.holders), set(OPTIMAL.profile.holders)) == (set(words.Mode), set(Mode))
    # an Optimal that is enabled and waits looks to the G2's eyes like no state at all
    assert G2.profile.status_word.state(0x0205) is State.UNKNOWN
    assert OPTIMAL.profile.status_word.state(0x0205) is State.SWITCHED_ON
