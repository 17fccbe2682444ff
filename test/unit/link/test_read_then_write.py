# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A read that acknowledges a fault, and the stop as the very next frame."""

from __future__ import annotations

from collections.abc import Callable

from classic_far_end import Fate as ClassicFate
from classic_link_bench import Bench as ClassicBench
from link_bench import ONE, TIMEOUT, TWO, UNIT, A, B, Bench
import pytest
from support.addresses import packed, register
from test_echo import SameWords
from virtual_wire import AsciiWire, Fate

from nfo_sinus_driver.link import DamagedAnswer, LinkError, NoAnswer, PortError, Refused
from nfo_sinus_driver.link.interface import Reply
from nfo_sinus_driver.link.modbus_ascii import AsciiLink

ACK = register(0x2A4)
STOP = register(0x3EC)
#: Behind the last character of an answer, the master's own gap at the most, s.
_SOON = 0.003


class AsciiBench(Bench):
    link_class = AsciiLink
    wire_class = AsciiWire


@pytest.fixture(params=[Bench, AsciiBench])
def modbus(request: pytest.FixtureRequest) -> Callable[..., Bench]:
    make: Callable[..., Bench] = request.param
    return make


def acknowledge_and_stop(bench: Bench) -> Reply:
    return bench.link.read_then_write(UNIT, ACK, STOP, packed(0))


def failing(bench: Bench) -> LinkError:
    with pytest.raises(LinkError) as raised:
        acknowledge_and_stop(bench)
    return raised.value


@pytest.mark.parametrize(
    'fate',
    [
        Fate(),
        Fate(what='drop'),
        Fate(what='damage'),
        Fate(1.5),
        Fate(what='double'),
        Fate(what='double', again=0.1),
        Fate(what='refuse'),
        Fate(what='refuse twice', again=0.1),
    ],
)
def test_the_stop_is_the_very_next_frame(modbus: Callable[..., Bench], fate: Fate) -> None:
    bench = modbus([fate])
    assert acknowledge_and_stop(bench).data == b''
    assert bench.slave.requests == [(UNIT, 3, 0x2A4, 1), (UNIT, 6, 0x3EC, 1)]
    bench.wire.check_gaps()
    # and what is read then belongs to its question
    assert bench.read(B).data == bench.answer_of(len(bench.asked) - 1)


def test_the_line_is_not_read_behind_an_answer_that_came_before(
    modbus: Callable[..., Bench],
) -> None:
    # the status that was read a moment ago has the very bytes
    bench = modbus()
    bench.slave = SameWords(bench.wire)
    bench.read(A)
    asked = len(bench.asked)
    acknowledge_and_stop(bench)
    assert bench.asked[asked:] == [0x2A4, 0x3EC]
    heard = [at for at, _ in bench.wire.seen if at < bench.wire.sent[-1][0]][-1]
    assert bench.wire.sent[-1][0] - heard <= max(_SOON, bench.wire.gap + 1e-9)


def test_no_resync_read_goes_first_on_a_line_in_quarantine(modbus: Callable[..., Bench]) -> None:
    bench = modbus([Fate(what='drop'), Fate(what='drop')])
    for _ in range(2):
        bench.expect(NoAnswer, lambda: bench.read(A))
    asked = len(bench.asked)
    began = bench.wire.now
    acknowledge_and_stop(bench)
    assert bench.asked[asked:] == [0x2A4, 0x3EC]
    assert bench.wire.sent[asked][0] - began <= bench.wire.gap + 1e-9


def test_the_answer_that_did_not_come_stays_in_quarantine(modbus: Callable[..., Bench]) -> None:
    bench = modbus([Fate(1.5), Fate(what='drop')])
    failing(bench)
    asked = len(bench.asked)
    assert bench.read(B).data == bench.answer_of(len(bench.asked) - 1)
    assert bench.asked[asked:] == [TWO.index, B.index]
    assert ONE.index not in bench.asked


@pytest.mark.parametrize(
    ('fate', 'error'),
    [
        (Fate(what='drop'), NoAnswer),
        (Fate(what='damage'), DamagedAnswer),
        (Fate(what='refuse'), Refused),
    ],
)
def test_the_error_is_that_of_the_write_and_the_read_may_have_been_done(
    modbus: Callable[..., Bench], fate: Fate, error: type[LinkError]
) -> None:
    bench = modbus([Fate(), fate])
    raised = failing(bench)
    assert type(raised) is error
    assert raised.maybe_done
    assert not Refused.maybe_done
    assert len(bench.asked) == 2


def test_a_lost_port_ends_it(modbus: Callable[..., Bench]) -> None:
    bench = modbus()

    def gone(_: float) -> bytes:
        if bench.asked:
            raise PortError('gone')
        bench.wire.now += TIMEOUT
        return b''

    bench.wire.read = gone  # type: ignore[method-assign]
    assert type(failing(bench)) is PortError
    assert bench.asked == [0x2A4]


# --- Classic --------------------------------------------------------------------------------------

INV_ST = register(0xE9)
INV_ST_ACK = register(0xE8)
SCMD = register(0x2A)


def classic_acknowledge_and_stop(bench: ClassicBench) -> Reply:
    return bench.link.read_then_write(bench.unit, INV_ST_ACK, SCMD, packed(0))


@pytest.mark.parametrize('what', ['answer', 'drop', 'damage', 'double', 'late', 'lump'])
def test_classic_the_stop_is_the_very_next_frame(what: str) -> None:
    fates = {
        'late': ClassicFate(1.5),
        'lump': ClassicFate(what='double', lump=True),
    }
    bench = ClassicBench(fates.get(what, ClassicFate(what=what)))
    assert classic_acknowledge_and_stop(bench).data == b''
    assert [request[1:3] for request in bench.drive.requests] == [(0xE8, None), (0x2A, 0)]
    # and what is read then belongs to its question
    assert bench.read(INV_ST_ACK).data == bench.answer_of(len(bench.asked) - 1)


@pytest.mark.parametrize('what', ['refuse', 'refuse twice'])
def test_classic_a_refused_acknowledgement_keeps_no_stop(what: str) -> None:
    bench = ClassicBench(ClassicFate(what=what))
    classic_acknowledge_and_stop(bench)
    assert bench.asked == [0xE8, 0x2A]
    heard = [at for at, _ in bench.wire.seen if at < bench.wire.sent[-1][0]][-1]
    assert bench.wire.sent[-1][0] - heard <= _SOON


def test_classic_no_resync_read_goes_first_on_a_line_in_quarantine() -> None:
    bench = ClassicBench(*[ClassicFate(what='drop')] * 3)
    for address in (INV_ST, register(0x29), INV_ST_ACK):
        with pytest.raises(NoAnswer):
            bench.read(address)
    began = bench.wire.now
    classic_acknowledge_and_stop(bench)
    assert bench.asked[3:] == [0xE8, 0x2A]
    assert bench.wire.sent[3][0] == began


def test_classic_the_read_may_have_been_done() -> None:
    bench = ClassicBench(ClassicFate(), ClassicFate(what='refuse'))
    with pytest.raises(Refused) as raised:
        classic_acknowledge_and_stop(bench)
    assert raised.value.maybe_done
