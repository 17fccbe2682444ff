# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What carries CAN frames: their length, the LAWICEL adapter, an interface of the kernel, SDO."""

from pathlib import Path
import socket
import struct
import threading

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.link.canopen.link import CanopenLink
from nfo_sinus_driver.link.canopen.sdo import Upload
from nfo_sinus_driver.link.interface import Address, LineSettings
from nfo_sinus_driver.simulator.can_frames import Frame, bits
from nfo_sinus_driver.simulator.lawicel import Adapter
from nfo_sinus_driver.simulator.sdo import Abort, AbortCode, Server

# ---- frames (ISO 11898-1) ----


def checked(frame):
    """Return the bits of a standard frame up to its check sum, by long division."""
    head = f'0{frame.identifier:011b}{int(frame.remote)}00{len(frame.data):04b}'
    head += '' if frame.remote else ''.join(f'{byte:08b}' for byte in frame.data)
    rest = int(head + 15 * '0', 2)
    # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1
    for place in reversed(range(15, len(head) + 15)):
        if rest >> place & 1:
            rest ^= 0xC599 << place - 15
    return f'{head}{rest:015b}'


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8), st.booleans())
def test_a_frame_has_the_bits_that_stuffing_by_another_way_gives(identifier, data, remote):
    frame = Frame(identifier & 0x7FF, data, remote, False)
    stuffed = ''
    for bit in checked(frame):
        stuffed += bit
        if stuffed[-5:] in ('00000', '11111'):
            stuffed += '1' if bit == '0' else '0'
    carried = 0 if remote else 8 * len(data)
    assert bits(frame) == len(stuffed) + 13
    assert 47 + carried <= bits(frame) <= 47 + carried + (34 + carried - 1) // 4
    least = 67 + 8 * len(data)
    assert least <= bits(Frame(identifier, data, extended=True)) <= least * 5 // 4


# ---- the LAWICEL adapter ----

OK, NO = b'\r', b'\a'


def said(adapter, line, *, sent=True):
    """Return what an adapter answers to a line."""
    answer = b''
    for what in adapter.take_bytes(line + b'\r'):
        answer += adapter.tried(what, sent=sent) if isinstance(what, Frame) else what
    return answer


def opened(*lines):
    """Return an adapter that is on the bus."""
    adapter = Adapter()
    for line in (b'S4', *lines, b'O'):
        assert said(adapter, line) == OK
    return adapter


def test_every_command_of_its_manual():
    for line, closed, open_ in (
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
    ):
        adapter = Adapter()
        assert said(adapter, b'S4') == OK
        assert (said(adapter, line), said(opened(), line)) == (closed, open_), line


def test_it_opens_with_a_bit_rate_alone_and_sends_nothing_while_it_listens():
    adapter = Adapter()
    assert said(adapter, b'O') == NO
    assert said(adapter, b'S5') + said(adapter, b'O') == OK + OK
    assert adapter.on_bus(250_000) and not adapter.on_bus(125_000)
    assert said(adapter, b'C') == OK
    assert not adapter.on_bus(250_000)
    assert said(adapter, b'S4') + said(adapter, b'L') == OK + OK
    assert adapter.on_bus(125_000)
    assert said(adapter, b't1000') == NO


def test_frames_that_are_not_acknowledged_fill_its_queue():
    adapter = opened()
    assert [said(adapter, b't1000', sent=False) for _ in range(10)] == 8 * [b'z\r'] + 2 * [NO]
    assert [said(adapter, b'F') for _ in range(2)] == [b'FA6\r', b'F00\r']
    assert said(adapter, b't1000') == b'z\r'
    assert said(adapter, b't1000', sent=False) == b'z\r', 'the queue is empty again'


def test_frames_as_lines():
    data = bytes.fromhex('1133')
    for frame, line in (
        (Frame(0x100, data), b't10021133\r'),
        (Frame(0x7FF), b't7FF0\r'),
        (Frame(0x701, bytes(1), remote=True), b'r7011\r'),
        (Frame(0x100, data, extended=True), b'T0000010021133\r'),
        (Frame(0x100, bytes(2), remote=True, extended=True), b'R000001002\r'),
    ):
        adapter = opened()
        assert adapter.text_of(frame, 0.0) == line
        assert opened(b'Z1').text_of(frame, 61.5) == line[:-1] + b'05DC\r'
        assert list(adapter.take_bytes(line)) == [frame]


def test_acceptance_filters():
    # the first filter lets 581 through, the second 701, and nothing counts of the data
    adapter = opened(b'MB020E020', b'm001F001F')
    heard = [n for n in range(0x800) if adapter.text_of(Frame(n, b'\x12'), 0.0)]
    assert heard == [0x581, 0x701]
    # data counts: filter 1 wants 581 with a first byte of 43h
    adapter = opened(b'MB0240003', b'm0010FF10')
    assert adapter.text_of(Frame(0x581, b'\x43\x00'), 0.0)
    assert not adapter.text_of(Frame(0x581, b'\x80\x00'), 0.0)


@given(st.data())
def test_lines_in_any_pieces(data):
    pairs = st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8))
    frames = [Frame(*pair) for pair in data.draw(st.lists(pairs, max_size=5))]
    stream = b''.join(
        f't{frame.identifier:03x}{len(frame.data)}{frame.data.hex()}\r'.encode() for frame in frames
    )
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    adapter = opened()
    pieces = [stream[a:b] for a, b in zip([0, *cuts], [*cuts, len(stream)], strict=True)]
    assert [what for piece in pieces for what in adapter.take_bytes(piece)] == frames


@given(st.lists(st.binary(max_size=60), max_size=10))
def test_rubbish_is_refused_and_does_no_harm(pieces):
    adapter = opened()
    for piece in pieces:
        for what in adapter.take_bytes(piece):
            assert isinstance(what, Frame) or len(what) <= 8
    list(adapter.take_bytes(b'\rC\rS4\rO\r'))
    assert adapter.on_bus(125_000)


# ---- a CAN interface of the kernel: a socket made of paper, and a real vcan ----

READ_VENDOR = bytes.fromhex('4018100100000000')
VENDOR = bytes.fromhex('431810011b000000')


def test_a_virtual_interface_of_the_kernel():
    for name in sorted(path.name for path in Path('/sys/class/net').glob('vcan*')):
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as far:
            try:
                far.bind((name,))
            except OSError:
                continue
            node = threading.Thread(target=_answer_once, args=(far,))
            node.start()
            link = CanopenLink.on_port(name, LineSettings(baud_rate=125_000, response_timeout=5.0))
            link.open()
            assert link.read(1, Address('object', 0x1018, 1, 4)).data == VENDOR[4:]
            link.close()
            node.join()
        return
    pytest.skip('this kernel has no vcan interface: ip link add vcan0 type vcan, and set it up')


def _answer_once(far):
    """Answer the first request of an SDO client to node 1, as the kernel packs frames."""
    while True:
        if struct.unpack_from('=I', far.recv(16))[0] == 0x601:
            far.send(struct.pack('=IB3x8s', 0x581, 8, VENDOR))
            return


# ---- the SDO server ----

PLACE = (0x2013, 1)


class Objects:
    """One object that is bytes and keeps its length."""

    def __init__(self, value=b'', refusal=AbortCode.NO_OBJECT):
        self.value, self.refusal, self.writes = value, refusal, []

    def read(self, index, sub_index):
        if (index, sub_index) != PLACE:
            raise Abort(self.refusal)
        return self.value

    def validate(self, index, sub_index, size):
        usual = len(self.read(index, sub_index))
        if size not in (None, usual):
            raise Abort(AbortCode.TOO_LONG if size > usual else AbortCode.TOO_SHORT)
        return usual

    def write(self, index, sub_index, data):
        self.value = data
        self.writes.append(data)


#: CiA 301 §7.2.4.3, figures of the protocols: the object, what is asked, and what is answered.
GOLDEN = (
    # expedited, one to four bytes
    ('11', '4013200100000000', '4f13200111000000'),
    ('1122', '4013200100000000', '4b13200111220000'),
    ('112233', '4013200100000000', '4713200111223300'),
    ('11223344', '4013200100000000', '4313200111223344'),
    # five bytes and more in segments
    ('1122334455', '4013200100000000 6000000000000000', '4113200105000000 0511223344550000'),
    (
        '1122334455667788', '4013200100000000 6000000000000000 7000000000000000',
        '4113200108000000 0011223344556677 1d88000000000000',
    ),
    # nothing, which is a segment too
    ('', '4013200100000000 6000000000000000', '4113200100000000 0f00000000000000'),
    # no such object
    ('', '4014200000000000', '8014200000000206'),
    # the wrong toggle bit; after it there is no transfer
    (
        '1122334455', '4013200100000000 7000000000000000 6000000000000000',
        '4113200105000000 8013200100000305 8013200101000405',
    ),
    # a segment of no transfer, a block transfer, a command that there is not
    *(('', f'{code}000000000000', '8000000001000405') for code in ('6000', '0000')),
    *(('', f'{code}13200100000000', '8000000001000405') for code in ('a0', 'e0')),
    # the client ends a transfer: no answer
    (
        '1122334455', '4013200100000000 8013200100000405 6000000000000000',
        '4113200105000000  8013200101000405',
    ),
    # not eight bytes: no answer
    ('11', '40132001 ', ' '),
    # expedited writes, with a size and without
    *(
        ('1122', f'{write} 4013200100000000', '6013200100000000 4b13200133440000')
        for write in ('2b13200133440000', '2213200133445566')
    ),
    ('1122', '2313200133445566', '8013200112000706'),
    ('1122', '2f13200133000000', '8013200113000706'),
    # in segments
    (
        '0000000000000000', '2113200108000000 0011223344556677 1d88000000000000 4013200100000000',
        '6013200100000000 2000000000000000 3000000000000000 4113200108000000',
    ),
    # too many bytes, too few, the wrong toggle bit
    ('0000000000', '2113200105000000 0011223344556677', '6013200100000000 8013200112000706'),
    ('0000000000', '2113200105000000 0911223300000000', '6013200100000000 8013200113000706'),
    (
        '0000000000', '2113200105000000 1511223344550000 0511223344550000',
        '6013200100000000 8013200100000305 8013200101000405',
    ),
)  # fmt: skip


def test_golden_frames_of_the_standard():
    for value, requests, expected in GOLDEN:
        server = Server(Objects(bytes.fromhex(value)))
        answers = [server.answer(bytes.fromhex(request)).hex() for request in requests.split(' ')]
        assert answers == expected.split(' '), requests


def uploaded(node):
    """Return the object as the driver reads it."""
    upload = Upload(5, *PLACE)
    while upload.request is not None:
        assert upload.take_message(node.answer(upload.request))
    return upload.value


MESSAGES = st.one_of(
    st.binary(min_size=8, max_size=8),
    st.builds(
        lambda command, rest: bytes((command,)) + b'\x13\x20\x01' + rest,
        st.integers(0, 255),
        st.binary(min_size=4, max_size=4),
    ),
)


@given(st.binary(max_size=30), st.lists(MESSAGES, max_size=20))
def test_whatever_comes_it_answers_and_begins_anew(value, messages):
    objects = Objects(value)
    node = Server(objects)
    for message in messages:
        assert len(node.answer(message)) == (0 if message[0] >> 5 == 4 else 8)
    # whatever was written has the length of the object
    assert {len(data) for data in objects.writes} <= {len(value)}
    assert uploaded(node) == objects.value
