# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The function blocks of the PLC for parameters, cycle by cycle."""

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.simulator.plc import program

#: The layout of the public interface: registers from the beginning of the block.
LAYOUT = {
    'number': 16, 'command': 17, 'pnu': 18, 'sub_index': 19, 'value_high': 20, 'value_low': 21,
    'answered': 24, 'result': 25, 'read_high': 26, 'read_low': 27,
}


class Bench:
    """Both blocks, cycle by cycle; the PLC's own blocks answer by hand."""

    def __init__(self, before=(), axis=0):
        self.program = program()['FB_RosMailbox'](None)
        self.parameter = program()['FB_RosParameter'](None)
        self.parameter.axis = axis
        self.mailbox = self.program.mailbox
        self.mailbox.put(0, before)
        self.access = True
        self.cycle()

    def cycle(self, *, written=False, write_failed=False, came=None, not_yet=False, failed=False):
        box, block = self.program, self.parameter
        box.access = self.access
        for name, value in (
            ('done', block.done), ('done_result', block.result), ('done_high', block.high),
            ('done_low', block.low),
        ):
            setattr(box, name, value)
        box()
        for name in ('request', 'command', 'pnu', 'sub_index', 'value_high', 'value_low'):
            setattr(block, name, getattr(box, name))
        block.written, block.write_failed, block.came = written, write_failed, came is not None
        block.not_yet, block.read_failed = not_yet, failed
        block.response = [*(came or b''), *[0] * 16][:16]
        block()
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


def test_parameter_is_read_by_the_records_of_the_profile():
    bench = Bench()
    bench.parameter.record[0] = 255
    assert bench.ask(7, 1, 1028, 0x0201) == (0, 3, 0, 0)
    bench.send('01 01 00 01 10 01 04 04 02 01')
    assert bench.come('01 01 00 01 43 01 00 01 86 A0') == (7, 0, 1, 0x86A0)
    bench.ask(8, 1, 922)
    bench.send('02 01 00 01 10 01 03 9a 00 00')
    assert bench.come('02 01 00 01 42 01 FF FE') == (8, 0, 0, 0xFFFE)
    bench.ask(9, 1, 922)
    bench.send('03 01 00 01 10 01 03 9a 00 00')
    assert bench.come('03 01 00 01 41 01 7F 00') == (9, 0, 0, 0x7F)


def test_write_is_in_the_format_that_the_drive_has_said():
    bench = Bench(axis=3)
    bench.parameter.record[0] = 254
    # what is left of an access before
    bench.parameter.result = bench.parameter.low = 1
    bench.ask(1, 2, 1028, 1, 0x1234_86A0)
    bench.send('ff 01 03 01 10 01 04 04 00 01')
    bench.come('ff 01 03 01 43 01 00 00 00 05')
    bench.parameter.result = bench.parameter.low = 1
    bench.send('01 02 03 01 10 01 04 04 00 01 43 01 12 34 86 a0')
    assert bench.come('01 02 03 01') == (1, 0, 0, 0)
    bench.parameter.record[0] = 2
    bench.ask(2, 2, 1098, 0, 0xFFFF_FFF6)
    bench.send('03 01 03 01 10 01 04 4a 00 00')
    bench.come('03 01 03 01 03 01 00 05')
    bench.send('04 02 03 01 10 01 04 4a 00 00 03 01 ff f6')
    assert bench.come('04 02 03 01') == (2, 0, 0, 0)
    bench.ask(3, 2, 1098, 0, 0xFFFF_FFF6)
    bench.send('05 01 03 01 10 01 04 4a 00 00')
    bench.come('05 01 03 01 41 01 05 00')
    bench.send('06 02 03 01 10 01 04 4a 00 00 41 01 f6 00')


@pytest.mark.parametrize(('number', 'result'), [(0, 2), (1, 1), (2, 1), (3, 2), (0x11, 1)])
def test_refusal_has_the_number_of_the_drive(number, result):
    bench = Bench()
    bench.ask(1, 1, 1000)
    bench.send('01 01 00 01 10 01 03 e8 00 00')
    assert bench.come(f'01 81 00 01 44 01 00 {number:02X}') == (1, result, 0, number)
    bench.ask(2, 1, 922)
    bench.send('02 01 00 01 10 01 03 9a 00 00')
    assert bench.come('02 01 00 01 42 01 00 05') == (2, 0, 0, 5)


def test_request_that_was_given_up_is_not_answered():
    bench = Bench()
    bench.ask(5, 1, 922)
    bench.mailbox.put(0, (0,))
    bench.cycle()
    bench.send('01 01 00 01 10 01 03 9a 00 00')
    assert bench.come('01 01 00 01 42 01 00 01') == (0, 3, 0, 0)


def test_second_request_is_answered_busy_and_not_done():
    bench = Bench()
    bench.ask(5, 1, 922)
    assert bench.ask(6, 2, 1028, 1, 9) == (6, 3, 0, 0)
    bench.send('01 01 00 01 10 01 03 9a 00 00')
    assert bench.come('01 01 00 01 42 01 00 01') == (6, 3, 0, 0), 'of no request that is meant'
    bench.cycle()
    assert not bench.parameter.write_record, 'the second one is not done later either'
    assert bench.ask(7, 1, 922)[1] == 3
    bench.send('02 01 00 01 10 01 03 9a 00 00')
    assert bench.come('02 01 00 01 42 01 00 01') == (7, 0, 0, 1)


def test_response_is_fetched_until_the_drive_has_it():
    bench = Bench()
    bench.ask(5, 1, 922)
    bench.send('01 01 00 01 10 01 03 9a 00 00')
    for _ in range(3):
        bench.cycle(not_yet=True)
        assert not bench.parameter.read_record, 'REQ needs an edge'
        bench.cycle()
        assert bench.parameter.read_record
    assert bench.come('01 01 00 01 42 01 00 01') == (5, 0, 0, 1)


def test_without_access_it_says_so():
    bench = Bench()
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
    bench.parameter.result = 0
    bench.cycle(failed=True)
    assert bench.cycle()[:2] == (8, 4)
    bench.ask(9, 1, 922)
    bench.send('03 01 00 01 10 01 03 9a 00 00')
    bench.parameter.result = 0
    assert bench.come('02 01 00 01 42 01 00 01')[:2] == (9, 4), 'response to another request'


def test_what_stands_in_the_mailbox_when_the_plc_starts_is_not_done():
    bench = Bench(before=(5, 2, 1028, 1, 0, 9))
    for _ in range(3):
        assert bench.cycle() == (0, 0, 0, 0)
    assert not bench.parameter.write_record


def test_registers_are_the_public_ones():
    for name, place in LAYOUT.items():
        mailbox = program()['ST_RosMailbox']()
        setattr(mailbox, name, 0x1234)
        assert [at for at, word in enumerate(mailbox.registers(), 16) if word] == [place]
        assert len(mailbox.registers()) == 12


WORDS = st.sampled_from([0, 1, 3, 0x11, 922, 1028, 0xFFFF])
CYCLES = st.lists(
    st.tuples(
        st.none() | st.tuples(st.integers(0, 3), st.integers(0, 3), WORDS, WORDS, WORDS, WORDS),
        st.booleans(),
        st.sampled_from(['written', 'write_failed', 'not_yet', 'failed', 'came', None]),
        st.binary(min_size=15, max_size=15),
    ),
    max_size=40,
)


@given(CYCLES)
def test_only_what_was_asked_is_answered(cycles):
    bench = Bench()
    asked = {0}
    for words, bench.access, happens, response in cycles:
        if words:
            asked.add(words[0])
            bench.mailbox.put(0, words)
        came = bytes((bench.parameter.record[0],)) + response
        bench.cycle(**{happens: came if happens == 'came' else True} if happens else {})
        assert bench.mailbox.answered in asked
