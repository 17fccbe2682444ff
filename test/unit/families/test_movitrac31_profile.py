# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The requests to a MOVITRAC 31, step by step, and its answers."""

from __future__ import annotations

from collections.abc import Mapping
import contextlib
from dataclasses import replace
import math
from typing import Any

from hypothesis import given, strategies as st
import pytest
from support.steps import REFUSED, play

from nfo_sinus_driver.catalog import Holder, Limits, NotPossible, Refusal, Removal, load_family
from nfo_sinus_driver.catalog.profile import FAULT_GONE, Read, Write
from nfo_sinus_driver.drive.known.snapshot import InverterStatus
from nfo_sinus_driver.families.movitrac31 import words

MOVITRAC = load_family('movitrac31')
BITS, SIZE = 'fieldbus.function_bits', 'fieldbus.remote_setpoint'
WORD, TERMINALS, MODE = 'fieldbus.inverter_status', 'status.terminals', 'serial.control_mode'
FREQUENCY = 'status.frequency'
FORWARD, BACKWARD, ENABLE, RESET, INHIBIT = 0b101, 0b110, 0b100, 1 << 6, 1 << 8
STANDARD, REMOTE, FIELDBUS = 'Standard', 'Remote control', 'Fieldbus'
REMOTE_SETPOINT = 'Remote setpoint'
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


def test_who_has_control() -> None:
    holders = {
        STANDARD: Holder.LOCAL,
        'Remote setpoint': Holder.LOCAL,
        REMOTE: Holder.BUS,
        FIELDBUS: Holder.LOCAL,
    }
    assert set(MOVITRAC.profile.holders) == set(MOVITRAC[MODE].labels.values())
    for mode, holder in {**holders, '9': Holder.UNKNOWN}.items():
        assert play(method.holder(), (Read(MODE), mode)) is holder
        assert play(method.in_control(), (Read(MODE), mode)) is (holder is Holder.BUS)


def test_p841_says_which_control_method_is_in_charge() -> None:
    assert list(MOVITRAC.profile.methods) == ['function_bits', 'remote_setpoint']
    for mode, name in (
        (REMOTE, 'function_bits'), (STANDARD, 'function_bits'), (FIELDBUS, 'function_bits'),
        (REMOTE_SETPOINT, 'remote_setpoint'),
    ):
        assert play(MOVITRAC.profile.active_method(None), (Read(MODE), mode)) == name


# --- before an enable -----------------------------------------------------------------------------


def startable(*script: tuple[Any, Any], refused: str = '') -> None:
    """Whether it may be started, from what it answers; or why not."""
    with pytest.raises(NotPossible, match=refused) if refused else contextlib.nullcontext():
        play(method.require_startable(), *script)


def terminals(closed: int = CLOSED_43, **changed: Any) -> tuple[tuple[Any, Any], ...]:
    """What is read before an enable, the functions of the terminals and which are closed last."""
    return (*NOTHING_ELSE, *assigned(**changed), (Read(TERMINALS), closed))


def test_it_can_be_started() -> None:
    mine = (Read(MODE), REMOTE)
    startable(*terminals(), mine, *STILL)
    # a terminal that is for something else may be closed or open
    other = {'t42': 'Ramp selection', 't43': 'No function', 't48': '/External fault'}
    startable(*terminals(1 << 1, **other), mine, *STILL)


def test_what_drives_the_motor_by_itself() -> None:
    for at, (found, reason) in enumerate((
        ('Positioning control', 'set P770 to V/f mode or Speed control'),
        (True, 'set P760 to No'),
        (True, 'set P880 to No'),
        (True, 'set P870 to No at the keypad'),
    )):
        startable(*NOTHING_ELSE[:at], (NOTHING_ELSE[at][0], found), refused=reason)


def test_terminals_are_looked_at_first() -> None:
    inhibit = '/Controller inhibit'
    for closed, changed, reason in (
        (CLOSED_43 | 1 << 0, {}, r'terminal 41 \(CW/Stop\) is closed'),
        (CLOSED_43 | 1 << 1, {}, r'terminal 42 \(CCW/Stop\) is closed'),
        (CLOSED_43 | 1 << 18, {'t54': 'CW/Stop'}, r'terminal 54 \(CW/Stop\) is closed'),
        (0, {}, r'terminal 43 \(Enable/Stop\) is open'),
        (CLOSED_43, {'t47': 'Enable/Stop'}, r'terminal 47 \(Enable/Stop\) is open'),
        (CLOSED_43, {'t47': inhibit}, rf'terminal 47 \({inhibit}\) is open'),
    ):
        startable(*terminals(closed, **changed), refused=reason)


def test_a_motor_that_others_drive_is_left_alone() -> None:
    for mode in (STANDARD, FIELDBUS):
        script = (*terminals(), (Read(MODE), mode))
        reason = 'driven by a fieldbus or by terminals'
        startable(*script, (Read(FREQUENCY), 12.5), refused=reason)
        startable(*script, (Read(FREQUENCY), 0.0), *STILL)


def test_a_motor_that_would_turn_at_set_point_0() -> None:
    for in_set, pattern, least in ((1, 1, 1), (2, 2, 2), (1, 3, 3), (2, 3, 3)):
        key = f'frequency.f_min_{least}'
        startable(
            *terminals(),
            (Read(MODE), REMOTE),
            (Read(WORD), 0x00010010 | (in_set - 1) << 3),
            (Read(f'frequency.vf_pattern_{in_set}'), f'V/f pattern {pattern}'),
            (Read(key), 2.0),
            refused=rf'set {key} to 0 \(it is 2 Hz\)',
        )


# --- control --------------------------------------------------------------------------------------


#: What is written under control, again, for it may have been ignored before [C110].
CLEARED = ((Write(BITS, 0, head=True), None), *SIZE_0, (Read(BITS), 0))
TO_REMOTE = Write(MODE, REMOTE, stored=True)


def begun(
    bits: Any, *size: tuple[Any, Any], early: Refusal | None = None, found: str = STANDARD
) -> Any:
    """Control is not with the line: bits and set-point are cleared and read first."""
    cleared = (Write(BITS, 0), early), (Write(SIZE, 0.0), early)
    return (Read(MODE), found), *cleared, (Read(BITS), bits), *size


def test_control_is_taken_where_the_line_has_it() -> None:
    play(method.take_control(), (Read(MODE), REMOTE), *CLEARED)


@pytest.mark.parametrize('early', [None, REFUSED])
def test_control_is_stored_once_nothing_is_left_behind(early: Refusal | None) -> None:
    play(method.take_control(), *begun(0, early=early), (TO_REMOTE, None), *CLEARED)


@pytest.mark.parametrize('early', [None, REFUSED])
def test_a_set_point_that_is_left_behind_turns_nothing(early: Refusal | None) -> None:
    # with Remote setpoint it can be changed, and the bits do not count yet
    script = (
        *begun(FORWARD, (Read(SIZE), 20.0), early=early),
        (Write(MODE, 'Remote setpoint', stored=True), None),
    )
    play(method.take_control(), *script, *SIZE_0, (TO_REMOTE, None), *CLEARED)


#: How it goes on where control is not taken although P841 was changed for it: what is seen to.
STANDS = (*assigned(), (Read(TERMINALS), CLOSED_43), (Read(FREQUENCY), 0.0))
BACK = Write(MODE, STANDARD, stored=True)


@pytest.mark.parametrize(('failing', 'error'), [
    (((Write(SIZE, 0.0), None), (Read(SIZE), 20.0)), NotPossible),
    (((Write(SIZE, 0.0), REFUSED),), Refusal),
    ((*SIZE_0, (TO_REMOTE, REFUSED)), Refusal),
])
@pytest.mark.parametrize(('found', 'seen'), [
    (STANDARD, (*STANDS, (BACK, None))),
    (STANDARD, (*STANDS, (BACK, REFUSED))),
    # neither where the motor could start by that, nor where it turns
    (STANDARD, (*assigned(), (Read(TERMINALS), CLOSED_43 | 1))),
    (STANDARD, (*STANDS[:-1], (Read(FREQUENCY), 3.0))),
    (STANDARD, (*STANDS[:-2], (Read(TERMINALS), REFUSED))),
    (FIELDBUS, ()),
])
def test_where_control_is_not_taken_p841_is_put_back_unless_the_motor_could_start(
    failing: Any, error: type[Exception], found: str, seen: Any
) -> None:
    script = begun(FORWARD, (Read(SIZE), 20.0), found=found)
    to_setpoint = Write(MODE, 'Remote setpoint', stored=True), None
    with pytest.raises(error):
        play(method.take_control(), *script, to_setpoint, *failing, *seen)


def test_what_is_left_behind_may_turn_nothing() -> None:
    for bits, *size in (
        (ENABLE,),
        (REFUSED,),
        (FORWARD, (Read(SIZE), 0.0)),
        (FORWARD, (Read(SIZE), REFUSED)),
    ):
        play(method.take_control(), *begun(bits, *size), (TO_REMOTE, None), *CLEARED)


def test_control_is_not_taken_from_a_drive_that_keeps_a_command() -> None:
    cleared = (Read(MODE), REMOTE), (Write(BITS, 0, head=True), None)
    with pytest.raises(NotPossible, match='keeps function bits 0005h'):
        play(method.take_control(), *cleared, *SIZE_0, (Read(BITS), FORWARD))
    keeps = (Write(SIZE, 0.0), None), (Read(SIZE), 12.5), (Read(BITS), 0)
    with pytest.raises(NotPossible, match=r'keeps a set-point of 12\.5'):
        play(method.take_control(), *cleared, *keeps)
    with pytest.raises(Refusal):
        play(method.take_control(), *begun(0), (TO_REMOTE, REFUSED))


def test_set_point_0_leaves_the_bits_alone() -> None:
    play(method.zero_setpoint('Freque'), *SIZE_0)


def test_it_runs_forward_at_first() -> None:
    play(method.run(), (Write(BITS, FORWARD, retry=False), None))
    # as set-points take it to be
    assert target.writes(0.0)[-2:] == (Write(BITS, FORWARD), Write(SIZE, 0.0))


def test_a_stop_takes_the_direction_away_and_gives_no_enable() -> None:
    for stands, left in (
        (FORWARD, ENABLE),
        (BACKWARD, ENABLE),
        (0, 0),
        (INHIBIT, INHIBIT),
        (FORWARD | RESET | 1 << 3 | 1 << 12, ENABLE),
        # it keeps nothing of bits that it cannot read
        (REFUSED, 0),
    ):
        play(
            method.stop('Freque'),
            (Read(BITS, retry=False), stands),
            (Write(BITS, left, retry=False), None),
            (Write(SIZE, 0.0, retry=False), REFUSED if stands is REFUSED else None),
        )


def test_a_stop_that_is_refused() -> None:
    begun = (Read(BITS, retry=False), FORWARD), (Write(BITS, ENABLE, retry=False), REFUSED)
    play(method.stop('Freque'), *begun, (Read(MODE), STANDARD))
    for mode in (REMOTE, REFUSED):
        with pytest.raises(Refusal):
            to_zero = Write(SIZE, 0.0, retry=False), None
            play(method.stop('Freque'), *begun, (Read(MODE), mode), to_zero)


def test_set_point_0_is_written_although_the_bits_are_refused() -> None:
    steps, asked = method.stop('Freque'), []
    with pytest.raises(Refusal):
        step = next(steps)
        while True:
            asked.append(step)
            refused = step != Write(SIZE, 0.0, retry=False)
            step = steps.throw(REFUSED) if refused else steps.send(None)
    assert Write(SIZE, 0.0, retry=False) in asked


def test_a_quick_stop_inhibits_the_controller() -> None:
    assert method.coasts
    for late in (None, REFUSED):
        play(method.quick_stop('Freque'), (Write(BITS, INHIBIT), None), (Write(SIZE, 0.0), late))


def test_a_rapid_stop_takes_the_enable_with_the_direction() -> None:
    assert method.stop_ramp
    cleared = Write(BITS, 0, retry=False), Write(SIZE, 0.0, retry=False)
    play(method.rapid_stop('Freque'), (cleared[0], None), (cleared[1], None))
    play(method.rapid_stop('Freque'), (cleared[0], REFUSED), (Read(MODE), STANDARD))


def test_release_removes_the_bits_and_never_writes_p841() -> None:
    cleared = (Write(BITS, 0), None), (Write(SIZE, 0.0), None)
    play(method.release(), (Read(MODE), REMOTE), *cleared)
    play(method.release(), (Read(MODE), STANDARD))
    assert 'P841' in method.control_retained


# --- faults ---------------------------------------------------------------------------------------


def test_what_a_fault_lets_go_of() -> None:
    kept = ((Write(SIZE, 0.0), REFUSED),)
    for bits, size, removed in (
        (None, SIZE_0, Removal.COMMAND),
        (None, kept, Removal.COMMAND),
        (REFUSED, SIZE_0, Removal.SETPOINT),
        (REFUSED, kept, Removal.NOTHING),
    ):
        assert play(method.remove('Freque'), (Write(BITS, 0), bits), *size) is removed


def acknowledged(*script: tuple[Any, Any], closed: int = CLOSED_43) -> object:
    """Acknowledge a time-out of the line, from what the drive answers."""
    looked = *assigned(), (Read(TERMINALS), closed)
    return play(method.acknowledge(TIMED_OUT, 'Freque'), *looked, *script)


def test_a_fault_is_acknowledged_by_an_edge_without_run_bits() -> None:
    cleared = (Write(BITS, 0), None), *SIZE_0
    for late in (None, REFUSED):
        # its word is taken now and then: the bit stands until the fault is gone
        held = () if late else ((FAULT_GONE, True),)
        edge = (Write(BITS, RESET), late), *held, (Write(BITS, 0), late)
        elsewhere = *cleared, (Read(MODE), STANDARD), *edge
        acknowledged(*elsewhere, (Read(WORD), 0x00010000))
        with pytest.raises(NotPossible, match='P841 is not Remote control'):
            acknowledged(*elsewhere, (Read(WORD), 0x2D010000))
    mine = *cleared, (Read(MODE), REMOTE)
    held = (Write(BITS, RESET), None), (FAULT_GONE, True), (Write(BITS, 0), None)
    assert acknowledged(*mine, *held) == ''
    with pytest.raises(Refusal):
        acknowledged(*mine, (Write(BITS, RESET), REFUSED))


def test_no_fault_is_acknowledged_where_the_motor_would_start() -> None:
    with pytest.raises(NotPossible, match='terminal 41'):
        acknowledged(closed=CLOSED_43 | 1)
    # while run bits stand
    with pytest.raises(NotPossible, match='reset it at the keypad or by a terminal'):
        acknowledged((Write(BITS, 0), REFUSED), *SIZE_0)


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


def test_a_set_point_goes_through_zero() -> None:
    for bits, size, value, *written in (
        (FORWARD, 0.0, 20.0, (SIZE, 20.0)),
        (FORWARD, 20.0, 30.0, (SIZE, 30.0)),
        (FORWARD, 20.0, 0.0, (SIZE, 0.0)),
        (FORWARD, 20.0, -30.0, (SIZE, 0.0), (BITS, BACKWARD), (SIZE, 30.0)),
        (FORWARD, 0.0, -30.0, (BITS, BACKWARD), (SIZE, 30.0)),
        (BACKWARD, 30.0, -20.0, (SIZE, 20.0)),
        # the direction stays: no way through the other one
        (BACKWARD, 30.0, 0.0, (SIZE, 0.0)),
        (BACKWARD, 0.0, 0.0),
        (BACKWARD, 30.0, 20.0, (SIZE, 0.0), (BITS, FORWARD), (SIZE, 20.0)),
    ):
        done = carried_out(value, {BITS: bits, SIZE: size})
        assert [(write.key, write.value) for write in done] == written
    # where it is not known what stands, the size is 0 first
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


def test_limits_are_those_of_the_pattern_in_use() -> None:
    for word, in_set, pattern, base, greatest, most in (
        (0x00010010, 1, 1, '50', 70.0, 70.0),
        (0x00010018, 2, 2, '60', 40.0, 40.0),
        (0x00010018, 2, 3, 87.0, 400.0, 400.0),
    ):
        steps = (
            (Read(WORD), word),
            (Read(f'frequency.vf_pattern_{in_set}'), f'V/f pattern {pattern}'),
            (Read(f'frequency.f_base_{pattern}'), base),
            (Read(f'frequency.f_max_{pattern}'), greatest),
        )
        limits = play(target.read_limits(MOVITRAC.__contains__), *steps)
        assert limits == Limits(-most, most, float(base))


# --- what the tables have of it -------------------------------------------------------------------


def test_labels_that_are_spoken_of_exist() -> None:
    for key, labels in (
        (MODE, {STANDARD, REMOTE, FIELDBUS}),
        ('control.operating_mode', {'Positioning control', 'V/f mode', 'Speed control'}),
        ('terminal.input_42', {'CW/Stop', 'CCW/Stop', 'Enable/Stop', '/Controller inhibit'}),
        ('frequency.vf_pattern_1', {'V/f pattern 1', 'V/f pattern 3'}),
        ('frequency.vf_pattern_2', {'V/f pattern 2', 'V/f pattern 3'}),
    ):
        assert labels <= set(MOVITRAC[key].labels.values()), key


def test_a_motor_that_stands_is_not_driven() -> None:
    # with the enable kept it may show a normal stop without end
    for word in (number << 16 | fault << 24 for number in (10, 12, 13) for fault in (0, 45)):
        status = InverterStatus(0.0, word, words.code_of(word), MOVITRAC)
        assert replace(status, frequency=3.0).driven
        assert replace(status, frequency=math.nan).driven
        assert not replace(status, frequency=0.0).driven
