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
"""The simulated SDO server: the examples of CiA 301, and the driver's own client as its master."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.sdo import Download
from nfo_sinus_driver.link.sdo import Upload
from nfo_sinus_driver.simulator.sdo import Abort
from nfo_sinus_driver.simulator.sdo import AbortCode
from nfo_sinus_driver.simulator.sdo import Server

PLACE = (0x2013, 1)


class Objects:
    """Objects that are bytes, and keep their length."""

    def __init__(self) -> None:
        self.values = {PLACE: b''}
        self.size: int | None = None
        self.writes: list[bytes] = []

    def read(self, index: int, sub_index: int) -> bytes:
        if (index, sub_index) not in self.values:
            raise Abort(AbortCode.NO_OBJECT)
        return self.values[index, sub_index]

    def admit(self, index: int, sub_index: int, size: int | None) -> int:
        usual = self.size if self.size is not None else len(self.read(index, sub_index))
        if size is not None and size != usual:
            raise Abort(AbortCode.TOO_LONG if size > usual else AbortCode.TOO_SHORT)
        return usual

    def write(self, index: int, sub_index: int, data: bytes) -> None:
        self.values[index, sub_index] = data
        self.writes.append(data)


def server(value: bytes = b'') -> tuple[Server, Objects]:
    objects = Objects()
    objects.values[PLACE] = value
    return Server(objects), objects


def answers(server: Server, *requests: str) -> list[str]:
    return [server.answer(bytes.fromhex(request)).hex() for request in requests]


@pytest.mark.parametrize(
    ('value', 'requests', 'told'),
    [
        # expedited, one to four bytes
        ('11', ['4013200100000000'], ['4f13200111000000']),
        ('1122', ['4013200100000000'], ['4b13200111220000']),
        ('112233', ['4013200100000000'], ['4713200111223300']),
        ('11223344', ['4013200100000000'], ['4313200111223344']),
        # five bytes and more in segments
        (
            '1122334455',
            ['4013200100000000', '6000000000000000'],
            ['4113200105000000', '0511223344550000'],
        ),
        (
            '1122334455667788',
            ['4013200100000000', '6000000000000000', '7000000000000000'],
            ['4113200108000000', '0011223344556677', '1d88000000000000'],
        ),
        # nothing, which is a segment too
        ('', ['4013200100000000', '6000000000000000'], ['4113200100000000', '0f00000000000000']),
        # no such object
        ('', ['4014200000000000'], ['8014200000000206']),
        # the wrong toggle bit; after it there is no transfer
        (
            '1122334455',
            ['4013200100000000', '7000000000000000', '6000000000000000'],
            ['4113200105000000', '8013200100000305', '8013200101000405'],
        ),
        # a segment that nobody has begun, a block transfer, a command that there is not
        ('', ['6000000000000000'], ['8000000001000405']),
        ('', ['0000000000000000'], ['8000000001000405']),
        ('', ['a013200100000000'], ['8000000001000405']),
        ('', ['e013200100000000'], ['8000000001000405']),
        # the client ends a transfer: no answer
        (
            '1122334455',
            ['4013200100000000', '8013200100000405', '6000000000000000'],
            ['4113200105000000', '', '8013200101000405'],
        ),
        # not eight bytes: no answer
        ('11', ['40132001', ''], ['', '']),
        # expedited writes, with a size and without
        *(
            ('1122', [write, '4013200100000000'], ['6013200100000000', '4b13200133440000'])
            for write in ('2b13200133440000', '2213200133445566')
        ),
        ('1122', ['2313200133445566'], ['8013200112000706']),
        ('1122', ['2f13200133000000'], ['8013200113000706']),
        # in segments
        (
            '0000000000000000',
            ['2113200108000000', '0011223344556677', '1d88000000000000', '4013200100000000'],
            ['6013200100000000', '2000000000000000', '3000000000000000', '4113200108000000'],
        ),
        # too many bytes, too few, the wrong toggle bit
        (
            '0000000000',
            ['2113200105000000', '0011223344556677'],
            ['6013200100000000', '8013200112000706'],
        ),
        (
            '0000000000',
            ['2113200105000000', '0911223300000000'],
            ['6013200100000000', '8013200113000706'],
        ),
        (
            '0000000000',
            ['2113200105000000', '1511223344550000', '0511223344550000'],
            ['6013200100000000', '8013200100000305', '8013200101000405'],
        ),
    ],
)
def test_golden_frames(value: str, requests: list[str], told: list[str]) -> None:
    # CiA 301 §7.2.4.3, figures of the protocols
    assert answers(server(bytes.fromhex(value))[0], *requests) == told


@given(st.binary(max_size=200))
def test_the_driver_reads_any_value(value: bytes) -> None:
    upload = Upload(5, *PLACE)
    node, _ = server(value)
    while upload.request is not None:
        assert upload.take(node.answer(upload.request))
    assert upload.value == value


@given(st.binary(min_size=1, max_size=200))
def test_the_driver_writes_any_value(value: bytes) -> None:
    download = Download(5, *PLACE, value)
    node, objects = server(bytes(len(value)))
    while download.request is not None:
        assert not objects.writes, 'written before it was whole'
        assert download.take(node.answer(download.request))
    assert objects.writes == [value]


@given(st.sampled_from(AbortCode))
def test_the_driver_understands_each_refusal(code: AbortCode) -> None:
    class Refusing(Objects):
        def read(self, index: int, sub_index: int) -> bytes:
            raise Abort(code)

    upload = Upload(5, *PLACE)
    assert upload.request is not None
    answer = Server(Refusing()).answer(upload.request)
    with pytest.raises(Refused, match=f'{code:08X}h'):
        upload.take(answer)


MESSAGES = st.one_of(
    st.binary(min_size=8, max_size=8),
    st.builds(
        lambda command, rest: bytes((command,)) + b'\x13\x20\x01' + rest,
        st.integers(0, 255),
        st.binary(min_size=4, max_size=4),
    ),
)


@given(st.binary(max_size=30), st.lists(MESSAGES, max_size=20))
def test_whatever_comes_it_answers_and_begins_anew(value: bytes, messages: list[bytes]) -> None:
    node, objects = server(value)
    objects.size = len(value)
    for message in messages:
        answer = node.answer(message)
        assert len(answer) == (0 if message[0] >> 5 == 4 else 8)
    # whatever was written has the length of the object
    assert {len(one) for one in objects.writes} <= {len(value)}
    upload = Upload(5, *PLACE)
    while upload.request is not None:
        assert upload.take(node.answer(upload.request))
    assert upload.value == objects.values[PLACE]
