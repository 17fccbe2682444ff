# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The PLC's program: Structured Text as it is shipped, and the Python that the simulator runs."""

from hypothesis import given, strategies as st
import pytest
from structured_text import StRosTelegram1, structure

from nfo_sinus_driver.simulator.plc_program import Block, RosTelegram1, Ton

#: The layout of the public interface: registers from the beginning of the block.
LAYOUT = {
    'zsw1': 0, 'actual': 1, 'plc_life': 2, 'flags': 3, 'version': 4,
    'more1': 5, 'more2': 6, 'more3': 7, 'stw1': 8, 'setpoint': 9, 'ros_life': 10,
}
both = pytest.mark.parametrize('program', [RosTelegram1, StRosTelegram1])


class Bench:
    """A program in time that passes by command."""

    def __init__(self, program, **inputs):
        self.now = 0.0
        self.program = program(lambda: self.now, **inputs)
        self.block = Block()
        self.release = True
        self.life = 0

    def cycle(self, exchanged=True, zsw1=0x1234, actual=-5, more=None, dt=0.01):
        self.program(self.block, zsw1, actual, exchanged, self.release, more)
        self.now += dt

    def ros(self, stw1, setpoint):
        """Write as the driver does, and run once."""
        self.life = (self.life + 1) % 0x10000
        self.block.put(8, (stw1, setpoint & 0xFFFF, self.life))
        self.cycle()
        return self.words

    def wait(self, seconds, **more):
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.cycle(**more)
        return self.words

    @property
    def words(self):
        return self.program.stw1, self.program.setpoint

    @property
    def valid(self):
        return bool(self.block.flags & 1)


@both
def test_words_of_a_living_driver_go_to_the_drive_and_older_ones_do_not(program):
    bench = Bench(program)
    assert bench.ros(0x0409, 4096) == (0x0408, 0), 'what stands there before the first cycle'
    assert bench.ros(0x0409, -4096) == (0x0409, -4096)


@both
def test_words_go_when_the_life_counter_stood_still_for_its_time(program):
    bench = Bench(program)
    bench.cycle()
    assert bench.ros(0x0409, 4096) == (0x0409, 4096)
    assert bench.wait(0.98) == (0x0409, 4096)
    assert bench.wait(0.05) == (0x0408, 0)
    assert (bench.block.stw1, bench.block.setpoint) == (0x0408, 0)
    assert not bench.program.ros_alive
    bench.block.put(10, (77,))
    bench.cycle()
    assert bench.program.ros_alive
    assert bench.words == (0x0408, 0), 'it has to be given again'
    assert bench.ros(0x0409, 4096) == (0x0409, 4096)


@both
def test_watchdog_takes_its_bits_and_sets_its_bits_and_no_others(program):
    bench = Bench(program, lost_clears=0x0005, lost_sets=0x0400)
    bench.cycle()
    assert bench.ros(0xA8FF, 100) == (0xA8FF, 100)
    assert bench.wait(1.1) == (0xACFA, 0)


@both
def test_words_of_a_longer_telegram_are_shown_by_layout_2_and_as_long_as_they_are_valid(program):
    bench = Bench(program, layout=2)
    more = (0x0001, 0xFFFF, 31)
    shown = lambda: bench.block.registers()[3:8]  # noqa: E731
    bench.cycle(more=more)
    assert shown() == (7, 2, *more)
    bench.cycle(more=None)
    assert shown()[:2] == (3, 2), 'its telegram is the short one'
    bench.cycle(more=more)
    bench.wait(0.6, exchanged=False, more=more)
    assert shown()[0] == 2
    bench = Bench(program)
    bench.cycle(more=more)
    assert shown() == (3, 1, 0, 0, 0)


@both
def test_without_release_the_drive_is_stopped_at_once(program):
    bench = Bench(program)
    bench.cycle()
    bench.ros(0x0409, 4096)
    assert bench.block.flags == 3
    for release, flags in ((False, 1), (True, 3)):
        bench.release = release
        bench.cycle()
        assert (bench.block.flags, bench.words) == (flags, (0x0408, 0))


@both
def test_life_counter_moves_with_every_exchange_and_only_then(program):
    bench = Bench(program)
    bench.block.plc_life = 65533
    for exchanged, life in ((True, 65534), (True, 65535), (True, 0), (False, 0), (True, 1)):
        bench.cycle(exchanged=exchanged)
        assert bench.block.plc_life == life


@both
def test_data_are_valid_until_no_exchange_came_for_the_time(program):
    bench = Bench(program)
    bench.wait(2.0, exchanged=False)
    assert (bench.valid, bench.block.version) == (False, 1), 'they never came'
    bench.cycle()
    assert bench.valid
    bench.wait(0.5, exchanged=False, zsw1=0, actual=0)
    assert bench.valid
    bench.wait(0.05, exchanged=False)
    assert not bench.valid
    assert bench.block.zsw1 == 0x1234, 'the last that came'
    bench.cycle()
    assert bench.valid


def test_timer_is_that_of_the_standard():
    now = 0.0
    ton = Ton(lambda: now)
    for at, input_, on in ((0, True, 0), (0.9, True, 0), (1, True, 1), (1, False, 0), (5, True, 0)):
        now = at
        ton(input_, 1.0)
        assert ton.q == on, at


def test_interface_of_both_is_the_public_one():
    types = {name: type_ for name, type_, _ in structure('ST_RosTelegram1')}
    assert list(types) == list(LAYOUT)
    signed = {name for name, type_ in types.items() if type_ == 'INT'}
    for name, place in LAYOUT.items():
        registers = Block(**{name: 0x1234}).registers()
        assert [at for at, word in enumerate(registers) if word] == [place]
        block = Block()
        block.put(place, (0xFFFF,))
        assert getattr(block, name) == (-1 if name in signed else 0xFFFF)
        assert (block.registers()[place], len(registers)) == (0xFFFF, 11)
    of_st, of_python = (one(lambda: 0.0) for one in (StRosTelegram1, RosTelegram1))
    for name in ('lost_clears', 'lost_sets', 'ros_time', 'drive_time', 'layout'):
        assert getattr(of_st, name) == getattr(of_python, name), name


WORDS = st.integers(0, 0xFFFF)
CYCLES = st.lists(
    st.tuples(
        st.integers(1, 700),
        st.booleans(),
        st.booleans(),
        WORDS,
        st.integers(-0x8000, 0x7FFF),
        st.none() | st.tuples(WORDS, st.integers(-0x8000, 0x7FFF), WORDS | st.integers(0, 3)),
    ),
    max_size=30,
)


@given(CYCLES, st.sampled_from([(1, 0), (5, 0x400), (0xFFFF, 0)]))
def test_both_do_the_same_and_no_run_command_passes_without_life_and_release(cycles, lost):
    now = 0.0
    clears, sets = lost
    program, other = (
        one(lambda: now, lost_clears=clears, lost_sets=sets)
        for one in (RosTelegram1, StRosTelegram1)
    )
    block, others = Block(), Block()
    moved, seen = None, None
    for wait, exchanged, release, zsw1, actual, written in cycles:
        now += wait / 1000
        if written:
            stw1, setpoint, life = written
            for one in (block, others):
                one.put(8, (stw1, setpoint & 0xFFFF, life))
        if seen is not None and block.ros_life != seen:
            moved = now
        seen = block.ros_life
        program(block, zsw1, actual, exchanged, release)
        other(others, zsw1, actual, exchanged, release)
        assert others.registers() == block.registers()
        for name in ('stw1', 'setpoint', 'ros_alive'):
            assert getattr(other, name) == getattr(program, name)
        if moved is None or not release:
            assert not program.stw1 & clears & ~sets
            assert program.setpoint == 0
        if moved is not None and program.stw1 & clears & ~sets:
            # the cycle that sees it stand still comes after the one that saw it move
            assert now - moved <= 1.0 + 0.7 + 1e-6
        assert (program.stw1, program.setpoint) == (block.stw1, block.setpoint)
        assert block.flags >> 1 == release
