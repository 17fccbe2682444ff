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
"""The simulated LAWICEL adapter: each command of its manual, and lines in any pieces."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.lawicel import Adapter

OK, NO = b'\r', b'\a'


def said(adapter: Adapter, line: bytes, *, sent: bool = True) -> bytes:
    """Return what an adapter answers to a line."""
    answer = b''
    for what in adapter.take(line + b'\r'):
        answer += adapter.tried(what, sent=sent) if isinstance(what, Frame) else what
    return answer


def opened(*lines: bytes) -> Adapter:
    """Return an adapter that is on the bus."""
    adapter = Adapter()
    for line in (b'S4', *lines, b'O'):
        assert said(adapter, line) == OK
    return adapter


@pytest.mark.parametrize(
    ('line', 'closed', 'open_'),
    [
        (b'S0', OK, NO),
        (b'S8', OK, NO),
        (b'S9', NO, NO),
        (b'S', NO, NO),
        (b's031C', NO, NO),
        (b'O', OK, NO),
        (b'L', OK, NO),
        (b'C', NO, OK),
        (b't10021133', NO, b'z\r'),
        (b't1000', NO, b'z\r'),
        (b't100211', NO, NO),
        (b't1009112233445566778899', NO, NO),
        (b't8000', NO, NO),
        (b'T0000010021133', NO, b'Z\r'),
        (b'T200000000', NO, NO),
        (b'r1002', NO, b'z\r'),
        (b'R000001000', NO, b'Z\r'),
        (b'r10021133', NO, NO),
        (b'P', NO, NO),
        (b'F', NO, b'F00\r'),
        (b'X1', OK, NO),
        (b'X0', NO, NO),
        (b'M00000000', OK, NO),
        (b'mFFFFFFFF', OK, NO),
        (b'm0', NO, NO),
        (b'V', b'V1013\r', b'V1013\r'),
        (b'N', b'NNF01\r', b'NNF01\r'),
        (b'Z1', OK, NO),
        (b'', b'', b''),
        (b'nonsense', NO, NO),
        (b'\xff', NO, NO),
    ],
)
def test_every_command(line: bytes, closed: bytes, open_: bytes) -> None:
    adapter = Adapter()
    assert said(adapter, b'S4') == OK
    assert said(adapter, line) == closed
    assert said(opened(), line) == open_


def test_it_opens_with_a_bit_rate_only() -> None:
    adapter = Adapter()
    assert said(adapter, b'O') == NO
    assert said(adapter, b'S5') + said(adapter, b'O') == OK + OK
    assert adapter.on_bus(250_000) and not adapter.on_bus(125_000)
    assert said(adapter, b'C') == OK
    assert not adapter.on_bus(250_000)


def test_an_adapter_that_only_listens_sends_nothing() -> None:
    adapter = Adapter()
    assert said(adapter, b'S4') + said(adapter, b'L') == OK + OK
    assert adapter.on_bus(125_000)
    assert said(adapter, b't1000') == NO


def test_frames_that_nobody_acknowledges_fill_its_queue() -> None:
    adapter = opened()
    assert [said(adapter, b't1000', sent=False) for _ in range(10)] == 8 * [b'z\r'] + 2 * [NO]
    assert said(adapter, b'F') == b'FA6\r'
    assert said(adapter, b'F') == b'F00\r', 'told once'
    assert said(adapter, b't1000') == b'z\r'
    assert said(adapter, b't1000', sent=False) == b'z\r', 'the queue is empty again'


@pytest.mark.parametrize(
    ('frame', 'line'),
    [
        (Frame(0x100, bytes.fromhex('1133')), b't10021133\r'),
        (Frame(0x7FF), b't7FF0\r'),
        (Frame(0x701, bytes(1), remote=True), b'r7011\r'),
        (Frame(0x100, bytes.fromhex('1133'), extended=True), b'T0000010021133\r'),
        (Frame(0x100, bytes(2), remote=True, extended=True), b'R000001002\r'),
    ],
)
def test_frames_as_lines(frame: Frame, line: bytes) -> None:
    adapter = opened()
    assert adapter.told(frame, 0.0) == line
    assert list(adapter.take(line)) == [frame]
    assert opened(b'Z1').told(frame, 61.5) == line[:-1] + b'05DC\r'


def test_acceptance_filters() -> None:
    # the first filter lets 581 through, the second 701, and nothing counts of the data
    adapter = opened(b'MB020E020', b'm001F001F')
    heard = [n for n in range(0x800) if adapter.told(Frame(n, b'\x12'), 0.0)]
    assert heard == [0x581, 0x701]
    # data counts: filter 1 wants 581 with a first byte of 43h
    adapter = opened(b'MB0240003', b'm0010FF10')
    assert adapter.told(Frame(0x581, b'\x43\x00'), 0.0)
    assert not adapter.told(Frame(0x581, b'\x80\x00'), 0.0)


@given(st.data())
def test_lines_in_any_pieces(data: st.DataObject) -> None:
    frame = st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8))
    frames = [Frame(*one) for one in data.draw(st.lists(frame, max_size=5))]
    stream = b''.join(
        f't{one.identifier:03x}{len(one.data)}{one.data.hex()}\r'.encode() for one in frames
    )
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    adapter = opened()
    found = [
        what
        for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)
        for what in adapter.take(stream[a:b])
    ]
    assert found == frames


@given(st.lists(st.binary(max_size=60), max_size=10))
def test_rubbish_is_refused_and_does_no_harm(pieces: list[bytes]) -> None:
    adapter = opened()
    for piece in pieces:
        for what in adapter.take(piece):
            assert isinstance(what, Frame) or len(what) <= 8
    list(adapter.take(b'\rC\rS4\rO\r'))
    assert adapter.on_bus(125_000)
