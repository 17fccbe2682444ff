# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus TCP, to pymodbus's server and to a gateway that does everything wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import socket
import threading
import time

from pymodbus_server import PATIENCE, REGISTERS, tcp_server
import pytest
from support.addresses import packed, register, words_of
from support.plans import followed

from nfo_sinus_driver.link import (
    Address,
    DamagedAnswer,
    GatewaySilent,
    LineSettings,
    NoAnswer,
    NoPath,
    PortError,
    Refused,
    open_link,
)
from nfo_sinus_driver.link.modbus.tcp import TcpLink
from nfo_sinus_driver.link.plc import telegram
from nfo_sinus_driver.link.ports.tcp_connection import TcpConnection

A = register(0x400)
B = register(0x264)
TWO = register(0x258, 2)


# --- pymodbus's server ----------------------------------------------------------------------------


@pytest.fixture(scope='module')
def link() -> Iterator[TcpLink]:
    with tcp_server() as port:
        link = open_link('modbus_tcp', f'127.0.0.1:{port}', LineSettings(response_timeout=5.0))
        assert isinstance(link, TcpLink)
        link.open()
        yield link
        link.close()


def test_read_and_write(link: TcpLink) -> None:
    assert link.read(1, A).data == packed(0x400)
    assert link.read(2, TWO).data == packed(0x258, 0x259)
    assert link.write(1, A, packed(5)).data == b''
    assert link.write(1, TWO, packed(6, 7)).data == b''
    assert link.read(1, A).data == packed(5)
    assert link.read(1, TWO).data == packed(6, 7)
    assert link.read(2, A).data == packed(0x400)
    assert link.write_and_read(2, A, packed(8), A).data == packed(8)


def test_refusal(link: TcpLink) -> None:
    with pytest.raises(Refused) as refusal:
        link.read(1, register(REGISTERS[-1] + 1))
    assert refusal.value.code == Refused.ILLEGAL_ADDRESS


def test_identification(link: TcpLink) -> None:
    # not every version has function 17
    found = followed(link.identify(1))
    assert found.product == 'NFO Sinus'
    assert found.revision == '4.30 / 4018'


def test_reply_says_when_it_came(link: TcpLink) -> None:
    before = time.monotonic()
    assert before <= link.read(1, A).arrived <= time.monotonic()


# --- a gateway that does everything wrong ---------------------------------------------------------

Frame = tuple[int, bytes]


def pack(number: int, message: bytes) -> bytes:
    return number.to_bytes(2, 'big') + bytes(2) + len(message).to_bytes(2, 'big') + message


def answer(frame: Frame) -> bytes:
    """The right answer; what is read is the register's number and how many requests came before."""
    number, message = frame
    if message[1] == 3:
        count = message[5]
        word = int.from_bytes(message[2:4], 'big') + number
        return pack(number, message[:2] + bytes((2 * count,)) + word.to_bytes(2, 'big') * count)
    return pack(number, message[:6])


def refusal(frame: Frame, code: int) -> bytes:
    number, message = frame
    return pack(number, bytes((message[0], message[1] | 0x80, code)))


class Gateway:
    """
    A gateway by hand.

    :ivar reply: what it sends for each request; ``None`` to close the connection.
    :ivar requests: every request that came.
    """

    def __init__(self) -> None:
        self._listening = socket.create_server(('127.0.0.1', 0))
        self.port: int = self._listening.getsockname()[1]
        self.reply: Callable[[Frame], bytes | None] = answer
        self.requests: list[Frame] = []
        self.connections = 0
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self._thread.join(PATIENCE)

    def _work(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection = self._listening.accept()[0]
                self.connections += 1
                with connection, contextlib.suppress(ConnectionError):
                    self._serve(connection)

    def _serve(self, connection: socket.socket) -> None:
        while True:
            header = connection.recv(6, socket.MSG_WAITALL)
            if len(header) < 6:
                return
            length = int.from_bytes(header[4:6], 'big')
            message = connection.recv(length, socket.MSG_WAITALL)
            frame = int.from_bytes(header[:2], 'big'), message
            self.requests.append(frame)
            reply = self.reply(frame)
            if reply is None:
                return
            connection.sendall(reply)

    def then(self, *replies: Callable[[Frame], bytes | None]) -> None:
        """Reply to the next requests like this, and then rightly."""
        left = list(replies)
        self.reply = lambda frame: left.pop(0)(frame) if left else answer(frame)


@pytest.fixture
def gateway() -> Iterator[Gateway]:
    gateway = Gateway()
    yield gateway
    gateway.close()


@pytest.fixture
def patient(gateway: Gateway) -> Iterator[TcpLink]:
    """A link that waits long: only for answers that come."""
    yield from opened(gateway, PATIENCE)


@pytest.fixture
def hasty(gateway: Gateway) -> Iterator[TcpLink]:
    """A link that waits as short as it can: only for answers that do not come."""
    yield from opened(gateway, 0.05)


def opened(gateway: Gateway, timeout: float) -> Iterator[TcpLink]:
    link = TcpLink('127.0.0.1', gateway.port, timeout)
    link.open()
    yield link
    link.close()


def read(link: TcpLink, address: Address, gateway: Gateway) -> None:
    """Read, and see that it is the answer to this very request."""
    reply = link.read(1, address).data
    number, message = gateway.requests[-1]
    assert int.from_bytes(message[2:4], 'big') == address.index
    assert words_of(reply) == (address.index + number,) * (address.size // 2)


def nothing(frame: Frame) -> bytes:
    return b''


@pytest.mark.parametrize(
    'reply',
    [
        answer,
        nothing,
        lambda frame: refusal(frame, Refused.ILLEGAL_ADDRESS),
        lambda frame: refusal(frame, Refused.NO_ANSWER),
        lambda frame: pack(frame[0], frame[1][:1] + b'\x7f'),
    ],
)
def test_whatever_becomes_of_the_read_the_write_is_the_next_frame(
    gateway: Gateway, hasty: TcpLink, reply: Callable[[Frame], bytes]
) -> None:
    gateway.then(reply, answer)
    # a busy machine may miss the answer to the write
    with contextlib.suppress(GatewaySilent):
        assert hasty.read_then_write(1, A, B, packed(0)).data == b''
    deadline = time.monotonic() + PATIENCE
    while len(gateway.requests) < 2 and time.monotonic() < deadline:
        time.sleep(0.001)
    assert [message[1:4] for _, message in gateway.requests] == [b'\x03\x04\x00', b'\x06\x02\x64']


def test_once_the_read_was_sent_it_may_have_been_done(gateway: Gateway, patient: TcpLink) -> None:
    gateway.then(answer, lambda frame: refusal(frame, Refused.DEVICE_FAILURE))
    with pytest.raises(Refused) as refused:
        patient.read_then_write(1, A, B, packed(0))
    assert refused.value.maybe_done
    gateway.then(lambda frame: None)
    with pytest.raises(PortError):
        patient.read_then_write(1, A, B, packed(0))
    assert len(gateway.requests) == 3


def test_late_answer_is_recognised_by_its_number(gateway: Gateway, hasty: TcpLink) -> None:
    late: list[bytes] = []

    def keep(frame: Frame) -> bytes:
        late.append(answer(frame))
        return b''

    gateway.then(keep, keep)
    for address in (A, B):
        with pytest.raises(GatewaySilent):
            hasty.read(1, address)
    # what was late comes before what is asked now, and looks just like it but for its number
    hasty._response_timeout = PATIENCE
    gateway.then(lambda frame: b''.join(late) + answer(frame))
    read(hasty, A, gateway)
    read(hasty, B, gateway)
    assert gateway.connections == 1


def test_answer_that_comes_twice(gateway: Gateway, patient: TcpLink) -> None:
    gateway.then(lambda frame: 2 * answer(frame))
    for address in (A, B, A, TWO):
        read(patient, address, gateway)
    assert len(gateway.requests) == 4


def test_second_answer_that_comes_with_the_next_one(gateway: Gateway, patient: TcpLink) -> None:
    first: list[bytes] = []

    def keep(frame: Frame) -> bytes:
        first.append(answer(frame))
        return first[0]

    gateway.then(keep, lambda frame: first[0] + answer(frame))
    read(patient, A, gateway)
    read(patient, B, gateway)


def test_second_refusal_is_not_that_of_the_next_request(
    gateway: Gateway, patient: TcpLink
) -> None:
    gateway.then(lambda frame: 2 * refusal(frame, 2))
    with pytest.raises(Refused):
        patient.read(1, A)
    read(patient, B, gateway)


def test_silent_drive_leaves_the_others_alone(gateway: Gateway, hasty: TcpLink) -> None:
    def without_unit_2(frame: Frame) -> bytes:
        return b'' if frame[1][0] == 2 else answer(frame)

    gateway.reply = without_unit_2
    for _ in range(10):
        with pytest.raises(GatewaySilent, match='did not answer for unit 2') as silence:
            hasty.read(2, A)
        assert silence.value.maybe_done
    hasty._response_timeout = PATIENCE
    read(hasty, A, gateway)
    # each was asked once, on the same connection
    assert len(gateway.requests) == 11
    assert gateway.connections == 1


def test_drive_that_is_silent_to_the_gateway(gateway: Gateway, patient: TcpLink) -> None:
    gateway.then(lambda frame: refusal(frame, 11))
    with pytest.raises(NoAnswer, match='unit 1 did not answer the gateway') as silence:
        patient.write(1, A, packed(5))
    assert type(silence.value) is NoAnswer
    assert silence.value.maybe_done
    read(patient, A, gateway)


def test_gateway_without_a_path(gateway: Gateway, patient: TcpLink) -> None:
    gateway.then(lambda frame: refusal(frame, 10))
    with pytest.raises(NoPath, match=r'no path to unit 1.*settings of the gateway') as error:
        patient.read(1, A)
    assert not error.value.maybe_done
    assert not isinstance(error.value, (NoAnswer, Refused))
    read(patient, A, gateway)


def test_answer_in_pieces(gateway: Gateway, hasty: TcpLink) -> None:
    whole: list[bytes] = []

    def half(frame: Frame) -> bytes:
        whole.append(answer(frame))
        return whole[0][:8]

    gateway.then(half, lambda frame: whole[0][8:] + answer(frame))
    with pytest.raises(DamagedAnswer, match='only a part'):
        hasty.read(1, A)
    hasty._response_timeout = PATIENCE
    read(hasty, B, gateway)


@pytest.mark.parametrize(
    'spoil',
    [
        lambda number, message: (number, bytes((2,)) + message[1:]),
        lambda number, message: (number, message[:1] + b'\x04' + message[2:]),
        lambda number, message: (number, message[:2] + b'\x04' + message[3:]),
        lambda number, message: (number, message + b'\x00'),
        lambda number, message: (number, message[:2]),
    ],
)
def test_answer_to_something_else_with_our_number(
    gateway: Gateway, patient: TcpLink, spoil: Callable[[int, bytes], Frame]
) -> None:
    def wrong(frame: Frame) -> bytes:
        right = answer(frame)
        return pack(*spoil(frame[0], right[6:]))

    gateway.then(wrong)
    with pytest.raises(DamagedAnswer):
        patient.read(1, A)
    read(patient, A, gateway)


def test_gateway_that_closes_the_connection(gateway: Gateway, patient: TcpLink) -> None:
    gateway.then(lambda frame: None)
    with pytest.raises(PortError, match=r'was lost \(the gateway closed it'):
        patient.read(1, A)
    patient.close()
    patient.open()
    read(patient, A, gateway)
    assert gateway.connections == 2


def test_connection_closed_between_two_requests(gateway: Gateway, patient: TcpLink) -> None:
    gateway.then(lambda frame: None)
    with pytest.raises(PortError):
        patient.read(1, A)
    with pytest.raises(PortError):
        patient.read(1, A)


@pytest.mark.parametrize('once', [True, False])
def test_what_acknowledges_is_sent_once(gateway: Gateway, patient: TcpLink, once: bool) -> None:
    # a gateway that answers one request in each connection
    gateway.then(answer, lambda frame: None)
    patient.read(1, A)
    with pytest.raises(PortError) if once else contextlib.nullcontext():
        patient.read(1, A, once)
    assert len(gateway.requests) == 2 + (not once)


def test_tcp_itself_finds_out_that_an_idle_connection_is_gone(
    gateway: Gateway, patient: TcpLink
) -> None:
    read(patient, A, gateway)
    connection = patient._connection
    assert isinstance(connection, TcpConnection) and connection._socket is not None
    for level, option in (
        (socket.SOL_SOCKET, socket.SO_KEEPALIVE),
        (socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT),
    ):
        assert connection._socket.getsockopt(level, option) > 0


def test_words_that_let_a_motor_run_are_forgotten_with_a_mute_connection(
    gateway: Gateway, hasty: TcpLink
) -> None:
    block = bytes.fromhex('0000 0000 0001 0003 0001')
    gateway.reply = lambda frame: pack(
        frame[0], frame[1][:2] + (bytes((10,)) + block if frame[1][1] != 16 else frame[1][2:6])
    )
    hasty._response_timeout = PATIENCE
    for part in (telegram.BEGIN, telegram.NEXT):
        place = Address(telegram.ADDRESSING, 0, part, 4, block=100)
        hasty.write(1, place, packed(0x47F, 0))
    assert gateway.requests[-1][1][1] == 23
    # beside the mute one
    hasty.open()
    gateway.requests.clear()
    with pytest.raises(Refused):
        hasty.write(1, place._replace(sub_index=telegram.SETPOINT, size=2), packed(5))
    hasty.read(1, place._replace(sub_index=telegram.STATUS))
    assert {message[1] for _, message in gateway.requests} == {3}


def test_another_unit_answers(gateway: Gateway, patient: TcpLink) -> None:
    # a serial device server that passes on what a drive sends
    gateway.then(lambda frame: bytes.fromhex('01 03 02 00 25 79 9F'))
    remedy = f'protocol to modbus_rtu and port to socket://127.0.0.1:{gateway.port}'
    with pytest.raises(PortError, match=remedy):
        patient.read(1, A)


def test_gateway_that_never_stops_talking(gateway: Gateway, hasty: TcpLink) -> None:
    gateway.then(lambda frame: 50_000 * pack(0, b'\x01\x03\x02\x00\x25'))
    start = time.monotonic()
    with pytest.raises((GatewaySilent, DamagedAnswer)):
        hasty.read(1, A)
    assert time.monotonic() - start < PATIENCE


def test_numbers_go_round(gateway: Gateway, patient: TcpLink) -> None:
    patient._number = 0xFFFE
    for _ in range(3):
        patient.write(1, A, packed(5))
    assert [number for number, _ in gateway.requests] == [0xFFFF, 1, 2]


def test_no_unit_there() -> None:
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
        link = TcpLink('127.0.0.1', port, 1.0)
        with pytest.raises(PortError, match=rf'127.0.0.1:{port} cannot be reached .*switched on'):
            link.open()
    link.close()


def test_host_that_is_not_known() -> None:
    with pytest.raises(PortError, match=r'no\.such\.host\.invalid:502 cannot be reached'):
        TcpLink('no.such.host.invalid', 502, 1.0).open()


def test_closed_link(gateway: Gateway) -> None:
    link = TcpLink('::1', gateway.port, 1.0)
    with pytest.raises(PortError, match=rf'\[::1\]:{gateway.port} is not connected'):
        link.read(1, A)
    link.close()


# --- where a gateway is ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('port', 'where'),
    [
        ('gateway', 'gateway:502'),
        ('192.0.2.1', '192.0.2.1:502'),
        ('192.0.2.1:1502', '192.0.2.1:1502'),
        ('[2001:db8::1]:1502', '[2001:db8::1]:1502'),
    ],
)
def test_where_a_gateway_may_be(port: str, where: str) -> None:
    link = open_link('modbus_tcp', port, LineSettings())
    with pytest.raises(PortError, match=f'^{where.replace("[", chr(92) + "[")} is not'):
        link.read(1, A)


@pytest.mark.parametrize(
    'port',
    ['', '/dev/ttyUSB0', 'socket://a:502', 'a:b', 'a:0', 'a:65536', '2001:db8::1', 'a/b', 'u@a:1'],
)
def test_where_no_gateway_can_be(port: str) -> None:
    with pytest.raises(ValueError, match='no gateway: modbus_tcp wants host:port'):
        open_link('modbus_tcp', port, LineSettings())


def test_line_settings_do_not_matter() -> None:
    for char_format in ('7E1', '8N2'):
        open_link('modbus_tcp', 'a:1', LineSettings(baud_rate=1200, char_format=char_format))
