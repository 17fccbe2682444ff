# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The 34 return codes of the MOVITRAC: each with its meaning and what to do about it."""

from __future__ import annotations

from movitrac_bench import RESYNC, A, Bench
from movitrac_far_end import Fate
import pytest

from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.movitrac import DONE, REFUSALS, refusal

#: Words of the manual's table [M4 §2.1.2], and what a program makes of each code.
MANUAL = {
    0x10: ('illegal index', 'no parameter'),
    0x11: ('not implemented', 'no parameter'),
    0x12: ('read access only', 'no parameter'),
    0x13: ('parameter lock (P800) active', 'settings'),
    0x14: ('factory setting (P830) running', 'busy'),
    0x15: ('too large', 'value'),
    0x16: ('too small', 'value'),
    0x17: ('option pcb', 'no parameter'),
    0x18: ('fault in system software', 'state'),
    0x19: ('via this serial interface', 'state'),
    0x1A: ('speed control (P770) active', 'settings'),
    0x1B: ('unauthorized access', 'state'),
    0x1C: ('output stage is not inhibited', 'release'),
    0x1D: ('invalid parameter value', 'value'),
    0x22: ('4Q operation 1 (P890) required', 'settings'),
    0x23: ('4Q operation 2 (P891) required', 'settings'),
    0x24: ('DC braking 1 (P730) active', 'settings'),
    0x25: ('DC braking 2 (P733) active', 'settings'),
    0x26: ('hoist function set 1 (P710) active', 'settings'),
    0x27: ('hoist function set 2 (P712) active', 'settings'),
    0x29: ('via this serial interface', 'state'),
    0x2A: ('speed control (P770) inactive', 'settings'),
    0x2B: ('controller inhibit required', 'release'),
    0x2C: ('motor size-up 1 (P328) and rapid start 1 (P720)', 'settings'),
    0x2D: ('motor size-up 2 (P348) and rapid start 2 (P723)', 'settings'),
    0x2E: ('option pcb', 'no parameter'),
    0x2F: ('4Q operation 1 (P890) and DC braking 1 (P730)', 'settings'),
    0x30: ('4Q operation 2 (P891) and DC braking 2 (P733)', 'settings'),
    0x31: ('controller inhibit active', 'state'),
    0x32: ('synchronous operation control (P760) inactive', 'settings'),
    0x33: ('slave of the synchronous operation control (P761)', 'settings'),
    0x34: ('illegal message type', 'no function'),
}
KINDS = {
    'no parameter': Refused.ILLEGAL_ADDRESS,
    'value': Refused.ILLEGAL_VALUE,
    'state': Refused.DEVICE_FAILURE,
    'settings': Refused.SETTINGS_CONFLICT,
    'release': Refused.RELEASE_NEEDED,
    'busy': Refused.BUSY,
    'no function': Refused.ILLEGAL_FUNCTION,
}


def test_every_code_of_the_manual_is_known() -> None:
    # the other two inform
    assert REFUSALS.keys() == MANUAL.keys() and DONE.keys() == {0x1E, 0x28}
    assert len(REFUSALS) + len(DONE) == 34


@pytest.mark.parametrize('code', MANUAL)
def test_a_refusal_says_what_it_means_and_what_to_do(code: int) -> None:
    bench = Bench(Fate(what='refuse'))
    bench.drive.code = code
    with pytest.raises(Refused) as raised:
        bench.write(A)
    meaning, kind = MANUAL[code]
    assert raised.value.code == KINDS[kind]
    assert meaning in str(raised.value)
    text, _, remedy = str(raised.value).partition(': ')
    assert text and remedy.removesuffix(f' (return code {code:02X})') == REFUSALS[code].remedy
    assert str(raised.value) == raised.value.behind.removeprefix(': ')
    assert bench.asked == [A.index]


@pytest.mark.parametrize('code', DONE)
def test_what_only_informs_is_done(code: int) -> None:
    bench = Bench(Fate(what='refuse'), Fate(what='refuse'))
    bench.drive.code = code
    assert bench.write(A).data == b''
    # nothing was asked for that could be done
    with pytest.raises(Refused, match=f'return code {code:02X}'):
        bench.read(A)


@pytest.mark.parametrize('code', [0, 0x0F, 0x1F, 0x21, 0x35, 0xFF])
def test_a_code_that_no_manual_lists(code: int) -> None:
    bench = Bench(Fate(what='refuse'))
    bench.drive.code = code
    with pytest.raises(Refused, match=f'no manual lists why .return code {code:02X}.') as raised:
        bench.read(A)
    assert raised.value.code == Refused.DEVICE_FAILURE
    assert str(raised.value) == str(refusal(code))


def test_a_refusal_is_an_answer() -> None:
    bench = Bench(Fate(what='refuse'))
    with pytest.raises(Refused) as raised:
        bench.read(A)
    assert not raised.value.maybe_done
    bench.read(A)
    assert bench.asked == [A.index, A.index], f'nothing was in doubt, {RESYNC} not asked'


@pytest.mark.parametrize('code', [0x1C, 0x2B])
def test_a_remedy_for_inhibit_names_what_an_operator_has(code: int) -> None:
    # the name of the command is added where that is known
    assert 'quick stop' in REFUSALS[code].remedy
    assert '/Controller inhibit' in REFUSALS[code].remedy
