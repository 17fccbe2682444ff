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
"""How long CAN frames are on the wire (ISO 11898-1)."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.can_frames import bits

FRAMES = st.builds(
    Frame, st.integers(0, 0x7FF), st.binary(max_size=8), st.booleans(), st.just(False)
)


def checked(frame: Frame) -> str:
    """Return the bits of a standard frame up to its check sum, by long division."""
    head = f'0{frame.identifier:011b}{int(frame.remote)}00{len(frame.data):04b}'
    head += '' if frame.remote else ''.join(f'{byte:08b}' for byte in frame.data)
    rest = int(head + 15 * '0', 2)
    # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
    for place in reversed(range(15, len(head) + 15)):
        if rest >> place & 1:
            rest ^= 0xC599 << place - 15
    return f'{head}{rest:015b}'


@given(FRAMES)
def test_stuffing_by_another_way(frame: Frame) -> None:
    sent, stuffed = checked(frame), ''
    for bit in sent:
        stuffed += bit
        if stuffed[-5:] in ('00000', '11111') and len(stuffed) >= 5:
            stuffed += '1' if bit == '0' else '0'
    assert bits(frame) == len(stuffed) + 13


@given(FRAMES)
def test_no_frame_is_shorter_or_longer_than_a_frame_can_be(frame: Frame) -> None:
    carried = 0 if frame.remote else 8 * len(frame.data)
    assert 47 + carried <= bits(frame) <= 47 + carried + (34 + carried - 1) // 4


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8))
def test_extended_frames_have_twenty_bits_more(identifier: int, data: bytes) -> None:
    least = 67 + 8 * len(data)
    assert least <= bits(Frame(identifier, data, extended=True)) <= least * 5 // 4
