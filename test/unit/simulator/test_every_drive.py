# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What every simulated drive does, whatever its family: power, faults, terminals, its own time-out.

It is written and read by the keys of the tables, without a protocol. Where the manuals leave it
open a drive makes a careless driver fail; that is held here, for no test of the driver would fail
by a drive that is kinder.
"""

from collections.abc import Mapping
import contextlib
from dataclasses import dataclass, field
from typing import Any

from hypothesis import given, settings, strategies as st
import pytest
from support.examples import examples

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.simulator.drive import SimulatedDrive, describe
from nfo_sinus_driver.simulator.family import load, simulated, simulated_drive
from nfo_sinus_driver.simulator.memory import Refused

SIO_FAIL = 14


@dataclass(frozen=True)
class Way:
    """
    How a drive of a family is run, and its ways.

    :ivar run: what runs the motor, the set-point and the run command last; key and raw number.
    :ivar setting: one that can be written, and a raw number for it.
    :ivar fault: one that needs an acknowledgement.
    :ivar lost: that of a silent line.
    :ivar watch: settings with which a silent line is one, after 1 s.
    :ivar keeps: options with which the run command stands through a fault.
    :ivar drops: options with which a fault takes it.
    :ivar revived: options with which power-on leaves the set-point.
    """

    run: tuple[tuple[str, int], ...]
    setting: tuple[str, int]
    fault: int
    lost: int
    watch: Mapping[str, Any]
    keeps: Mapping[str, str] = field(default_factory=dict)
    drops: Mapping[str, str] = field(default_factory=dict)
    revived: Mapping[str, str] = field(default_factory=dict)


_SINUS_WATCH = {'serial.sio_tot': 1.0, 'serial.auto_stop': True}
WAYS = {
    'sinus_g2': Way(
        run=(('fieldbus.mode', 3), ('status.frq_set', 200), ('fieldbus.scmd', 0x101)),
        setting=('control.accel', 2000), fault=5, lost=SIO_FAIL, watch=_SINUS_WATCH,
        keeps={'run_command_in_fault': 'keeps'},
    ),
    'sinus_optimal': Way(
        run=(
            ('fieldbus.mode', 3), ('fieldbus.input_freq_setpoint', 200), ('fieldbus.smode', 0x101),
        ),
        setting=('control.accel', 2000), fault=5, lost=SIO_FAIL, watch=_SINUS_WATCH,
        drops={'run_command_in_fault': 'drops'},
    ),
    'movitrac31': Way(
        run=(
            ('serial.control_mode', 200), ('fieldbus.remote_setpoint', 2000),
            ('fieldbus.function_bits', 0x05),
        ),
        setting=('ramp.t11_up', 200), fault=101, lost=145,
        watch={'serial.pc_timeout': 1.0}, drops={'bits_in_fault': 'cleared'},
        revived={'bits_after_power_on': 'kept'},
    ),
}  # fmt: skip
every_drive = pytest.mark.parametrize('model', WAYS)


def run(drive: SimulatedDrive, seconds: float = 8.0) -> SimulatedDrive:
    for key, raw in WAYS[drive.model.name].run:
        drive.write_raw(key, raw)
    drive.advance(seconds)
    assert drive.motor.driven
    return drive


def acknowledge(drive: SimulatedDrive) -> None:
    if drive.model.name == 'movitrac31':
        drive.control_unit.press('reset')
    else:
        drive.read_raw('fieldbus.inv_st_with_ack')


def test_every_family_is_here_but_those_behind_a_fieldbus_alone() -> None:
    assert {*WAYS, 'sinus_h'} == set(simulated())


@pytest.mark.parametrize('model', simulated())
def test_every_choice_is_possible_and_no_other(model: str) -> None:
    for option in load(model).variant.options():
        for choice in option.choices:
            simulated_drive(model, **{option.name: choice})
        with pytest.raises(ValueError, match=f'{option.name}: choose one of'):
            simulated_drive(model, **{option.name: 'sideways'})


@pytest.mark.parametrize('model', simulated())
def test_it_would_take_all_that_it_leaves_the_factory_with(model: str) -> None:
    drive = simulated_drive(model)
    assert not drive.motor.driven
    for parameter in drive.memory.model.settings:
        drive.memory.check(parameter, drive.memory.raw(parameter.key))


@every_drive
def test_a_fault_releases_the_motor_until_it_is_acknowledged(model: str) -> None:
    way = WAYS[model]
    for options, runs in ((way.keeps, True), (way.drops, False)):
        drive = run(simulated_drive(model, **options))
        drive.trip(way.fault, cause_present=True)
        assert not drive.motor.driven and drive.motor.turning
        acknowledge(drive)
        assert drive.faults.codes == [way.fault], 'its cause lasts'
        drive.faults.end_causes()
        drive.advance(20.0)
        assert drive.faults.codes == [way.fault] and not drive.motor.turning
        acknowledge(drive)
        drive.advance(1.0)
        assert (drive.faults.codes, drive.motor.driven) == ([], runs)
    no_faults = [code for code in range(100) if code not in load_family(model).status_codes]
    with pytest.raises(ValueError, match=f'no fault of {model}'):
        drive.trip(no_faults[-1])


@every_drive
def test_a_run_input_that_is_back_starts_the_motor_by_the_command_that_stood(model: str) -> None:
    drive = run(simulated_drive(model))
    drive.set_run_input(False)
    drive.advance(20.0)
    assert not drive.motor.turning
    drive.set_run_input(True)
    drive.advance(0.1)
    assert drive.motor.driven


@every_drive
def test_after_a_power_cycle_it_stands_with_its_old_set_point(model: str) -> None:
    way = WAYS[model]
    drive = simulated_drive(model, **way.revived)
    setting, value = way.setting
    drive.memory.put(setting, value)
    run(drive)
    hours = drive.counters.operating_time
    drive.power_cycle(1.0)
    assert not drive.motor.driven and drive.motor.turning
    for seconds, listens in ((0.9, False), (0.2, True)):
        drive.advance(seconds)
        assert drive.listening is listens
    set_point, raw = way.run[1]
    assert (drive.memory.raw(set_point), drive.memory.raw(setting)) == (raw, value)
    assert drive.counters.operating_time >= hours
    if not way.revived:
        drive.advance(20.0)
        assert not drive.motor.turning
    drive.trip(way.fault)
    drive.power_cycle(0.0)
    assert not drive.faults
    drive.trip(way.fault, cause_present=True)
    drive.power_cycle(0.0)
    assert drive.faults.codes == [way.fault], 'its cause lasts'


@every_drive
def test_a_silent_line_is_a_fault_where_all_that_it_takes_is_set(model: str) -> None:
    way = WAYS[model]
    drive = run(simulated_drive(model, settings=way.watch), 0.5)
    for _ in range(8):
        drive.note_frame()
        drive.advance(0.9)
    assert drive.motor.driven
    # it hears nothing either
    drive.silence(5.0)
    drive.advance(0.2)
    assert drive.faults.codes == [way.lost] and not drive.motor.driven
    for left_out in way.watch:
        settings = {key: value for key, value in way.watch.items() if key != left_out}
        drive = run(simulated_drive(model, settings=settings))
        drive.advance(60.0)
        assert drive.motor.driven, left_out


@every_drive
def test_a_change_at_the_keypad_is_no_write_of_the_bus(model: str) -> None:
    drive, (key, _) = simulated_drive(model), WAYS[model].setting
    drive.set_from_keypad(key, 7.0)
    assert drive.peek(key) == 7.0 and not drive.writes
    with pytest.raises(ValueError, match='out of range'):
        drive.set_from_keypad(key, 5000)
    with pytest.raises(ValueError, match='cannot be changed'):
        drive.set_from_keypad(WAYS[model].run[-1][0], 1)
    if key in drive.model:
        drive.write_raw(key, 300)
        drive.write_raw(key, 300)
        assert drive.writes == {key: 2}
    commands = {key for key, _ in WAYS[model].run}
    run(drive)
    counted = {**drive.writes, **drive.command_writes}
    assert {key: counted[key] for key in commands} == dict.fromkeys(commands, 1)


# ---- in any order ----

#: What a master writes, by key; of telegram 1 the control word and the set-point.
WORDS = (0x0000, 0x0400, 0x0408, 0x0409, 0x0476, 0x0477, 0x047F, 0x04F6, 0x4006, 0xC07F, 0xFFFF)
_SINUS: Any = {'fieldbus.mode': (1, 2, 3), 'fieldbus.drive_control': WORDS}
WRITES: Mapping[str, Mapping[str, tuple[int, ...]]] = {
    'sinus_g2': {
        **_SINUS, 'fieldbus.scmd': (0, 0x101, 0x081, 0x005, 0x201),
        'status.frq_set': (0, 200, -300), 'telegram1': WORDS,
    },
    'sinus_optimal': {
        **_SINUS, 'fieldbus.smode': (0, 0x101, 0x081),
        'fieldbus.input_freq_setpoint': (0, 200, -300), 'telegram1': WORDS,
    },
    'movitrac31': {
        'serial.control_mode': (0, 100, 200, 300), 'fieldbus.remote_setpoint': (0, 2500, 40000),
        'fieldbus.function_bits': (0, 1, 2, 5, 6, 7, 0x40, 0x105, 0x1005),
        'terminal.input_42': (0, 100, 1100, 1200), 'control.dc_braking_1': (0, 100),
        'special.auto_reset': (0, 100),
    },
    'sinus_h': {'telegram1': WORDS},
}  # fmt: skip
KEYS = {
    'movitrac31': ('manual', 'automatic', 'cw', 'ccw', 'stop', 'reset'),
    'sinus_h': ('start', 'stop', 'reset'),
}


def happens(model: str) -> st.SearchStrategy[tuple[Any, ...]]:
    return st.one_of(
        *(
            st.tuples(st.just('write'), st.just(key), st.sampled_from(values))
            for key, values in WRITES[model].items()
        ),
        st.tuples(st.just('trip'), st.booleans()),
        st.tuples(st.just('cause gone')),
        st.tuples(st.just('power')),
        st.tuples(st.just('run input'), st.booleans()),
        st.tuples(st.just('press'), st.sampled_from(KEYS.get(model, ('stop', 'ext', 'start')))),
    )


def happen(drive: SimulatedDrive, what: str, *values: Any) -> None:
    with contextlib.suppress(Refused):
        if what == 'write' and values[0] == 'telegram1':
            drive.servers['telegram1'].exchange(values[1], 200)  # type: ignore[attr-defined]
        elif what == 'write':
            drive.write_raw(*values)
        elif what == 'trip':
            fault = {'movitrac31': 101, 'sinus_h': 11}.get(drive.model.name, 5)
            drive.trip(fault, cause_present=values[0])
        elif what == 'cause gone':
            drive.faults.end_causes()
        elif what == 'power':
            drive.power_cycle(0.0)
        elif what == 'run input':
            drive.set_run_input(*values)
        else:
            drive.control_unit.press(*values)  # type: ignore[attr-defined]


@pytest.mark.parametrize('model', simulated())
@settings(max_examples=examples(60))
@given(data=st.data())
def test_in_any_order_no_fault_turns_the_motor_and_only_a_command_does(
    model: str, data: st.DataObject
) -> None:
    drive = simulated_drive(model)
    motor, unit = drive.motor, drive.control_unit
    drive.advance(3.0)
    # by chance alone the three words of a start hardly ever come in their order
    for word in data.draw(st.sampled_from(((), (0x0476,), (0x0476, 0x0477)))):
        if 'telegram1' in WRITES[model]:
            happen(drive, 'write', 'telegram1', word)
            assert not motor.driven
    events = st.tuples(happens(model), st.sampled_from([0.0, 0.02, 0.4, 3.0]))
    for event, pause in data.draw(st.lists(events, max_size=25)):
        driven = motor.driven
        happen(drive, *event)
        if event[0] in ('trip', 'cause gone', 'power') and not driven:
            assert not motor.driven, 'nothing of these starts it'
        if model == 'sinus_h' and motor.driven and not driven and event[0] == 'write':
            assert unit.report()['state'] == 'S4'
        for seconds in (0.0, pause):
            drive.advance(seconds)
            assert not (drive.faults and motor.driven)
            assert abs(motor.frequency) <= 160.0 and (motor.driven or not motor.frequency)
        assert describe(drive)['driven'] is motor.driven
