# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The PLC's program: Structured Text as it is shipped, and the Python that simulator and tests run.

They are compared statement by statement. A compiler that makes C of Structured Text, matiec's iec2c
(github.com/nucleron/matiec), gives a second opinion where the environment variable MATIEC names the
folder that it was built in; blark, a parser, where it is installed.
"""

import ast
import ctypes
import inspect
import os
from pathlib import Path
import shutil
import subprocess
import textwrap

from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
import pytest
from structured_text import Parser
from structured_text import python_statements
from structured_text import snake

from nfo_sinus_driver.simulator.plc_program import Block
from nfo_sinus_driver.simulator.plc_program import RosTelegram1
from nfo_sinus_driver.simulator.plc_program import Ton

FOLDER = Path(__file__).parents[3] / 'config' / 'telegram1'
SHIPPED = FOLDER / 'ros_telegram1.st'
EXAMPLE = FOLDER / 'example.st'
CONFIGURATION = FOLDER / 'example_configuration.st'
#: The layout of the public interface: registers from the beginning of the block.
LAYOUT = {
    'zsw1': 0,
    'actual': 1,
    'plc_life': 2,
    'flags': 3,
    'version': 4,
    'stw1': 8,
    'setpoint': 9,
    'ros_life': 10,
}
MATIEC = os.environ.get('MATIEC', '')


@pytest.fixture(scope='module')
def shipped():
    return Parser(SHIPPED.read_text()).units()


def body_of(method):
    (function,) = ast.parse(textwrap.dedent(inspect.getsource(method))).body
    return function.body


# --- what is shipped is what is tested ---


def test_statements_are_the_same_one_by_one(shipped):
    ours = python_statements(body_of(RosTelegram1.__call__))
    theirs = shipped['FB_RosTelegram1'].body
    assert len(theirs) == len(ours)
    for one, other in zip(theirs, ours, strict=True):
        assert one == other


def test_inputs_are_the_same_and_begin_the_same(shipped):
    inputs = shipped['FB_RosTelegram1'].variables['VAR_INPUT']
    given_ = {snake(one.name): one.initial for one in inputs if one.initial is not None}
    parameters = inspect.signature(RosTelegram1).parameters.values()
    assert given_ == {one.name: one.default for one in parameters if one.name != 'clock'}
    called = list(inspect.signature(RosTelegram1.__call__).parameters)
    assert [snake(one.name) for one in inputs if one.initial is None] == called[2:]


def test_variables_are_the_same_and_begin_at_zero(shipped):
    unit = shipped['FB_RosTelegram1']
    own = vars(RosTelegram1(lambda: 0.0))
    inputs = {snake(one.name) for one in unit.variables['VAR_INPUT']}
    rest = [*unit.variables['VAR_OUTPUT'], *unit.variables['VAR']]
    assert all(one.initial is None for one in rest)
    assert {snake(one.name) for one in rest} == own.keys() - inputs
    for one in rest:
        value = own[snake(one.name)]
        if one.type == 'TON':
            assert isinstance(value, Ton)
        else:
            assert value == 0
            assert isinstance(value, bool) == (one.type == 'BOOL')


def test_block_has_the_layout_of_the_public_interface(shipped):
    offset = 0
    found = {}
    types = {}
    for one in shipped['ST_RosTelegram1'].variables['STRUCT']:
        if one.name == 'Reserved':
            assert one.type == f'ARRAY[{offset}..7]OFWORD'
            offset = 8
            continue
        found[snake(one.name)] = offset
        types[snake(one.name)] = one.type
        offset += 1
    assert found == LAYOUT
    assert {name for name, type_ in types.items() if type_ == 'INT'} == {'actual', 'setpoint'}
    for name, place in LAYOUT.items():
        block = Block(**{name: 0x1234})
        registers = block.registers()
        assert len(registers) == 11
        assert [at for at, word in enumerate(registers) if word] == [place]


def test_signed_registers_are_those_of_the_actual_value_and_the_setpoint():
    block = Block()
    block.put(0, (0xFFFF,) * 5)
    block.put(8, (0xFFFF,) * 3)
    assert [getattr(block, name) for name in LAYOUT] == [
        0xFFFF, -1, 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF, -1, 0xFFFF
    ]
    assert block.registers() == (0xFFFF,) * 5 + (0,) * 3 + (0xFFFF,) * 3


# --- what it does ---


class Bench:
    """A function block in time that passes when it is told."""

    def __init__(self, **inputs):
        self.now = 0.0
        self.program = RosTelegram1(lambda: self.now, **inputs)
        self.block = Block()
        self.release = True
        self.life = 0

    def cycle(self, exchanged=True, zsw1=0x1234, actual=-5, dt=0.01):
        self.program(self.block, zsw1, actual, exchanged, self.release)
        self.now += dt

    def ros(self, stw1, setpoint):
        """Write as the driver does."""
        self.life = (self.life + 1) % 0x10000
        self.block.put(8, (stw1, setpoint & 0xFFFF, self.life))

    def wait(self, seconds, **more):
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.cycle(**more)

    @property
    def words(self):
        return self.program.stw1, self.program.setpoint

    @property
    def valid(self):
        return bool(self.block.flags & 1)


@pytest.fixture
def bench():
    bench = Bench()
    bench.cycle()
    return bench


def test_words_of_a_living_driver_go_to_the_drive(bench):
    bench.ros(0x0409, -4096)
    bench.cycle()
    assert bench.words == (0x0409, -4096)


def test_what_stands_in_the_block_before_the_first_cycle_does_not_count():
    bench = Bench()
    bench.ros(0x0409, 4096)
    bench.cycle()
    assert bench.words == (0x0408, 0)
    bench.ros(0x0409, 4096)
    bench.cycle()
    assert bench.words == (0x0409, 4096)


def test_words_stand_for_the_time_and_go_when_the_counter_stood_still_for_it(bench):
    bench.ros(0x0409, 4096)
    bench.cycle()
    last_moved = bench.now
    while bench.now - last_moved < 0.985:
        bench.cycle()
        assert bench.words == (0x0409, 4096)
    bench.wait(0.05)
    assert bench.words == (0x0408, 0)
    assert bench.block.stw1 == 0x0408
    assert bench.block.setpoint == 0
    assert not bench.program.ros_alive


def test_watchdog_takes_its_bits_and_sets_its_bits_and_no_others():
    bench = Bench(lost_clears=0x0005, lost_sets=0x0400)
    bench.cycle()
    bench.ros(0xA8FF, 100)
    bench.cycle()
    assert bench.words == (0xA8FF, 100)
    bench.wait(1.1)
    assert bench.words == (0xACFA, 0)


def test_run_command_does_not_come_back_with_the_counter_alone(bench):
    bench.ros(0x0409, 4096)
    bench.wait(1.2)
    bench.block.put(10, (77,))
    bench.cycle()
    assert bench.program.ros_alive
    assert bench.words == (0x0408, 0), 'it has to be given again'


def test_next_write_counts_at_once(bench):
    bench.ros(0x0409, 4096)
    bench.wait(1.2)
    bench.ros(0x0409, 4096)
    bench.cycle()
    assert bench.words == (0x0409, 4096)


def test_without_release_the_drive_is_stopped_at_once(bench):
    bench.ros(0x0409, 4096)
    bench.cycle()
    assert bench.block.flags == 3
    bench.release = False
    bench.cycle()
    assert bench.block.flags == 1
    assert bench.words == (0x0408, 0)
    bench.release = True
    bench.cycle()
    assert bench.words == (0x0408, 0)


def test_life_counter_moves_with_every_exchange_and_only_then(bench):
    before = bench.block.plc_life
    for _ in range(5):
        bench.cycle()
    assert bench.block.plc_life == before + 5
    for _ in range(5):
        bench.cycle(exchanged=False)
    assert bench.block.plc_life == before + 5


def test_life_counter_goes_round(bench):
    bench.block.plc_life = 65535
    bench.cycle()
    assert bench.block.plc_life == 0


def test_data_are_valid_until_no_exchange_came_for_the_time(bench):
    assert bench.valid
    bench.cycle(exchanged=False)
    since = bench.now - 0.01
    while bench.now - since < 0.495:
        bench.cycle(exchanged=False, zsw1=0, actual=0)
        assert bench.valid
    bench.wait(0.05, exchanged=False)
    assert not bench.valid
    assert bench.block.zsw1 == 0x1234, 'the last that came'
    bench.cycle()
    assert bench.valid


def test_data_that_never_came_are_not_valid():
    bench = Bench()
    bench.wait(2.0, exchanged=False)
    assert not bench.valid
    assert bench.block.version == 1


def test_timer_is_that_of_the_standard():
    now = 0.0
    ton = Ton(lambda: now)
    ton(True, 1.0)
    now = 0.9
    ton(True, 1.0)
    assert not ton.q
    now = 1.0
    ton(True, 1.0)
    assert ton.q
    ton(False, 1.0)
    assert not ton.q
    now = 5.0
    ton(True, 1.0)
    assert not ton.q, 'it begins anew'


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
    now = 0.0
    clears, sets = lost
    program = RosTelegram1(lambda: now, lost_clears=clears, lost_sets=sets)
    block = Block()
    moved, seen = None, None
    for wait, exchanged, release, zsw1, actual, written in cycles:
        now += wait / 1000
        if written:
            stw1, setpoint, life = written
            block.put(8, (stw1, setpoint & 0xFFFF, life))
        if seen is not None and block.ros_life != seen:
            moved = now
        seen = block.ros_life
        program(block, zsw1, actual, exchanged, release)
        if moved is None or not release:
            assert not program.stw1 & clears & ~sets
            assert program.setpoint == 0
        if moved is not None and program.stw1 & clears & ~sets:
            # the cycle that sees it stand still comes after the one that saw it move
            assert now - moved <= 1.0 + 0.7 + 1e-6
        assert (program.stw1, program.setpoint) == (block.stw1, block.setpoint)
        assert block.version == 1
        assert block.flags >> 1 == release


# --- other people's compilers ---


def test_blark_reads_it():
    parse = pytest.importorskip('blark', reason='blark is not installed').parse
    for path in (SHIPPED, EXAMPLE):
        text = path.read_text()
        for found in parse.parse_source_code(text, filename=path):
            assert found.exception is None


SHIM = """
#include <time.h>
#include "POUS.h"
TIME __CURRENT_TIME;
BOOL __DEBUG = 0;
static FB_ROSTELEGRAM1 fb;

void begin(int clears, int sets) {
    __CURRENT_TIME.tv_sec = 0;
    __CURRENT_TIME.tv_nsec = 0;
    FB_ROSTELEGRAM1_init__(&fb, 0);
    fb.LOSTCLEARS.value = clears;
    fb.LOSTSETS.value = sets;
}

void run(int milliseconds, unsigned short *words, int zsw1, int actual, int exchanged,
         int release) {
    __CURRENT_TIME.tv_sec = milliseconds / 1000;
    __CURRENT_TIME.tv_nsec = milliseconds % 1000 * 1000000L;
    fb.ZSW1.value = zsw1;
    fb.ACTUAL.value = actual;
    fb.EXCHANGED.value = exchanged;
    fb.RELEASE.value = release;
    ST_ROSTELEGRAM1 *block = &fb.BLOCK.value;
    block->ZSW1 = words[0];
    block->ACTUAL = (short) words[1];
    block->PLCLIFE = words[2];
    block->FLAGS = words[3];
    block->VERSION = words[4];
    block->STW1 = words[8];
    block->SETPOINT = (short) words[9];
    block->ROSLIFE = words[10];
    FB_ROSTELEGRAM1_body__(&fb);
    words[0] = block->ZSW1;
    words[1] = block->ACTUAL;
    words[2] = block->PLCLIFE;
    words[3] = block->FLAGS;
    words[4] = block->VERSION;
    words[8] = block->STW1;
    words[9] = block->SETPOINT;
    words[10] = block->ROSLIFE;
    words[11] = fb.STW1.value;
    words[12] = fb.SETPOINT.value;
    words[13] = fb.ROSALIVE.value;
}
"""


@pytest.fixture(scope='module')
def compiled(tmp_path_factory):
    """Return the function block as matiec and the C compiler make it."""
    if not (Path(MATIEC) / 'iec2c').exists() or shutil.which('gcc') is None:
        pytest.skip('MATIEC names no folder with iec2c in it, or there is no gcc')
    folder = tmp_path_factory.mktemp('matiec')
    # last what is alone: its C is compiled further
    for paths in ((SHIPPED, EXAMPLE, CONFIGURATION), (SHIPPED,)):
        source = folder / 'all.st'
        source.write_text(''.join(path.read_text() for path in paths))
        command = [f'{MATIEC}/iec2c', '-f', '-l', '-p', '-I', f'{MATIEC}/lib', '-T', folder, source]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    (folder / 'shim.c').write_text(SHIM + '\n#include "POUS.c"\n')
    include = f'-I{MATIEC}/lib/C'
    library = folder / 'program.so'
    made = ['gcc', '-w', '-shared', '-fPIC', include, '-o', library, folder / 'shim.c']
    done = subprocess.run(made, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(library)


@settings(max_examples=300)
@given(cycles=CYCLES, lost=st.sampled_from([(1, 0), (5, 0x400), (0xFFFF, 0)]))
def test_compiled_it_does_the_same(compiled, cycles, lost):
    now = 0
    program = RosTelegram1(lambda: now / 1000, lost_clears=lost[0], lost_sets=lost[1])
    block = Block()
    compiled.begin(*lost)
    words = (ctypes.c_ushort * 14)()
    for wait, exchanged, release, zsw1, actual, written in cycles:
        now += wait
        if written:
            stw1, setpoint, life = written
            block.put(8, (stw1, setpoint & 0xFFFF, life))
            words[8:11] = [stw1, setpoint & 0xFFFF, life]
        program(block, zsw1, actual, exchanged, release)
        compiled.run(now, words, zsw1, actual, exchanged, release)
        assert tuple(words[:11]) == block.registers()
        assert list(words[11:]) == [program.stw1, program.setpoint & 0xFFFF, program.ros_alive]
