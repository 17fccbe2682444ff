# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The mailbox of the PLC: Structured Text as it is shipped, and the Python of the simulator."""

from hypothesis import given, strategies as st
import pytest
from structured_text import StRosMailbox, StRosParameter, declared, structure

from nfo_sinus_driver.simulator.plc_mailbox import Mailbox, RosMailbox, RosParameter

#: The layout of the public interface: registers from the beginning of the block.
LAYOUT = {
    'number': 16, 'command': 17, 'pnu': 18, 'sub_index': 19, 'value_high': 20, 'value_low': 21,
    'answered': 24, 'result': 25, 'read_high': 26, 'read_low': 27,
}
both = pytest.mark.parametrize(
    'programs', [(RosMailbox, RosParameter), (StRosMailbox, StRosParameter)], ids=['Python', 'ST']
)


class Bench:
    """Both programs, cycle by cycle; the PLC's own blocks answer by hand."""

    def __init__(self, programs, **inputs):
        self.mailbox = Mailbox()
        self.program = programs[0]()
        self.parameter = programs[1](**inputs)
        self.access = True
        self.cycle()

    def cycle(self, *, written=False, write_failed=False, came=None, not_yet=False, failed=False):
        one = self.parameter
        self.program(self.mailbox, self.access, one.done, one.result, one.high, one.low)
        response = [*(came or b''), *[0] * 16][:16]
        one(self.program, written, write_failed, came is not None, not_yet, failed, response)
        return self.shown

    def ask(self, number, command, pnu, sub_index=0, value=0):
        words = (command, pnu, sub_index, value >> 16, value & 0xFFFF)
        self.mailbox.put(1, words)
        self.mailbox.put(0, (number,))
        return self.cycle()

    def send(self, record):
        """Have the request go out, if it is this."""
        assert bytes(self.parameter.record[: self.parameter.length]).hex(' ') == record
        assert (self.parameter.write_record, self.parameter.read_record) == (True, False)
        self.cycle(written=True)
        assert (self.parameter.write_record, self.parameter.read_record) == (False, True)

    def come(self, response):
        """Have the response come."""
        self.cycle(came=bytes.fromhex(response))
        return self.cycle()

    @property
    def shown(self):
        return self.mailbox.registers()[8:]


@both
def test_parameter_is_read_by_the_records_of_the_profile(programs):
    bench = Bench(programs)
    assert bench.ask(7, 1, 1028, 1) == (0, 3, 0, 0)
    bench.send('01 01 00 01 10 01 04 04 00 01')
    assert bench.come('01 01 00 01 43 01 00 01 86 A0') == (7, 0, 1, 0x86A0)
    bench.ask(8, 1, 922)
    bench.send('02 01 00 01 10 01 03 9a 00 00')
    assert bench.come('02 01 00 01 42 01 FF FE') == (8, 0, 0, 0xFFFE)
    bench.ask(9, 1, 922)
    bench.send('03 01 00 01 10 01 03 9a 00 00')
    assert bench.come('03 01 00 01 41 01 7F 00') == (9, 0, 0, 0x7F)


@both
def test_write_is_in_the_format_that_the_drive_has_said(programs):
    bench = Bench(programs, axis=3)
    bench.ask(1, 2, 1028, 1, 100_000)
    bench.send('01 01 03 01 10 01 04 04 00 01')
    bench.come('01 01 03 01 43 01 00 00 00 05')
    bench.send('02 02 03 01 10 01 04 04 00 01 43 01 00 01 86 a0')
    assert bench.come('02 02 03 01') == (1, 0, 0, 0)
    bench.ask(2, 2, 1098, 0, 0xFFFF_FFF6)
    bench.send('03 01 03 01 10 01 04 4a 00 00')
    bench.come('03 01 03 01 03 01 00 05')
    bench.send('04 02 03 01 10 01 04 4a 00 00 03 01 ff f6')
    assert bench.come('04 02 03 01') == (2, 0, 0, 0)


@both
@pytest.mark.parametrize(('number', 'result'), [(0, 2), (1, 1), (2, 1), (3, 2), (0x11, 1)])
def test_refusal_has_the_number_of_the_drive(programs, number, result):
    bench = Bench(programs)
    bench.ask(1, 1, 1000)
    bench.send('01 01 00 01 10 01 03 e8 00 00')
    assert bench.come(f'01 81 00 01 44 01 00 {number:02X}') == (1, result, 0, number)


@both
def test_second_request_is_answered_busy_and_not_done(programs):
    bench = Bench(programs)
    bench.ask(5, 1, 922)
    assert bench.ask(6, 2, 1028, 1, 9) == (6, 3, 0, 0)
    bench.send('01 01 00 01 10 01 03 9a 00 00')
    assert bench.come('01 01 00 01 42 01 00 01') == (6, 3, 0, 0), 'of no request that is meant'
    bench.cycle()
    assert not bench.parameter.write_record, 'the second one is not done later either'
    assert bench.ask(7, 1, 922)[1] == 3
    bench.send('02 01 00 01 10 01 03 9a 00 00')
    assert bench.come('02 01 00 01 42 01 00 01') == (7, 0, 0, 1)


@both
def test_response_is_fetched_until_the_drive_has_it(programs):
    bench = Bench(programs)
    bench.ask(5, 1, 922)
    bench.send('01 01 00 01 10 01 03 9a 00 00')
    for _ in range(3):
        bench.cycle(not_yet=True)
        assert not bench.parameter.read_record, 'REQ needs an edge'
        bench.cycle()
        assert bench.parameter.read_record
    assert bench.come('01 01 00 01 42 01 00 01') == (5, 0, 0, 1)


@both
def test_without_access_it_says_so(programs):
    bench = Bench(programs)
    bench.access = False
    assert bench.ask(5, 1, 922)[:2] == (5, 4)
    assert not bench.parameter.write_record
    bench.access = True
    assert bench.ask(6, 3, 922)[:2] == (6, 4), 'neither read nor write'
    bench.ask(7, 1, 922)
    bench.cycle(write_failed=True)
    assert bench.cycle()[:2] == (7, 4)
    bench.ask(8, 1, 922)
    bench.send('02 01 00 01 10 01 03 9a 00 00')
    bench.cycle(failed=True)
    assert bench.cycle()[:2] == (8, 4)
    bench.ask(9, 1, 922)
    bench.send('03 01 00 01 10 01 03 9a 00 00')
    assert bench.come('02 01 00 01 42 01 00 01')[:2] == (9, 4), 'response to another request'


@both
def test_what_stands_in_the_mailbox_when_the_plc_starts_is_not_done(programs):
    bench = Bench(programs)
    other = Bench(programs)
    other.mailbox = Mailbox(5, 2, 1028, 1, 0, 9)
    other.program, other.parameter = programs[0](), programs[1]()
    for _ in range(3):
        assert other.cycle() == bench.shown == (0, 0, 0, 0)
    assert not other.parameter.write_record


def test_interface_of_both_is_the_public_one():
    types = {name: type_ for name, type_, _ in structure('ST_RosMailbox')}
    assert types.pop('reserved') == 'ARRAY[22..23] OF WORD'
    assert list(types) == list(LAYOUT)
    for name, place in LAYOUT.items():
        registers = Mailbox(**{name: 0x1234}).registers()
        assert [at for at, word in enumerate(registers, 16) if word] == [place]
    assert len(registers) == 12
    outputs = {name for name, _, _ in declared('FB_RosParameter')['VAR_OUTPUT']}
    assert outputs <= vars(RosParameter()).keys()


WORDS = st.sampled_from([0, 1, 3, 0x11, 922, 1028, 0xFFFF])
BYTES = st.sampled_from([0, 1, 2, 3, 4, 5, 0x41, 0x42, 0x43, 0x44, 0x81, 0xFF])
CYCLES = st.lists(
    st.tuples(
        st.none() | st.tuples(st.integers(0, 3), st.integers(0, 3), WORDS, WORDS, WORDS, WORDS),
        st.booleans(),
        st.sampled_from(['', 'written', 'write_failed', 'came', 'not_yet', 'read_failed']),
        st.lists(BYTES, min_size=16, max_size=16),
        st.booleans(),
    ),
    max_size=40,
)


@given(CYCLES)
def test_both_do_the_same_and_answer_only_what_was_asked(cycles):
    pairs = [(RosMailbox(), RosParameter()), (StRosMailbox(), StRosParameter())]
    boxes = [Mailbox(), Mailbox()]
    asked = {0}
    for words, access, happens, response, right in cycles:
        if words:
            asked.add(words[0])
            for box in boxes:
                box.put(0, words)
        for box, (program, one) in zip(boxes, pairs, strict=True):
            program(box, access, one.done, one.result, one.high, one.low)
            assert box.answered in asked
            said = [one.record[0], *response[1:]] if right else response
            events = ('written', 'write_failed', 'came', 'not_yet', 'read_failed')
            one(program, **{name: name == happens for name in events}, response=list(said))
        assert boxes[0] == boxes[1]
        for name in ('record', 'length', 'write_record', 'read_record', 'done'):
            assert getattr(pairs[0][1], name) == getattr(pairs[1][1], name), name
