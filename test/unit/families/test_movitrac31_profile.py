# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""What a MOVITRAC 31 is told, step by step, and what it answers."""

from __future__ import annotations

from collections.abc import Mapping
import contextlib
from dataclasses import replace
import math
from typing import Any

from hypothesis import given, strategies as st
import pytest
from support.steps import REFUSED, play

from nfo_sinus_driver.catalog import Holder, NotPossible, Refusal, Removal, load_family
from nfo_sinus_driver.catalog.profile import Read, Write
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.families.movitrac31 import words

MOVITRAC = load_family('movitrac31')
BITS, SIZE = 'fieldbus.function_bits', 'fieldbus.remote_setpoint'
WORD, TERMINALS, MODE = 'fieldbus.inverter_status', 'status.terminals', 'serial.control_mode'
FREQUENCY = 'status.frequency'
FORWARD, BACKWARD, ENABLE, RESET, INHIBIT = 0b101, 0b110, 0b100, 1 << 6, 1 << 8
STANDARD, REMOTE, FIELDBUS = 'Standard', 'Remote control', 'Fieldbus'
#: Terminal 43.
CLOSED_43 = 0b100
TIMED_OUT = MOVITRAC.status_code(145)

method = MOVITRAC.profile.methods['function_bits']('fieldbus', MOVITRAC.__contains__)
target = MOVITRAC.profile.setpoints['Freque']
#: What a drive without option cards has assigned to its terminals in the factory.
FACTORY: Mapping[int, Any] = {42: 'CCW/Stop', 43: 'Enable/Stop', 47: 'n11 (n21)'}
SIZE_0 = ((Write(SIZE, 0.0), None), (Read(SIZE), 0.0))
NOTHING_ELSE = (
    (Read('control.operating_mode'), 'V/f mode'),
    (Read('control.synchronous_operation'), REFUSED),
    (Read('serial.master_slave'), False),
    (Read('serial.manual_operation'), False),
)
STILL = (
    (Read(WORD), 0x00010010),
    (Read('frequency.vf_pattern_1'), 'V/f pattern 1'),
    (Read('frequency.f_min_1'), 0.0),
)


def assigned(**changed: Any) -> tuple[tuple[Any, Any], ...]:
    """What the terminals are for, read one after the other; a card is missing for the rest."""
    functions = {**FACTORY, **{int(name[1:]): function for name, function in changed.items()}}
    return tuple(
        (Read(f'terminal.input_{number}'), functions.get(number, REFUSED))
        for number in (42, 43, 47, 48, 49, 50, 51, 52, 53, 54)
    )


@pytest.mark.parametrize(
    ('mode', 'holder'),
    [
        (STANDARD, Holder.LOCAL),
        ('Remote setpoint', Holder.LOCAL),
        (REMOTE, Holder.BUS),
        (FIELDBUS, Holder.LOCAL),
        ('9', Holder.UNKNOWN),
    ],
)
def test_who_has_control(mode: str, holder: Holder) -> None:
    assert play(method.holder(), (Read(MODE), mode)) is holder
    assert play(method.in_control(), (Read(MODE), mode)) is (holder is Holder.BUS)


def test_modes_are_those_of_the_table() -> None:
    assert set(MOVITRAC.profile.holders) == set(MOVITRAC[MODE].labels.values())


# --- before an enable -----------------------------------------------------------------------------


def test_it_can_be_started() -> None:
    closed = (Read(TERMINALS), CLOSED_43)
    mine = (Read(MODE), REMOTE)
    play(method.require_startable(), *NOTHING_ELSE, *assigned(), closed, mine, *STILL)


@pytest.mark.parametrize(
    ('at', 'found', 'reason'),
    [
        (0, 'Positioning control', 'set P770 to V/f mode or Speed control'),
        (1, True, 'set P760 to No'),
        (2, True, 'set P880 to No'),
        (3, True, 'set P870 to No at the keypad'),
    ],
)
def test_what_drives_the_motor_by_itself(at: int, found: Any, reason: str) -> None:
    script = [*NOTHING_ELSE[:at], (NOTHING_ELSE[at][0], found)]
    with pytest.raises(NotPossible, match=reason):
        play(method.require_startable(), *script)


@pytest.mark.parametrize(
    ('closed', 'changed', 'reason'),
    [
        (CLOSED_43 | 1 << 0, {}, r'terminal 41 \(CW/Stop\) is closed'),
        (CLOSED_43 | 1 << 1, {}, r'terminal 42 \(CCW/Stop\) is closed'),
        (CLOSED_43 | 1 << 18, {'t54': 'CW/Stop'}, r'terminal 54 \(CW/Stop\) is closed'),
        (0, {}, r'terminal 43 \(Enable/Stop\) is open'),
        (CLOSED_43, {'t47': 'Enable/Stop'}, r'terminal 47 \(Enable/Stop\) is open'),
        (CLOSED_43, {'t47': '/Controller inhibit'}, r'terminal 47 \(/Controller inhibit\) is open'),
    ],
)
def test_terminals_are_looked_at_first(closed: int, changed: dict[str, Any], reason: str) -> None:
    script = (*NOTHING_ELSE, *assigned(**changed), (Read(TERMINALS), closed))
    with pytest.raises(NotPossible, match=reason):
        play(method.require_startable(), *script)


def test_a_terminal_that_is_for_something_else_may_be_closed_or_open() -> None:
    other = assigned(t42='Ramp selection', t43='No function', t48='/External fault')
    closed, mine = (Read(TERMINALS), 1 << 1), (Read(MODE), REMOTE)
    play(method.require_startable(), *NOTHING_ELSE, *other, closed, mine, *STILL)


@pytest.mark.parametrize('mode', [STANDARD, FIELDBUS])
def test_a_motor_that_others_drive_is_left_alone(mode: str) -> None:
    script = [*NOTHING_ELSE, *assigned(), (Read(TERMINALS), CLOSED_43), (Read(MODE), mode)]
    with pytest.raises(NotPossible, match='driven by a fieldbus or by terminals'):
        play(method.require_startable(), *script, (Read(FREQUENCY), 12.5))
    play(method.require_startable(), *script, (Read(FREQUENCY), 0.0), *STILL)


@pytest.mark.parametrize(
    ('in_set', 'pattern', 'least'),
    [
        (1, 'V/f pattern 1', 'frequency.f_min_1'),
        (2, 'V/f pattern 2', 'frequency.f_min_2'),
        (1, 'V/f pattern 3', 'frequency.f_min_3'),
        (2, 'V/f pattern 3', 'frequency.f_min_3'),
    ],
)
def test_a_motor_that_would_turn_at_set_point_0(in_set: int, pattern: str, least: str) -> None:
    script = [*NOTHING_ELSE, *assigned(), (Read(TERMINALS), CLOSED_43), (Read(MODE), REMOTE)]
    script += [(Read(WORD), 0x00010010 | (in_set - 1) << 3)]
    script += [(Read(f'frequency.vf_pattern_{in_set}'), pattern), (Read(least), 2.0)]
    with pytest.raises(NotPossible, match=rf'set {least} to 0 \(it is 2 Hz\)'):
        play(method.require_startable(), *script)


# --- control --------------------------------------------------------------------------------------


def test_control_is_taken_where_the_line_has_it() -> None:
    play(
        method.take_control(),
        (Read(MODE), REMOTE),
        (Write(BITS, 0, head=True), None),
        *SIZE_0,
        (Read(BITS), 0),
    )


@pytest.mark.parametrize('early', [None, REFUSED])
def test_control_is_stored_once_nothing_is_left_behind(early: Refusal | None) -> None:
    play(
        method.take_control(),
        (Read(MODE), STANDARD),
        (Write(BITS, 0), early),
        (Write(SIZE, 0.0), early),
        (Read(BITS), 0),
        (Write(MODE, REMOTE, stored=True), None),
        # written again, for they may have been ignored [C110]
        (Write(BITS, 0, head=True), None),
        *SIZE_0,
        (Read(BITS), 0),
    )


@pytest.mark.parametrize('early', [None, REFUSED])
def test_a_set_point_that_is_left_behind_turns_nothing(early: Refusal | None) -> None:
    # with Remote setpoint it can be changed, and the bits do not count yet
    begun = (
        (Read(MODE), STANDARD),
        (Write(BITS, 0), early),
        (Write(SIZE, 0.0), early),
        (Read(BITS), FORWARD),
        (Read(SIZE), 20.0),
        (Write(MODE, 'Remote setpoint', stored=True), None),
    )
    play(
        method.take_control(),
        *begun,
        *SIZE_0,
        (Write(MODE, REMOTE, stored=True), None),
        (Write(BITS, 0, head=True), None),
        *SIZE_0,
        (Read(BITS), 0),
    )
    with pytest.raises(NotPossible, match='keeps a set-point of 20'):
        play(
            method.take_control(),
            *begun,
            *((Write(SIZE, 0.0), None), (Read(SIZE), 20.0)),
        )


@pytest.mark.parametrize(
    ('bits', 'size'), [(ENABLE, 20.0), (FORWARD, 0.0), (REFUSED, 20.0), (FORWARD, REFUSED)]
)
def test_what_is_left_behind_may_turn_nothing(bits: Any, size: Any) -> None:
    asked = bits is not REFUSED and bits & FORWARD != ENABLE
    play(
        method.take_control(),
        (Read(MODE), STANDARD),
        (Write(BITS, 0), None),
        (Write(SIZE, 0.0), None),
        (Read(BITS), bits),
        *(((Read(SIZE), size),) if asked else ()),
        (Write(MODE, REMOTE, stored=True), None),
        (Write(BITS, 0, head=True), None),
        *SIZE_0,
        (Read(BITS), 0),
    )


def test_control_is_not_taken_from_a_drive_that_keeps_a_command() -> None:
    with pytest.raises(NotPossible, match='keeps function bits 0005h'):
        play(
            method.take_control(),
            (Read(MODE), REMOTE),
            (Write(BITS, 0, head=True), None),
            *SIZE_0,
            (Read(BITS), FORWARD),
        )
    with pytest.raises(NotPossible, match=r'keeps a set-point of 12\.5'):
        play(
            method.take_control(),
            (Read(MODE), REMOTE),
            (Write(BITS, 0, head=True), None),
            (Write(SIZE, 0.0), None),
            (Read(SIZE), 12.5),
            (Read(BITS), 0),
        )


def test_a_drive_that_refuses_remote_control() -> None:
    with pytest.raises(Refusal):
        play(
            method.take_control(),
            (Read(MODE), STANDARD),
            (Write(BITS, 0), None),
            (Write(SIZE, 0.0), None),
            (Read(BITS), 0),
            (Write(MODE, REMOTE, stored=True), REFUSED),
        )


def test_set_point_0_leaves_the_bits_alone() -> None:
    play(method.zero_setpoint('Freque'), *SIZE_0)


def test_it_runs_forward_at_first() -> None:
    play(method.run(), (Write(BITS, FORWARD, once=True), None))
    # as set-points take it to be
    assert target.writes(0.0)[-2:] == (Write(BITS, FORWARD), Write(SIZE, 0.0))


@pytest.mark.parametrize(
    ('stands', 'left'),
    [
        (FORWARD, ENABLE),
        (BACKWARD, ENABLE),
        (0, 0),
        (INHIBIT, INHIBIT),
        (FORWARD | RESET | 1 << 3 | 1 << 12, ENABLE),
    ],
)
def test_a_stop_takes_the_direction_away_and_gives_no_enable(stands: int, left: int) -> None:
    play(
        method.stop('Freque'),
        (Read(BITS, once=True), stands),
        (Write(BITS, left, once=True), None),
        (Write(SIZE, 0.0, once=True), None),
    )


def test_a_stop_keeps_nothing_of_bits_that_it_cannot_read() -> None:
    play(
        method.stop('Freque'),
        (Read(BITS, once=True), REFUSED),
        (Write(BITS, 0, once=True), None),
        (Write(SIZE, 0.0, once=True), REFUSED),
    )


def test_a_stop_that_is_refused() -> None:
    begun = (Read(BITS, once=True), FORWARD), (Write(BITS, ENABLE, once=True), REFUSED)
    play(method.stop('Freque'), *begun, (Read(MODE), STANDARD))
    for mode in (REMOTE, REFUSED):
        with pytest.raises(Refusal):
            to_zero = Write(SIZE, 0.0, once=True), None
            play(method.stop('Freque'), *begun, (Read(MODE), mode), to_zero)


def test_set_point_0_is_written_although_the_bits_are_refused() -> None:
    steps, asked = method.stop('Freque'), []
    with pytest.raises(Refusal):
        step = next(steps)
        while True:
            asked.append(step)
            refused = step != Write(SIZE, 0.0, once=True)
            step = steps.throw(REFUSED) if refused else steps.send(None)
    assert Write(SIZE, 0.0, once=True) in asked


@pytest.mark.parametrize('late', [None, REFUSED])
def test_a_quick_stop_inhibits_the_controller(late: Refusal | None) -> None:
    assert method.coasts
    play(method.quick_stop('Freque'), (Write(BITS, INHIBIT), None), (Write(SIZE, 0.0), late))


def test_release_removes_the_bits_and_never_writes_p841() -> None:
    play(
        method.release(),
        (Read(MODE), REMOTE),
        (Write(BITS, 0), None),
        (Write(SIZE, 0.0), None),
    )
    play(method.release(), (Read(MODE), STANDARD))
    assert 'P841' in method.keeps_control


# --- faults ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('bits', 'size', 'removed'),
    [
        (None, SIZE_0, Removal.COMMAND),
        (None, ((Write(SIZE, 0.0), REFUSED),), Removal.COMMAND),
        (REFUSED, SIZE_0, Removal.SETPOINT),
        (REFUSED, ((Write(SIZE, 0.0), REFUSED),), Removal.NOTHING),
    ],
)
def test_what_a_fault_lets_go_of(bits: Any, size: Any, removed: Removal) -> None:
    assert play(method.remove('Freque'), (Write(BITS, 0), bits), *size) is removed


def test_a_fault_is_acknowledged_by_an_edge_without_run_bits() -> None:
    told = play(
        method.acknowledge(TIMED_OUT, 'Freque'),
        *assigned(),
        (Read(TERMINALS), CLOSED_43),
        (Write(BITS, 0), None),
        *SIZE_0,
        (Write(BITS, RESET), None),
        (Write(BITS, 0), None),
        (Read(MODE), 'Remote control'),
    )
    assert told == ''


@pytest.mark.parametrize('word', [0x2D010000, 0x00010000])
def test_a_reset_that_the_drive_ignores_is_told(word: int) -> None:
    ignored = pytest.raises(NotPossible, match='P841 is not Remote control')
    with ignored if word >> 24 else contextlib.nullcontext():
        play(
            method.acknowledge(TIMED_OUT, 'Freque'),
            *assigned(),
            (Read(TERMINALS), CLOSED_43),
            (Write(BITS, 0), None),
            *SIZE_0,
            (Write(BITS, RESET), None),
            (Write(BITS, 0), None),
            (Read(MODE), 'Standard'),
            (Read(WORD), word),
        )


def test_no_fault_is_acknowledged_where_a_terminal_would_start_the_motor() -> None:
    with pytest.raises(NotPossible, match='terminal 41'):
        play(
            method.acknowledge(TIMED_OUT, 'Freque'),
            *assigned(),
            (Read(TERMINALS), CLOSED_43 | 1),
        )


def test_no_fault_is_acknowledged_while_run_bits_stand() -> None:
    with pytest.raises(NotPossible, match='reset it at the keypad or by a terminal'):
        play(
            method.acknowledge(TIMED_OUT, 'Freque'),
            *assigned(),
            (Read(TERMINALS), CLOSED_43),
            (Write(BITS, 0), REFUSED),
            *SIZE_0,
        )


def test_there_is_one_control_method() -> None:
    assert list(MOVITRAC.profile.methods) == ['function_bits']
    assert play(MOVITRAC.profile.in_charge(None)) == 'function_bits'


# --- set-points -----------------------------------------------------------------------------------


def carried_out(value: float, standing: dict[str, Any]) -> list[Write]:
    """Carry out a set-point as the driver does: what changes first, then ask anew."""
    done: list[Write] = []
    while True:
        before = target.value(standing) if len(standing) == 2 else math.nan
        due = [w for w in target.writes(value, before) if standing.get(w.key) != w.value]
        if not due:
            return done
        done.append(due[0])
        standing[due[0].key] = due[0].value


@pytest.mark.parametrize(
    ('bits', 'size', 'value', 'written'),
    [
        (FORWARD, 0.0, 20.0, [(SIZE, 20.0)]),
        (FORWARD, 20.0, 30.0, [(SIZE, 30.0)]),
        (FORWARD, 20.0, 0.0, [(SIZE, 0.0)]),
        (FORWARD, 20.0, -30.0, [(SIZE, 0.0), (BITS, BACKWARD), (SIZE, 30.0)]),
        (FORWARD, 0.0, -30.0, [(BITS, BACKWARD), (SIZE, 30.0)]),
        (BACKWARD, 30.0, -20.0, [(SIZE, 20.0)]),
        # the direction stays: no way through the other one
        (BACKWARD, 30.0, 0.0, [(SIZE, 0.0)]),
        (BACKWARD, 0.0, 0.0, []),
        (BACKWARD, 30.0, 20.0, [(SIZE, 0.0), (BITS, FORWARD), (SIZE, 20.0)]),
    ],
)
def test_a_set_point_goes_through_zero(
    bits: int, size: float, value: float, written: list[tuple[str, Any]]
) -> None:
    done = carried_out(value, {BITS: bits, SIZE: size})
    assert [(write.key, write.value) for write in done] == written


def test_where_nobody_knows_what_stands_the_size_is_0_first() -> None:
    done = carried_out(-12.0, {})
    assert [(w.key, w.value) for w in done] == [(SIZE, 0.0), (BITS, BACKWARD), (SIZE, 12.0)]


@given(st.lists(st.floats(-400, 400), min_size=1, max_size=5), st.data())
def test_the_direction_never_changes_while_the_size_is_not_0(
    values: list[float], data: st.DataObject
) -> None:
    standing: dict[str, Any] = {BITS: FORWARD, SIZE: 0.0}
    for value in values:
        for write in carried_out(value, before := dict(standing)):
            if write.key == BITS:
                assert standing[SIZE] == 0
            standing[write.key] = write.value
            # a newer set-point may come between
            if data.draw(st.booleans()):
                break
        else:
            assert target.value(standing) == value
            assert standing == before


def test_a_set_point_is_rounded_to_the_steps_of_the_drive() -> None:
    for value, data in ((12.34, '00001235'), (0.02, '00000000'), (400.0, '00040000')):
        assert MOVITRAC[SIZE].quantise(value, 'movitrac') == bytes.fromhex(data)
    assert target.most == 400


@pytest.mark.parametrize(
    ('word', 'setting', 'pattern', 'base', 'nominal'),
    [
        (0x00010010, 'frequency.vf_pattern_1', 'V/f pattern 1', ('frequency.f_base_1', '50'), 50.0),
        (0x00010018, 'frequency.vf_pattern_2', 'V/f pattern 3', ('frequency.f_base_3', 87.0), 87.0),
    ],
)
def test_nominal_is_the_base_frequency_of_the_pattern_in_use(
    word: int, setting: str, pattern: str, base: tuple[str, Any], nominal: float
) -> None:
    key, value = base
    steps = ((Read(WORD), word), (Read(setting), pattern), (Read(key), value))
    assert play(target.read_nominal(MOVITRAC.__contains__), *steps) == nominal


# --- what the tables have of it -------------------------------------------------------------------


@pytest.mark.parametrize(
    ('key', 'labels'),
    [
        (MODE, {STANDARD, REMOTE, FIELDBUS}),
        ('control.operating_mode', {'Positioning control', 'V/f mode', 'Speed control'}),
        ('terminal.input_42', {'CW/Stop', 'CCW/Stop', 'Enable/Stop', '/Controller inhibit'}),
        ('frequency.vf_pattern_1', {'V/f pattern 1', 'V/f pattern 3'}),
        ('frequency.vf_pattern_2', {'V/f pattern 2', 'V/f pattern 3'}),
    ],
)
def test_labels_that_are_spoken_of_exist(key: str, labels: set[str]) -> None:
    assert labels <= set(MOVITRAC[key].labels.values())


@pytest.mark.parametrize('number', [10, 12, 13])
@pytest.mark.parametrize('fault', [0, 45])
def test_a_motor_that_stands_is_not_driven(number: int, fault: int) -> None:
    # with the enable kept it may show a normal stop for ever
    word = fault << 24 | number << 16
    status = InverterStatus(0.0, word, words.code_of(word), MOVITRAC)
    assert replace(status, frequency=3.0).driven
    assert replace(status, frequency=math.nan).driven
    assert not replace(status, frequency=0.0).driven
