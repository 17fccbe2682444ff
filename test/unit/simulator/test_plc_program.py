# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The function block of the PLC for a drive, cycle by cycle."""

from hypothesis import given, strategies as st

from nfo_sinus_driver.simulator.plc import program
from nfo_sinus_driver.simulator.structured_text import Ton

#: The layout of the public interface: registers from the beginning of the block.
LAYOUT = {
    'zsw1': 0, 'actual': 1, 'plc_life': 2, 'flags': 3, 'version': 4,
    'more1': 5, 'more2': 6, 'more3': 7, 'stw1': 8, 'setpoint': 9, 'ros_life': 10,
}


class Bench:
    """A program in time that passes by command."""

    def __init__(self, **inputs):
        self.now = 0.0
        self.program = program()['FB_RosTelegram1'](lambda: self.now)
        vars(self.program).update(inputs)
        self.block = self.program.block
        self.release = True
        self.life = 0

    def cycle(self, exchanged=True, zsw1=0x1234, actual=-5, more=None, dt=0.01):
        block = self.program
        block.exchanged, block.release, block.zsw1 = exchanged, self.release, zsw1
        block.actual, block.more_valid = actual, more is not None
        block.more1, block.more2, block.more3 = more or (0, 0, 0)
        block()
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


def test_words_of_a_living_driver_go_to_the_drive_and_older_ones_do_not():
    bench = Bench()
    assert bench.ros(0x0409, 4096) == (0x0408, 0), 'what stands there before the first cycle'
    assert bench.ros(0x0409, -4096) == (0x0409, -4096)


def test_words_go_when_the_life_counter_stood_still_for_its_time():
    bench = Bench()
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


def test_watchdog_takes_its_bits_and_sets_its_bits_and_no_others():
    bench = Bench(lost_clears=0x0005, lost_sets=0x0400)
    bench.cycle()
    assert bench.ros(0xA8FF, 100) == (0xA8FF, 100)
    assert bench.wait(1.1) == (0xACFA, 0)


def test_words_of_a_longer_telegram_are_shown_by_layout_2_and_as_long_as_they_are_valid():
    bench = Bench(layout=2)
    more = (0x0001, 0xFFFF, 31)
    shown = lambda: bench.block.registers()[3:8]  # noqa: E731
    bench.cycle(more=more)
    assert shown() == (7, 2, *more)
    bench.cycle(more=None)
    assert shown()[:2] == (3, 2), 'its telegram is the short one'
    bench.cycle(more=more)
    bench.wait(0.6, exchanged=False, more=more)
    assert shown()[0] == 2
    bench = Bench()
    bench.cycle(more=more)
    assert shown() == (3, 1, 0, 0, 0)


def test_without_release_the_drive_is_stopped_at_once():
    bench = Bench()
    bench.cycle()
    bench.ros(0x0409, 4096)
    assert bench.block.flags == 3
    for release, flags in ((False, 1), (True, 3)):
        bench.release = release
        bench.cycle()
        assert (bench.block.flags, bench.words) == (flags, (0x0408, 0))


def test_life_counter_moves_with_every_exchange_and_only_then():
    bench = Bench()
    bench.block.plc_life = 65533
    for exchanged, life in ((True, 65534), (True, 65535), (True, 0), (False, 0), (True, 1)):
        bench.cycle(exchanged=exchanged)
        assert bench.block.plc_life == life


def test_data_are_valid_until_no_exchange_came_for_the_time():
    bench = Bench()
    bench.wait(2.0, exchanged=False)
    assert (bench.valid, bench.block.version) == (False, 1), 'they never came'
    bench.cycle()
    assert bench.valid
    bench.wait(0.5, exchanged=False, zsw1=0, actual=0)
    assert bench.valid
    bench.wait(0.05, exchanged=False)
    assert not bench.valid
    assert bench.block.registers()[:2] == (0x1234, 0xFFFB), 'the last that came'
    bench.cycle()
    assert bench.valid


def test_timer_is_that_of_the_standard():
    now = 0.0
    ton = Ton(lambda: now)
    for at, input_, on in ((0, True, 0), (0.9, True, 0), (1, True, 1), (1, False, 0), (5, True, 0)):
        now = at
        ton(input_, 1.0)
        assert ton.q == on, at


def test_registers_are_the_public_ones():
    for name, place in LAYOUT.items():
        block = program()['ST_RosTelegram1']()
        setattr(block, name, 0x1234)
        assert [at for at, word in enumerate(block.registers()) if word] == [place]
        block.put(place, (0xFFFF,))
        assert getattr(block, name) == (-1 if name in ('actual', 'setpoint') else 0xFFFF)
        assert (block.registers()[place], len(block.registers())) == (0xFFFF, 11)


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
def test_no_run_command_passes_without_life_and_release(cycles, lost):
    clears, sets = lost
    bench = Bench(lost_clears=clears, lost_sets=sets)
    telegram, block = bench.program, bench.block
    moved, seen = None, None
    for wait, exchanged, bench.release, zsw1, actual, written in cycles:
        bench.now += wait / 1000
        if written:
            stw1, setpoint, life = written
            block.put(8, (stw1, setpoint & 0xFFFF, life))
        if seen is not None and block.ros_life != seen:
            moved = bench.now
        seen = block.ros_life
        bench.cycle(exchanged, zsw1, actual, dt=0.0)
        if moved is None or not bench.release:
            assert not telegram.stw1 & clears & ~sets
            assert telegram.setpoint == 0
        if moved is not None and telegram.stw1 & clears & ~sets:
            # the cycle that sees it stand still comes after the one that saw it move
            assert bench.now - moved <= 1.0 + 0.7 + 1e-6
        assert (telegram.stw1, telegram.setpoint) == (block.stw1, block.setpoint)
        assert block.flags >> 1 == bench.release
