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

"""Who a unit is: the same frames as pymodbus's, and a drive that does not tell costs little."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from typing import Any

from hypothesis import assume
from hypothesis import example
from hypothesis import given
from hypothesis import strategies as st
import pymodbus_opinion as opinion
import pytest
from support.addresses import packed
from support.addresses import register
from support.addresses import words_of
from virtual_wire import Wire

from nfo_sinus_driver.link.errors import DamagedAnswer
from nfo_sinus_driver.link.errors import LinkError
from nfo_sinus_driver.link.errors import NoAnswer
from nfo_sinus_driver.link.errors import NotReady
from nfo_sinus_driver.link.errors import Refused
from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import Identification
from nfo_sinus_driver.link.modbus_identify import BASIC
from nfo_sinus_driver.link.modbus_identify import REGULAR
from nfo_sinus_driver.link.modbus_identify import SPECIFIC
from nfo_sinus_driver.link.modbus_identify import DeviceObjects
from nfo_sinus_driver.link.modbus_identify import ModbusInquiry
from nfo_sinus_driver.link.modbus_identify import ReadDevice
from nfo_sinus_driver.link.modbus_identify import ReportSlaveId
from nfo_sinus_driver.link.modbus_identify import revision
from nfo_sinus_driver.link.modbus_identify import serial_number
from nfo_sinus_driver.link.modbus_identify import text
from nfo_sinus_driver.link.modbus_pdu import Request
from nfo_sinus_driver.link.modbus_pdu import WriteAndRead
from nfo_sinus_driver.link.rtu import CRC_LENGTH
from nfo_sinus_driver.link.rtu import RtuReader
from nfo_sinus_driver.link.rtu import encode
from nfo_sinus_driver.link.rtu_link import RtuLink
from nfo_sinus_driver.link.settings import LineSettings

if opinion.OLD:
    from pymodbus import mei_message
    from pymodbus import other_message

    SlaveRequest = other_message.ReportSlaveIdRequest
    SlaveResponse = other_message.ReportSlaveIdResponse
else:
    from pymodbus.pdu import mei_message
    from pymodbus.pdu import other_message

    SlaveRequest = other_message.ReportDeviceIdRequest
    SlaveResponse = other_message.ReportDeviceIdResponse

SERIAL = b'0123456789ABCDEF'
#: What M0 §6.2.4 prints.
G2 = {
    0: b'NFO Drives AB',
    1: b'',
    2: b' 4.30 / 4018     ',
    3: b'http://www.nfo.se',
    4: b'NFO Sinus',
    5: b'1.50/400',
    6: b'',
}
KNOWN = Identification(
    vendor='NFO Drives AB',
    revision='4.30 / 4018',
    url='http://www.nfo.se',
    product='NFO Sinus',
    model='1.50/400',
    serial='0123456789ABCDEF',
)

# --- pymodbus's opinion ---------------------------------------------------------------------------


def device_request(unit: int, code: int, first: int) -> bytes:
    request = mei_message.ReadDeviceInformationRequest()
    return opinion._frame(unit, request, read_code=code, object_id=first)


def device_answer(unit: int, code: int, objects: dict[int, bytes]) -> bytes:
    """The frame with the objects; with as many of them as fit, and the rest follows."""
    answer = mei_message.ReadDeviceInformationResponse()
    return opinion._frame(unit, answer, read_code=code, information=objects)


def slave_request(unit: int) -> bytes:
    return opinion._frame(unit, SlaveRequest())


def slave_answer(unit: int, identifier: bytes, running: bool) -> bytes:
    """The frame with an id and the run indicator of the standard."""
    return opinion._frame(unit, SlaveResponse(), identifier=identifier, status=running)


def g2_answer(unit: int, report: bytes = SERIAL) -> bytes:
    """The frame as M0 §6.2.4 has it: nothing but the characters, which pymodbus cannot."""
    frame = bytes((unit, 17, len(report))) + report
    return frame + opinion.crc(frame)


def write_and_read_request(request: WriteAndRead) -> bytes:
    return opinion._frame(
        request.unit,
        opinion.read_message.ReadWriteMultipleRegistersRequest(),
        read_address=request.source,
        read_count=request.count,
        write_address=request.register,
        write_count=len(request.data) // 2,
        write_byte_count=len(request.data),
        write_registers=list(words_of(request.data)),
    )


def write_and_read_answer(unit: int, words: tuple[int, ...]) -> bytes:
    answer = opinion.read_message.ReadWriteMultipleRegistersResponse()
    return opinion._frame(unit, answer, registers=list(words))


# --- what may be asked and answered ---------------------------------------------------------------

UNIT = st.integers(1, 247)
WORD = st.integers(0, 0xFFFF)
REGISTER = st.integers(0, 0xFF00)
CODES = st.sampled_from([BASIC, REGULAR, SPECIFIC])
DEVICES = st.builds(ReadDevice, UNIT, CODES, st.integers(0, 255))
SLAVES = st.builds(ReportSlaveId, UNIT)
WRITES_AND_READS = st.builds(
    WriteAndRead,
    UNIT,
    REGISTER,
    st.lists(WORD, min_size=1, max_size=121).map(lambda words: packed(*words)),
    REGISTER,
    st.integers(1, 125),
)
REQUESTS = st.one_of(DEVICES, SLAVES, WRITES_AND_READS)
# requests whose answers resemble each other
FEW = st.sampled_from([1, 2])
CLOSE = st.one_of(
    st.builds(ReadDevice, FEW, CODES, st.sampled_from([0, 5])),
    st.builds(ReportSlaveId, FEW),
    st.builds(
        WriteAndRead, FEW, st.just(0x294), st.just(packed(3)), st.just(0x2A5), st.integers(1, 2)
    ),
)
CONTENT = st.binary(max_size=20)


@st.composite
def answers(draw: st.DrawFn, request: Request[Any]) -> tuple[bytes, object]:
    """A right answer to a request, and what the reader has to make of it."""
    unit = request.unit
    if isinstance(request, WriteAndRead):
        words = draw(st.lists(WORD, min_size=request.count, max_size=request.count).map(tuple))
        return write_and_read_answer(unit, words), packed(*words)
    if isinstance(request, ReportSlaveId):
        if draw(st.booleans()):
            report = draw(st.binary(max_size=251))
            return g2_answer(unit, report), report
        identifier, running = draw(st.binary(max_size=250)), draw(st.booleans())
        report = identifier + (b'\xff' if running else b'\x00')
        return slave_answer(unit, identifier, running), report
    assert isinstance(request, ReadDevice)
    if request.code == SPECIFIC:
        objects = {request.first: draw(st.binary(max_size=244))}
    else:
        # in their order, and so few that all fit
        numbers = draw(st.lists(st.integers(0, 255), unique=True, max_size=8).map(sorted))
        objects = {number: draw(CONTENT) for number in numbers}
    return device_answer(unit, request.code, objects), DeviceObjects(tuple(objects.items()))


@st.composite
def pieces(draw: st.DrawFn, data: bytes) -> list[bytes]:
    """The same bytes in any pieces."""
    cuts = sorted(draw(st.lists(st.integers(0, len(data)), max_size=4)))
    return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]


def outcome(reader: RtuReader[Any], data: list[bytes]) -> object:
    """What comes of bytes: an answer, a refusal, or nothing; anything else raises."""
    for piece in data:
        try:
            answer = reader.feed(piece)
        except Refused as refusal:
            return f'refused {refusal.code}'
        if answer is not None:
            return answer
    return None


def spoil(frame: bytes, bit: int) -> bytes:
    """The frame with one bit wrong."""
    damaged = bytearray(frame)
    damaged[bit // 8 % len(frame)] ^= 1 << bit % 8
    return bytes(damaged)


# --- agreement with pymodbus ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ('request_', 'frame'),
    [
        (ReadDevice(1, BASIC), '01 2B 0E 01 00 70 77'),
        (ReadDevice(1), '01 2B 0E 02 00 70 87'),
        (ReportSlaveId(1), '01 11 C0 2C'),
        # the standard's example of function 23
        (
            WriteAndRead(17, 14, packed(255, 255, 255), 3, 6),
            '11 17 0003 0006 000E 0003 06 00FF 00FF 00FF',
        ),
    ],
)
def test_golden_requests(request_: Request[Any], frame: str) -> None:
    whole = bytes.fromhex(frame)
    if isinstance(request_, WriteAndRead):
        whole += opinion.crc(whole)
    assert encode(request_) == whole


@given(REQUESTS)
def test_request_is_pymodbus_s(request: Request[Any]) -> None:
    frame = encode(request)
    decoded = opinion._decoded(frame)
    assert (decoded.slave_id if opinion.OLD else decoded.dev_id) == request.unit
    assert decoded.function_code == request.function
    if isinstance(request, ReadDevice):
        assert frame == device_request(request.unit, request.code, request.first)
        assert (decoded.read_code, decoded.object_id) == (request.code, request.first)
    elif isinstance(request, ReportSlaveId):
        assert frame == slave_request(request.unit)
    else:
        assert isinstance(request, WriteAndRead)
        assert frame == write_and_read_request(request)
        assert (decoded.read_address, decoded.read_count) == (request.source, request.count)
        assert decoded.write_address == request.register
        assert decoded.write_count == len(request.data) // 2
        assert packed(*decoded.write_registers) == request.data


@given(st.data(), REQUESTS)
def test_answer_of_pymodbus_in_any_pieces(data: st.DataObject, request: Request[Any]) -> None:
    frame, wanted = data.draw(answers(request))
    assert len(frame) - CRC_LENGTH <= request.answer_length <= 254
    assert frame.startswith(request.answer_head)
    reader = RtuReader(request)
    assert outcome(reader, data.draw(pieces(frame))) == wanted
    assert reader.received == 0


@given(st.data(), REQUESTS)
def test_never_more_is_waited_for_than_comes(data: st.DataObject, request: Request[Any]) -> None:
    frame, _ = data.draw(answers(request))
    reader = RtuReader(request)
    come = data.draw(st.integers(0, len(frame) - 1))
    assert reader.feed(frame[:come]) is None
    assert 1 <= reader.missing <= max(1, len(frame) - come)
    if isinstance(request, ReportSlaveId) and come > 2:
        # as soon as the answer says how long it is, that is known
        assert reader.missing == len(frame) - come


@given(st.data(), REQUESTS, st.integers(0, 255))
def test_refusal_of_pymodbus_in_any_pieces(
    data: st.DataObject, request: Request[Any], code: int
) -> None:
    frame = opinion.exception(request.unit, request.function, code)
    reader = RtuReader(request)
    assert outcome(reader, data.draw(pieces(frame))) == f'refused {code}'
    assert reader.received == 0


@given(st.lists(st.binary(min_size=60, max_size=200), min_size=5, max_size=7))
def test_what_pymodbus_puts_into_several_answers(contents: list[bytes]) -> None:
    objects = dict(enumerate(contents))
    first = 0
    got: dict[int, bytes] = {}
    while True:
        # pymodbus's server goes on with the objects from the one asked for
        rest = {number: content for number, content in objects.items() if number >= first}
        answer = RtuReader(ReadDevice(1, REGULAR, first)).feed(device_answer(1, REGULAR, rest))
        assert isinstance(answer, DeviceObjects)
        got.update(answer.objects)
        if answer.next_object is None:
            break
        assert answer.next_object > first
        first = answer.next_object
    assert got == objects


# --- what else comes over a line ------------------------------------------------------------------


def contents(frame: bytes) -> list[tuple[int, bytes]] | None:
    """The objects in a frame of function 43/14, if they fill it exactly."""
    objects, rest = [], frame[8:-2]
    for _ in range(frame[7]):
        if len(rest) < 2 or len(rest) < 2 + rest[1]:
            return None
        objects.append((rest[0], rest[2 : 2 + rest[1]]))
        rest = rest[2 + rest[1] :]
    return None if rest else objects


def meaning(request: Request[Any], frame: bytes) -> object:
    """What these bytes say if they are exactly one answer or refusal, by pymodbus's check sum."""
    if not 5 <= len(frame) <= 256 or opinion.crc(frame[:-2]) != frame[-2:]:
        return None
    unit, function = frame[:2]
    if unit != request.unit or function & 0x7F != request.function:
        return None
    if function & 0x80:
        return f'refused {frame[2]}' if len(frame) == 5 else None
    if isinstance(request, ReadDevice):
        if len(frame) < 10 or frame[2:4] != bytes((14, request.code)) or frame[5] not in (0, 255):
            return None
        objects = contents(frame)
        if objects is None:
            return None
        if request.code == SPECIFIC and [number for number, _ in objects] != [request.first]:
            return None
        return DeviceObjects(tuple(objects), frame[6] if frame[5] else None)
    if frame[2] != len(frame) - 5:
        return None
    if isinstance(request, ReportSlaveId):
        return frame[3:-2]
    assert isinstance(request, WriteAndRead)
    body = frame[3:-2]
    return body if len(body) == 2 * request.count else None


def everything(request: Request[Any], stream: bytes) -> list[object]:
    """What may come of the frames in the bytes, or nothing if there is none."""
    found = [
        said
        for start in range(len(stream))
        for end in range(start + 5, min(len(stream), start + 256) + 1)
        if stream[start] == request.unit
        and (said := meaning(request, stream[start:end])) is not None
    ]
    return found or [None]


@given(st.data(), CLOSE, st.integers(0, 8 * 256))
def test_damaged_answer_is_none(data: st.DataObject, request: Request[Any], bit: int) -> None:
    frame, _ = data.draw(answers(request))
    damaged = spoil(frame, bit)
    assume(everything(request, damaged) == [None])
    reader = RtuReader(request)
    assert outcome(reader, data.draw(pieces(damaged))) is None
    assert reader.received == len(damaged)


@given(st.data(), CLOSE, st.binary(max_size=20))
def test_noise_before_a_good_answer(
    data: st.DataObject, request: Request[Any], noise: bytes
) -> None:
    frame, wanted = data.draw(answers(request))
    assume(everything(request, noise + frame) == [wanted])
    assert outcome(RtuReader(request), data.draw(pieces(noise + frame))) == wanted


@st.composite
def traffic(draw: st.DrawFn, request: Request[Any]) -> bytes:
    """Noise, answers whole, cut and damaged, to this request and to others, in any order."""
    stream = b''
    for _ in range(draw(st.integers(0, 4))):
        other = draw(st.one_of(st.just(request), CLOSE))
        part = draw(answers(other))[0]
        what = draw(st.sampled_from(['whole', 'cut', 'spoilt', 'noise', 'head', 'no', 'question']))
        if what == 'cut':
            part = part[draw(st.integers(0, len(part))) :][: draw(st.integers(0, len(part)))]
        elif what == 'spoilt':
            part = spoil(part, draw(st.integers(0, 8 * len(part))))
        elif what == 'noise':
            part = draw(st.binary(max_size=12))
        elif what == 'head':
            part = request.answer_head
        elif what == 'no':
            part = opinion.exception(other.unit, other.function, draw(st.integers(0, 255)))
        elif what == 'question':
            part = encode(other)
        stream += part
    return stream


@given(st.data(), CLOSE)
def test_nothing_is_believed_but_a_whole_frame(
    data: st.DataObject, request: Request[Any]
) -> None:
    stream = data.draw(traffic(request))
    reader = RtuReader(request)
    fed = b''
    for piece in data.draw(pieces(stream)):
        fed += piece
        got = outcome(reader, [piece])
        # as soon as a frame is whole it is found, and nothing else ever is
        assert got in everything(request, fed)
        if got is not None:
            break
        assert reader.missing >= 1


@given(st.data(), CLOSE, st.binary(max_size=300))
@example(None, ReadDevice(1), bytes((1, 43, 14, 2, 0x82, 0, 0, 255)) + b'\xff' * 300)
def test_any_bytes_at_all(
    data: st.DataObject | None, request: Request[Any], stream: bytes
) -> None:
    reader = RtuReader(request)
    got = outcome(reader, data.draw(pieces(stream)) if data else [stream])
    assert got in everything(request, stream)
    assert reader.missing >= 1


@pytest.mark.parametrize('more', [1, 0x7F, 0xFE])
def test_more_follows_is_yes_or_no(more: int) -> None:
    body = bytes((1, 43, 14, 2, 0x82, more, 0, 1, 0, 1)) + b'A'
    assert RtuReader(ReadDevice(1)).feed(body + opinion.crc(body)) is None


def test_another_object_is_no_answer_to_one_by_its_number() -> None:
    reader = RtuReader(ReadDevice(1, SPECIFIC, 5))
    assert reader.feed(device_answer(1, SPECIFIC, {4: b'NFO Sinus'})) is None
    assert reader.feed(device_answer(1, SPECIFIC, {4: b'NFO Sinus', 5: b'1.50/400'})) is None
    assert reader.feed(device_answer(1, SPECIFIC, {5: b'1.50/400'})) == DeviceObjects(
        ((5, b'1.50/400'),)
    )


# --- what the bytes say ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('data', 'clean'),
    [
        (b'NFO Drives AB', 'NFO Drives AB'),
        (b'  1.50/400 ', '1.50/400'),
        (b'', ''),
        (b'\x00\xff\n', ''),
        (b'Sinus\x00\x00', 'Sinus'),
        # nobody writes a second line into our log, or colours it
        (b'a\nERROR \x1b[31mb', 'a ERROR [31mb'),
    ],
)
def test_text(data: bytes, clean: str) -> None:
    assert text(data) == clean


@given(st.binary(max_size=255))
def test_any_text_is_printable(data: bytes) -> None:
    for said in (text(data), revision(data), serial_number(data)):
        assert said.isascii() and said.isprintable()
        assert said == said.strip()


@pytest.mark.parametrize(
    ('data', 'clean'),
    [
        (b' 4.30 / 4018 ', '4.30 / 4018'),
        (b' 4.30   /   4018 ', '4.30 / 4018'),
        (b'4.30/4018', '4.30 / 4018'),
        (b'4.30', '4.30'),
        (b'/', ''),
        (b'', ''),
    ],
)
def test_revision(data: bytes, clean: str) -> None:
    assert revision(data) == clean


@pytest.mark.parametrize(
    ('report', 'serial'),
    [
        (SERIAL, '0123456789ABCDEF'),
        (b'ABC123          ', 'ABC123'),
        (b'ABC123\x00\x00\x00', 'ABC123'),
        # with the standard's run indicator behind it, before it, and an id before that
        (SERIAL + b'\xff', '0123456789ABCDEF'),
        (SERIAL + b'\x00', '0123456789ABCDEF'),
        (b'\xff' + SERIAL, '0123456789ABCDEF'),
        (b'\x11\xff' + SERIAL, '0123456789ABCDEF'),
        (b'B\x00' + SERIAL, '0123456789ABCDEF'),
        (b'\x11\xff', ''),
        (b' ' * 16, ''),
        (b'', ''),
    ],
)
def test_serial_number(report: bytes, serial: str) -> None:
    assert serial_number(report) == serial


# --- the questions --------------------------------------------------------------------------------


class Script:
    """Answers questions as a unit would, without a line."""

    def __init__(self, *replies: object) -> None:
        self._replies = list(replies)
        self.asked: list[Request[Any]] = []

    def __call__(self, request: Request[object]) -> tuple[object, float]:
        self.asked.append(request)
        reply = self._replies.pop(0)
        if isinstance(reply, Exception):
            raise reply
        return reply, float(len(self.asked))


def asked_all(inquiry: ModbusInquiry) -> Identification:
    while not inquiry.done:
        with contextlib.suppress(Refused, NoAnswer, DamagedAnswer):
            inquiry.ask()
    return inquiry.found


def test_two_questions_tell_all() -> None:
    script = Script(DeviceObjects(tuple(G2.items())), SERIAL)
    assert asked_all(ModbusInquiry(1, script)) == KNOWN
    assert script.asked == [ReadDevice(1, REGULAR, 0), ReportSlaveId(1)]


def test_reply_says_when_its_last_byte_came() -> None:
    inquiry = ModbusInquiry(1, Script(DeviceObjects(()), b''))
    assert [inquiry.ask().arrived, inquiry.ask().arrived] == [1.0, 2.0]
    assert inquiry.done


def test_reading_goes_on_where_more_follows() -> None:
    script = Script(
        DeviceObjects(((0, b'NFO'), (1, b'')), 2),
        DeviceObjects(((2, b'4.30/4018'),), 4),
        DeviceObjects(((4, b'NFO Sinus'), (5, b'1.50/400'))),
        SERIAL,
    )
    found = asked_all(ModbusInquiry(1, script))
    assert (found.vendor, found.revision, found.model) == ('NFO', '4.30 / 4018', '1.50/400')
    assert script.asked[1:3] == [ReadDevice(1, REGULAR, 2), ReadDevice(1, REGULAR, 4)]


@pytest.mark.parametrize('following', [0, 1, 2, 7, 0x80, 255])
def test_only_what_is_ahead_and_known_is_read_on(following: int) -> None:
    script = Script(DeviceObjects((), 2), DeviceObjects((), following), b'')
    asked_all(ModbusInquiry(1, script))
    assert [type(question) for question in script.asked] == [ReadDevice, ReadDevice, ReportSlaveId]


def test_objects_that_nobody_knows_are_passed_over() -> None:
    script = Script(DeviceObjects(((0, b'NFO'), (7, b'x'), (0x80, b'y'))), b'')
    assert asked_all(ModbusInquiry(1, script)) == Identification(vendor='NFO')


@pytest.mark.parametrize('error', [Refused(1), Refused(2), Refused(3), NoAnswer(), DamagedAnswer()])
def test_a_question_without_answer_is_not_asked_again(error: LinkError) -> None:
    script = Script(error, SERIAL)
    assert asked_all(ModbusInquiry(1, script)) == Identification(serial='0123456789ABCDEF')
    script = Script(DeviceObjects(((0, b'NFO'),)), error)
    assert asked_all(ModbusInquiry(1, script)) == Identification(vendor='NFO')
    script = Script(DeviceObjects(((0, b'NFO'),), 1), error, error)
    assert asked_all(ModbusInquiry(1, script)) == Identification(vendor='NFO')
    script = Script(error, error)
    assert asked_all(ModbusInquiry(1, script)) == Identification()


def test_a_question_that_could_not_be_sent_is_asked_later() -> None:
    script = Script(NotReady(1.0), DeviceObjects(((0, b'NFO'),)), NotReady(2.0), SERIAL)
    inquiry = ModbusInquiry(1, script)
    for _ in range(2):
        with pytest.raises(NotReady):
            inquiry.ask()
        assert not inquiry.done
        inquiry.ask()
    assert inquiry.done
    assert inquiry.found == Identification(vendor='NFO', serial='0123456789ABCDEF')


# --- on a line in virtual time --------------------------------------------------------------------

TIMEOUT = 0.1
SETTINGS = LineSettings(baud_rate=19200, response_timeout=TIMEOUT)
ONE = register(0x2A5)
TWO = register(0x258, 2)


class Unit:
    """
    A link on a virtual line, and a unit that answers each function as it is told, in order.

    :ivar late: by how much the answer to a function is late, in time-outs.
    """

    def __init__(self, settings: LineSettings = SETTINGS) -> None:
        self.wire = Wire(settings)
        self.wire.far_end = self._take
        self.link = RtuLink(self.wire, settings)
        self.link.use_probes(1, (ONE, TWO))
        self.answers: dict[int, Callable[[bytes], bytes]] = {
            3: lambda frame: opinion.read_answer(1, [len(self.functions)] * frame[5]),
            17: lambda frame: g2_answer(1),
            6: lambda frame: frame,
            23: lambda frame: write_and_read_answer(1, (len(self.functions),) * frame[5]),
            43: lambda frame: device_answer(1, frame[3], G2),
        }
        self.late: dict[int, float] = {}
        self.functions: list[int] = []
        self._free = 0.0
        with self.wire.time():
            self.link.open()

    def _take(self, frame: bytes, end: float) -> None:
        self.functions.append(frame[1])
        answer = self.answers[frame[1]](frame)
        start = max(self._free, end + self.late.get(frame[1], 0) * TIMEOUT)
        self._free = self.wire.arrive(start, answer)

    def identify(self) -> Identification:
        with self.wire.time():
            return asked_all(self.link.identify(1))

    def read(self, address: Address = ONE) -> bytes:
        with self.wire.time():
            return self.link.read(1, address).data


def silent(frame: bytes) -> bytes:
    return b''


def refuses(frame: bytes) -> bytes:
    return opinion.exception(1, frame[1], 1)


@pytest.mark.parametrize('baud', [1200, 19200, 57600])
def test_a_g2_tells_who_it_is(baud: int) -> None:
    unit = Unit(LineSettings(baud_rate=baud, response_timeout=TIMEOUT))
    assert unit.identify() == KNOWN
    assert unit.functions == [43, 17]
    unit.wire.check_gaps()
    assert unit.read() == packed(3), 'and there is no doubt'


def test_nothing_is_sent_before_the_first_question() -> None:
    unit = Unit()
    inquiry = unit.link.identify(1)
    assert not inquiry.done
    assert unit.functions == []


def test_refusals_cost_no_time_out() -> None:
    unit = Unit()
    unit.answers.update({17: refuses, 43: refuses})
    before = unit.wire.now
    assert unit.identify() == Identification()
    assert unit.functions == [43, 17]
    assert unit.wire.now - before < TIMEOUT / 2
    assert unit.read() == packed(3)


def test_silence_costs_one_time_out_each() -> None:
    unit = Unit()
    unit.answers.update({17: silent, 43: silent})
    before = unit.wire.now
    assert unit.identify() == Identification()
    assert unit.functions == [43, 17]
    assert 2 * TIMEOUT < unit.wire.now - before < 2.5 * TIMEOUT
    assert unit.read() == packed(3)
    assert unit.identify() == Identification()
    assert unit.functions == [43, 17, 3, 43, 17], 'the doubt was over'
    unit.wire.check_gaps()


@pytest.mark.parametrize('function', [43, 17])
def test_late_answer_is_not_taken_for_another(function: int) -> None:
    unit = Unit()
    unit.late[function] = 1.2
    found = unit.identify()
    assert found.vendor == ('' if function == 43 else KNOWN.vendor)
    assert found.serial == ('' if function == 17 else KNOWN.serial)
    assert unit.read() == packed(len(unit.functions))
    assert unit.functions == [43, 17, 3]


def test_a_late_refusal_is_not_taken_for_another_one() -> None:
    unit = Unit()
    unit.answers[43] = refuses
    unit.late[43] = 1.2
    assert unit.identify() == Identification(serial=KNOWN.serial)
    assert unit.read() == packed(len(unit.functions))


@pytest.mark.parametrize('function', [43, 17])
def test_damaged_answer_leaves_it_empty(function: int) -> None:
    unit = Unit()
    good = unit.answers[function]
    unit.answers[function] = lambda frame: spoil(good(frame), 90)
    found = unit.identify()
    assert (found.vendor == '', found.serial == '') == (function == 43, function == 17)
    assert unit.read() == packed(len(unit.functions))


@pytest.mark.parametrize('cut', [2, 5, 8, 9, 30, 80])
def test_answer_that_stops_in_the_middle(cut: int) -> None:
    unit = Unit()
    unit.answers[43] = lambda frame: device_answer(1, REGULAR, G2)[:cut]
    before = unit.wire.now
    assert unit.identify() == Identification(serial=KNOWN.serial)
    assert unit.wire.now - before < 3 * TIMEOUT


def test_answer_in_lumps_of_an_adapter() -> None:
    unit = Unit()
    whole = device_answer(1, REGULAR, G2)

    def far_end(frame: bytes, end: float) -> None:
        if frame[1] != 43:
            unit.wire.arrive(end, g2_answer(1))
            return
        for number, at in enumerate(range(0, len(whole), 31), start=1):
            unit.wire.arrive(end + 0.025 * number, whole[at : at + 31], lump=True)

    unit.wire.far_end = far_end
    assert unit.identify() == KNOWN


def test_doubled_answer_is_noticed() -> None:
    unit = Unit()
    unit.answers[43] = lambda frame: 2 * device_answer(1, REGULAR, G2)
    assert unit.identify() == KNOWN
    assert unit.read() == packed(len(unit.functions))


def test_a_unit_whose_reads_are_in_doubt_can_say_who_it_is() -> None:
    unit = Unit()
    unit.answers[3] = silent
    for address in (ONE, TWO):
        with pytest.raises(NoAnswer):
            unit.read(address)
    assert unit.identify() == KNOWN
    assert unit.functions == [3, 3, 43, 17]


# --- write and read in one ------------------------------------------------------------------------


def test_write_and_read() -> None:
    unit = Unit()
    with unit.wire.time():
        reply = unit.link.write_and_read(1, TWO, packed(1, 2), ONE)
    assert reply.data == packed(1)
    assert reply.arrived == unit.wire.now
    request = WriteAndRead(1, 0x258, packed(1, 2), 0x2A5, 1)
    assert unit.wire.sent[-1][1] == write_and_read_request(request)


def test_write_and_read_is_doubted_as_a_read_is() -> None:
    unit = Unit()
    unit.late[23] = 1.5
    with unit.wire.time(), pytest.raises(NoAnswer) as error:
        unit.link.write_and_read(1, ONE, packed(7), ONE)
    assert error.value.maybe_done
    unit.late.clear()
    with unit.wire.time():
        # what is written is never held back: it goes alone, for its answer names it
        assert unit.link.write_and_read(1, ONE, packed(7), ONE).data == b''
    assert unit.functions == [23, 6]


def test_write_and_read_refused() -> None:
    unit = Unit()
    unit.answers[23] = refuses
    with unit.wire.time(), pytest.raises(Refused) as refusal:
        unit.link.write_and_read(1, ONE, packed(7), ONE)
    assert refusal.value.code == Refused.ILLEGAL_FUNCTION
