# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What carries CAN frames: a LAWICEL adapter on any port, SocketCAN on a socket made of paper."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import errno
import os
from pathlib import Path
import re
import select
import socket
import struct
import threading
import tty
from types import SimpleNamespace
from typing import Any

from canopen_far_end import Server
import pytest

from nfo_sinus_driver.link.canopen import can
from nfo_sinus_driver.link.canopen.can import Frame, SocketCan
from nfo_sinus_driver.link.canopen.lawicel import LawicelPort
from nfo_sinus_driver.link.canopen.link import CanopenLink
from nfo_sinus_driver.link.interface import Address, LineSettings, NoAnswer, PortError, Refused

REQUEST = Frame(0x605, bytes.fromhex('4013200000000000'))
ANSWER = Frame(0x585, bytes.fromhex('4B13200011220000'))
ANSWER_LINE = b't58584B13200011220000\r'

# --- LAWICEL --------------------------------------------------------------------------------------


class Adapter:
    """
    A port with an adapter behind it, and a clock that only waiting moves.

    :ivar says: what it answers to each command; nothing to those that are missing.
    :ivar written: all that was written.
    """

    def __init__(self) -> None:
        self.says = {b'C\r': b'\r', b'S4\r': b'\r', b'O\r': b'\r'}
        self.written: list[bytes] = []
        self.coming = b''
        self.is_open = False
        self.now = 0.0
        #: How long it takes to answer, s, and what comes of that when.
        self.slow = 0.0
        self.late: list[tuple[float, bytes]] = []

    def monotonic(self) -> float:
        return self.now

    def open(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def write(self, data: bytes) -> None:
        if not self.is_open:
            raise PortError('closed')
        self.written.append(data)
        answer = self.says.get(data, b'')
        if self.slow and answer:
            # one after the other
            begun = max([self.now, *(at for at, _ in self.late)])
            self.late.append((begun + self.slow, answer))
        else:
            self.coming += answer

    def read(self, until: float) -> bytes:
        if not self.coming:
            at = min((at for at, _ in self.late), default=until)
            self.now = max(self.now, min(at, until))
            self.coming = b''.join(answer for at, answer in self.late if at <= self.now)
            self.late = [(at, answer) for at, answer in self.late if at > self.now]
        data, self.coming = self.coming[:3], self.coming[3:]
        return data


@pytest.fixture
def adapter() -> Adapter:
    return Adapter()


def test_an_adapter_goes_onto_the_bus_and_off_it(adapter: Adapter) -> None:
    port = LawicelPort(adapter, 125_000, adapter.monotonic)
    port.open()
    assert adapter.written == [b'\r\r\r', b'C\r', b'S4\r', b'O\r']
    assert adapter.now == pytest.approx(0.1), 'it was heard out, and else nothing waited for'
    port.send(REQUEST)
    assert adapter.written[4:] == [b't60584013200000000000\r']
    port.close()
    assert adapter.written[5:] == [b'C\r'] and not adapter.is_open
    port.close()


def test_an_adapter_that_was_left_on_the_bus(adapter: Adapter) -> None:
    # it refuses what is half said, and frames come until it is off the bus
    adapter.says[b'\r\r\r'] = b'\a' + ANSWER_LINE
    adapter.says[b'C\r'] = ANSWER_LINE[5:] + b'\r'
    port = LawicelPort(adapter, 125_000, adapter.monotonic)
    port.open()
    assert port.receive(0.0) == []
    assert port.trouble == ''


def test_late_answers_of_an_adapter_count_for_what_they_answer(adapter: Adapter) -> None:
    adapter.says |= {b'\r\r\r': b'\r\r\a', b'C\r': b'\a'}
    for adapter.slow in (0.04, 0.15):
        adapter.written.clear()
        LawicelPort(adapter, 125_000, adapter.monotonic).open()
        # what it refused was not the bit rate
        assert adapter.written[-4:] == [b'\r\r\r', b'C\r', b'S4\r', b'O\r']
    adapter.slow = 0.04
    adapter.says[b'S4\r'] = b'\a'
    with pytest.raises(PortError, match='cannot do 125000 bit/s'):
        LawicelPort(adapter, 125_000, adapter.monotonic).open()


def test_an_adapter_that_never_ceases_to_talk_is_used_all_the_same(
    adapter: Adapter, monkeypatch: pytest.MonkeyPatch
) -> None:
    def talk(until: float) -> bytes:
        adapter.now += 0.01
        return b't'

    monkeypatch.setattr(adapter, 'read', talk)
    LawicelPort(adapter, 125_000, adapter.monotonic).open()
    assert adapter.written == [b'\r\r\r', b'C\r', b'S4\r', b'O\r']
    assert adapter.now < 2.0


def test_an_adapter_that_answers_no_command_is_used_all_the_same(adapter: Adapter) -> None:
    adapter.says.clear()
    LawicelPort(adapter, 125_000, adapter.monotonic).open()
    assert adapter.written == [b'\r\r\r', b'C\r', b'S4\r', b'O\r']
    assert adapter.now == pytest.approx(0.3)


@pytest.mark.parametrize(
    ('command', 'problem'),
    [(b'S4\r', 'cannot do 125000 bit/s'), (b'O\r', 'does not go onto the CAN bus')],
)
def test_an_adapter_that_refuses(adapter: Adapter, command: bytes, problem: str) -> None:
    adapter.says[command] = b'\a'
    with pytest.raises(PortError, match=problem):
        LawicelPort(adapter, 125_000, adapter.monotonic).open()
    assert not adapter.is_open


def test_a_bit_rate_that_there_is_not(adapter: Adapter) -> None:
    with pytest.raises(ValueError, match='bit rate 9600: there are 10000'):
        LawicelPort(adapter, 9600, adapter.monotonic)


def test_frames_of_an_adapter_in_pieces(adapter: Adapter) -> None:
    port = LawicelPort(adapter, 125_000, adapter.monotonic)
    port.open()
    adapter.coming = b'z\r' + ANSWER_LINE + ANSWER_LINE
    found: list[Frame] = []
    while adapter.coming:
        found += port.receive(0.0)
    assert found == [ANSWER, ANSWER]


def test_what_an_adapter_could_not_send(adapter: Adapter) -> None:
    port = LawicelPort(adapter, 125_000, adapter.monotonic)
    port.open()
    adapter.coming = b'\a'
    assert port.receive(0.0) == []
    assert 'with this bit rate?' in port.trouble
    adapter.coming = ANSWER_LINE
    while adapter.coming:
        port.receive(0.0)
    assert port.trouble == ''


def test_an_adapter_is_asked_once_what_keeps_frames_off(adapter: Adapter) -> None:
    port = LawicelPort(adapter, 125_000, adapter.monotonic)
    port.open()
    adapter.says |= {b't60584013200000000000\r': b'\a', b'F\r': b'FA4\r'}
    for _ in range(3):
        port.send(REQUEST)
        while adapter.coming:
            port.receive(0.0)
    assert port.trouble.endswith('adapter: A4, error warning, error passive, bus error)')
    assert adapter.written.count(b'F\r') == 1
    # off the bus and onto it again
    adapter.written.clear()
    adapter.says[b't60584013200000000000\r'] = b'z\r' + ANSWER_LINE
    port.open()
    assert adapter.written == [b'\r\r\r', b'C\r', b'S4\r', b'O\r'] and not port.trouble
    port.send(REQUEST)
    assert port.receive(0.0) == [] and port.receive(0.0) == []
    assert not port.trouble


def test_an_adapter_that_restarts_when_it_is_opened_is_taken_onto_the_bus(
    adapter: Adapter,
) -> None:
    says = dict(adapter.says)
    # it hears nothing meanwhile
    adapter.says.clear()
    port = LawicelPort(adapter, 125_000, adapter.monotonic)
    port.open()
    adapter.written.clear()
    for adapter.says in ({}, says):
        adapter.coming = b''
        port.send(REQUEST)
        assert adapter.written == [b'S4\r', b'O\r', b't60584013200000000000\r']
        assert port.receive(0.0) == []
        adapter.written.clear()
    port.send(REQUEST)
    assert adapter.written == [b't60584013200000000000\r'], 'it has confirmed that'


def test_an_adapter_that_confirms_nothing_but_passes_frames_is_on_the_bus(
    adapter: Adapter,
) -> None:
    adapter.says.clear()
    port = LawicelPort(adapter, 125_000, adapter.monotonic)
    port.open()
    adapter.coming = ANSWER_LINE
    found: list[Frame] = []
    while adapter.coming:
        found += port.receive(0.0)
    assert found == [ANSWER]
    adapter.written.clear()
    port.send(REQUEST)
    assert adapter.written == [b't60584013200000000000\r']


def test_an_adapter_that_has_no_flags(adapter: Adapter) -> None:
    port = LawicelPort(adapter, 125_000, adapter.monotonic)
    port.open()
    adapter.says |= {b't60584013200000000000\r': b'\a', b'F\r': b'\a'}
    for _ in range(3):
        port.send(REQUEST)
        port.receive(0.0)
        port.receive(0.0)
    assert port.trouble == can.CANNOT_SEND and adapter.written.count(b'F\r') == 1


# --- a whole bus ----------------------------------------------------------------------------------


class PtyBus:
    """An adapter at the far end of a pseudo-terminal, and one node."""

    def __init__(self) -> None:
        self._end, self._near = os.openpty()
        tty.setraw(self._near)
        self.path = os.ttyname(self._near)
        self.server = Server({(0x2022, 0): b'\1\0', (0x1008, 0): b'a text of many letters'})
        self._stop, self._stopped = os.pipe()
        self._thread = threading.Thread(target=self._work)
        self._thread.start()

    def close(self) -> None:
        os.write(self._stopped, b'x')
        self._thread.join()
        for fd in (self._end, self._near, self._stop, self._stopped):
            os.close(fd)

    def _work(self) -> None:
        buffer = b''
        while self._stop not in select.select([self._end, self._stop], [], [])[0]:
            *lines, buffer = (buffer + os.read(self._end, 200)).split(b'\r')
            for line in lines:
                os.write(self._end, self._answer(line))

    def _answer(self, line: bytes) -> bytes:
        if not line.startswith(b't605'):
            return b'z\r' if line.startswith(b't') else b'\r'
        answer = self.server.answer(bytes.fromhex(line[5:].decode()))
        return b'z\r' + (b'' if answer is None else b't5858' + answer.hex().encode() + b'\r')


@pytest.fixture
def pty_bus() -> Iterator[PtyBus]:
    bus = PtyBus()
    yield bus
    bus.close()


def test_a_node_behind_an_adapter(pty_bus: PtyBus) -> None:
    link = CanopenLink.on_port(pty_bus.path, LineSettings(125_000, '8N1', 10.0))
    link.open()
    try:
        mode, name = Address('object', 0x2022, None, 2), Address('object', 0x1008, None, 64)
        assert link.read(5, mode).data == b'\1\0'
        assert link.read(5, name).data == b'a text of many letters'
        for value in (b'another text', b'\3\0'):
            link.write(5, mode, value)
            assert link.read(5, mode).data == value
        with pytest.raises(Refused, match='no such object'):
            link.read(5, mode._replace(index=0x3000))
    finally:
        link.close()


def test_no_node_behind_an_adapter(pty_bus: PtyBus) -> None:
    link = CanopenLink.on_port(pty_bus.path, LineSettings(125_000, '8N1', 0.05))
    link.open()
    try:
        with pytest.raises(NoAnswer, match='unit 9 did not answer'):
            link.read(9, Address('object', 0x2022, None, 2))
    finally:
        link.close()


# --- SocketCAN ------------------------------------------------------------------------------------


class PaperSocket:
    """
    A CAN socket, and the queue of its interface; a pipe is what ``select`` sees of it.

    :ivar fails: with which error each of its methods fails.
    :ivar leaves: what is sent leaves the interface at once, and comes back.
    :ivar node: what answers as node 5.
    """

    def __init__(self) -> None:
        self.options: list[tuple[int, int, bytes]] = []
        self.bound: tuple[str, ...] | None = None
        self.sent: list[bytes] = []
        self.coming: list[tuple[bytes, int]] = []
        self.fails: dict[str, int] = {}
        self.leaves = True
        self.node: Server | None = None
        self.is_open = True
        self._ready, self._wake = os.pipe()

    def _may_fail(self, method: str) -> None:
        if method in self.fails:
            raise OSError(self.fails[method], os.strerror(self.fails[method]))

    def fileno(self) -> int:
        return self._ready

    def setblocking(self, blocking: bool) -> None:
        assert not blocking

    def setsockopt(self, level: int, name: int, value: bytes) -> None:
        self.options.append((level, name, value))

    def bind(self, address: tuple[str, ...]) -> None:
        self._may_fail('bind')
        self.bound = address

    def arrive(self, *frames: bytes, flags: int = 0) -> None:
        self.coming += [(frame, flags) for frame in frames if self._is_let_in(frame)]
        os.write(self._wake, b'x')

    def _is_let_in(self, frame: bytes) -> bool:
        """Return whether a filter lets it in, as linux/can.h has it."""
        (identifier,) = struct.unpack_from('=I', frame) if frame else (0,)
        (filters,) = (value for _, name, value in self.options if name == socket.CAN_RAW_FILTER)
        return any(
            bool(identifier & 0x2000_0000) if mask & 0x2000_0000
            else identifier & mask == wanted & mask
            for wanted, mask in struct.iter_unpack('=II', filters)
        )

    def recvmsg(self, size: int) -> tuple[bytes, list[Any], int, None]:
        self._may_fail('recvmsg')
        if not self.coming:
            if select.select([self._ready], [], [], 0)[0]:
                os.read(self._ready, 100)
            raise BlockingIOError
        data, flags = self.coming.pop(0)
        assert len(data) == size
        return data, [], flags, None

    def send(self, data: bytes) -> int:
        self._may_fail('send')
        self.sent.append(data)
        if self.leaves:
            self.leave(data)
        return len(data)

    def leave(self, data: bytes) -> None:
        """Have a frame leave the interface."""
        self.arrive(data, flags=socket.MSG_CONFIRM | socket.MSG_DONTROUTE)
        if self.node is not None and struct.unpack_from('=I', data)[0] == 0x605:
            answer = self.node.answer(data[8:])
            if answer is not None:
                self.arrive(raw(0x585, answer))

    def close(self) -> None:
        if self.is_open:
            os.close(self._ready)
            os.close(self._wake)
        self.is_open = False


@pytest.fixture
def paper(monkeypatch: pytest.MonkeyPatch) -> Iterator[PaperSocket]:
    paper = PaperSocket()

    def make(family: int, kind: int, protocol: int) -> PaperSocket:
        assert (family, kind, protocol) == (socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        paper._may_fail('socket')
        return paper

    monkeypatch.setattr(can.socket, 'socket', make)
    monkeypatch.setattr(can, 'restart_ms', lambda name: 100)
    yield paper
    paper.close()


def raw(identifier: int, data: bytes, length: int | None = None) -> bytes:
    """Return a struct can_frame as linux/can.h has it."""
    size = len(data) if length is None else length
    return struct.pack('=I', identifier) + bytes((size, 0, 0, 0)) + data.ljust(8, b'\0')


def make(name: str = 'can0') -> SocketCan:
    return SocketCan(name, ((0x580, 0x780), (0x600, 0x780)))


def test_a_socket_lets_in_what_is_wanted_and_nothing_else(paper: PaperSocket) -> None:
    make().open()
    assert paper.bound == ('can0',)
    # no extended, remote or error frames either; but of what it sends itself, commands and requests
    # for the state of a node
    wanted = (0x580, 0xC0000780), (0x600, 0xC0000780)
    let_in = *wanted, (0, 0xC00007FF), (0x40000700, 0xC0000780)
    expected = b''.join(struct.pack('=II', *frame) for frame in let_in)
    assert paper.options == [
        (socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, expected),
        (socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, struct.pack('=i', 1)),
    ]


def test_a_link_lets_in_answers_signs_of_life_and_requests_of_others(paper: PaperSocket) -> None:
    CanopenLink.on_port('can0', LineSettings(125_000, '8N1')).open()
    (_, _, filters), _ = paper.options
    identifiers = [identifier for identifier, _ in struct.iter_unpack('=II', filters)]
    assert sorted(identifiers) == [0, 0x580, 0x600, 0x700, 0x40000700]


def test_frames_of_a_socket(paper: PaperSocket) -> None:
    port = make()
    port.open()
    port.send(REQUEST)
    assert paper.sent == [raw(0x605, REQUEST.data)]
    assert port.receive(0.0) == []
    port.send(Frame(0x705, b'', remote=True))
    assert paper.sent[1:] == [raw(0x40000705, b'')]
    paper.arrive(
        raw(0x585, ANSWER.data), raw(0x80000585, b''), raw(0x40000585, b''), raw(0x585, b'\1'),
        raw(1, b'', 9),
    )
    assert port.receive(0.0) == [ANSWER, Frame(0x585, b'\1')]
    assert port.receive(0.0) == []
    port.close()
    port.close()
    assert not paper.is_open


def test_no_node_acknowledges(paper: PaperSocket) -> None:
    port = make()
    port.open()
    paper.fails['send'] = errno.ENOBUFS
    port.send(REQUEST)
    assert 'with this bit rate?' in port.trouble
    del paper.fails['send']
    paper.arrive(raw(0x585, ANSWER.data))
    port.receive(0.0)
    assert port.trouble == ''


def test_an_interface_that_is_open_is_opened_again(
    paper: PaperSocket, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = make()
    port.open()
    second = PaperSocket()
    monkeypatch.setattr(can.socket, 'socket', lambda *_: second)
    port.open()
    assert not paper.is_open and second.bound == ('can0',)
    port.close()


def test_bus_off_is_told_with_the_command(
    paper: PaperSocket, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(can, '_INTERFACES', tmp_path)
    monkeypatch.setattr(can, 'restart_ms', lambda name: None)
    (tmp_path / 'can0').mkdir()
    carrier = tmp_path / 'can0' / 'carrier'
    port = make()
    port.open()
    assert port.trouble == '' and port.remark == ''
    carrier.write_text('1\n', encoding='ascii')
    assert port.trouble == ''
    carrier.write_text('0\n', encoding='ascii')
    # a frame that is sent is dropped without an error
    port.send(REQUEST)
    assert re.search(
        'can0 is in bus-off.*where it does not restart by itself, sudo ip link set can0 down, '
        'then sudo ip link set can0 up type can restart-ms 100',
        port.trouble,
    )
    carrier.write_text('1\n', encoding='ascii')
    assert port.trouble == ''


class Interface:
    """
    An interface, its files in sysfs, and the time; its queue is that of the paper socket.

    :ivar now: the time, s.
    """

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self._folder = folder / 'can0'
        self._folder.mkdir()
        self._changes = 0
        self.now = 100.0
        monkeypatch.setattr(can, '_INTERFACES', folder)
        monkeypatch.setattr(can, 'time', SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(can, 'select', SimpleNamespace(select=self._wait))
        self.show('1')

    def show(self, carrier: str) -> None:
        """Be in bus-off (``0``), or out of it."""
        self._changes += 1
        for name, text in (('carrier', carrier), ('carrier_changes', self._changes)):
            (self._folder / name).write_text(f'{text}\n', encoding='ascii')

    def _wait(self, ready: Any, _: Any, __: Any, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def interface(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Interface:
    return Interface(tmp_path, monkeypatch)


#: A set-point, and a stop.
SETPOINT, STOP = Frame(0x605, bytes(7) + b'\1'), Frame(0x605, bytes(7) + b'\2')


def raw_of(*frames: Frame) -> list[bytes]:
    return [raw(frame.identifier, frame.data) for frame in frames]


@pytest.fixture
def port(paper: PaperSocket, interface: Interface) -> SocketCan:
    port = make()
    port.open()
    return port


def test_a_node_behind_an_interface(paper: PaperSocket) -> None:
    paper.node = Server({(0x2022, 0): b'\1\0', (0x1008, 0): b'a text of many letters'})
    link = CanopenLink.on_port('can0', LineSettings(125_000, '8N1', 10.0))
    link.open()
    mode, name = Address('object', 0x2022, None, 2), Address('object', 0x1008, None, 64)
    assert link.read(5, mode).data == b'\1\0'
    assert link.read(5, name).data == b'a text of many letters'
    link.write(5, mode, b'\3\0')
    assert link.read(5, mode).data == b'\3\0'
    # it is made operational before it is written to
    assert raw(0, b'\1\5') in paper.sent
    link.close()


def test_the_next_frame_waits_until_the_one_before_has_left(
    paper: PaperSocket, port: SocketCan
) -> None:
    paper.leaves = False
    port.send(SETPOINT)
    port.send(STOP)
    assert paper.sent == raw_of(SETPOINT)
    paper.leave(paper.sent[0])
    # what comes back is no frame of another
    assert port.receive(0.0) == [] and paper.sent == raw_of(SETPOINT, STOP)


def test_frames_leave_one_after_the_other_without_a_wait(
    paper: PaperSocket, port: SocketCan, interface: Interface
) -> None:
    command, guarding = Frame(0, b'\1\5'), Frame(0x705, bytes(1), remote=True)
    for frame in (command, guarding, SETPOINT):
        port.send(frame)
    assert port.receive(interface.now) == []
    assert paper.sent == [raw(0, b'\1\5'), raw(0x40000705, bytes(1)), *raw_of(SETPOINT)]


@pytest.fixture
def sockets(paper: PaperSocket, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[PaperSocket]]:
    """Yield all sockets of the interface, the newest one last; nothing leaves it."""
    sockets = [paper]
    paper.leaves = False

    def make(*_: int) -> PaperSocket:
        sockets.append(PaperSocket())
        sockets[-1].leaves = False
        return sockets[-1]

    monkeypatch.setattr(can.socket, 'socket', make)
    yield sockets
    for opened in sockets:
        opened.close()


def sent(sockets: list[PaperSocket]) -> list[bytes]:
    """Return what was handed to the interface, by any of them."""
    return [frame for opened in sockets for frame in opened.sent]


@pytest.mark.parametrize('restart', ['it leaves', 'it is lost'])
def test_in_bus_off_one_frame_is_handed_over_and_then_the_stop(
    sockets: list[PaperSocket], port: SocketCan, interface: Interface, restart: str
) -> None:
    interface.show('0')
    for number in range(60):
        port.send(Frame(0x605, bytes((0x2B, 0x22, 0x20, 0, number, 0, 0, 0))))
        port.send(Frame(0x77F, b'\5'))
        assert port.receive(interface.now + 0.2) == []
        if number % 10 == 9:
            port.open()
    (old,) = sent(sockets)
    assert len(sockets) > 5 and 'is in bus-off' in port.trouble
    # the bus is back
    if restart == 'it leaves':
        sockets[-1].arrive(old)
    interface.show('1')
    port.send(STOP)
    port.receive(interface.now + 0.1)
    assert sent(sockets) == [old, *raw_of(STOP)]


def test_where_no_node_listens_one_frame_waits_and_is_given_up_in_the_end(
    sockets: list[PaperSocket], port: SocketCan, interface: Interface
) -> None:
    port.send(SETPOINT)
    for _ in range(4):
        port.receive(interface.now + 2.0)
        port.open()
        port.send(REQUEST)
    assert sent(sockets) == raw_of(SETPOINT)
    port.receive(interface.now + 2.1)
    port.open()
    port.send(STOP)
    assert sent(sockets) == raw_of(SETPOINT, STOP)


def test_a_frame_that_bus_off_has_swallowed_is_not_waited_for(
    paper: PaperSocket, port: SocketCan, interface: Interface
) -> None:
    paper.leaves = False
    port.send(SETPOINT)
    interface.show('0')
    port.receive(interface.now + 1.0)
    paper.sent.clear()
    # it restarts by itself, and nothing comes back
    interface.show('1')
    port.send(STOP)
    assert paper.sent == raw_of(STOP)


def test_on_a_bus_that_works_a_frame_that_does_not_come_back_is_not_waited_for(
    paper: PaperSocket, port: SocketCan, interface: Interface
) -> None:
    paper.leaves = False
    port.send(SETPOINT)
    interface.now += 0.05
    paper.arrive(raw(0x586, ANSWER.data))
    assert port.receive(0.0) == [Frame(0x586, ANSWER.data)]
    port.send(STOP)
    assert paper.sent == raw_of(SETPOINT), 'it may have to wait for others'
    interface.now += 0.06
    paper.arrive(raw(0x586, ANSWER.data))
    assert port.receive(0.0) == [Frame(0x586, ANSWER.data)]
    assert paper.sent == raw_of(SETPOINT, STOP)


def test_a_driver_of_linux_that_returns_nothing_is_not_waited_for(
    paper: PaperSocket, port: SocketCan
) -> None:
    paper.leaves = False
    port.send(REQUEST)
    paper.arrive(raw(0x585, ANSWER.data))
    assert port.receive(0.0) == [ANSWER]
    command = Frame(0, b'\1\5')
    port.send(command)
    port.send(STOP)
    assert paper.sent == raw_of(REQUEST, command, STOP)
    # it does, after all
    paper.leave(paper.sent[-1])
    port.receive(0.0)
    port.send(SETPOINT)
    port.send(REQUEST)
    assert paper.sent == raw_of(REQUEST, command, STOP, SETPOINT)


def test_a_frame_that_waits_too_long_never_leaves(
    paper: PaperSocket, port: SocketCan, interface: Interface
) -> None:
    paper.leaves = False
    port.send(REQUEST)
    port.send(SETPOINT)
    port.receive(interface.now + 0.5)
    assert port.trouble == can.CANNOT_SEND
    port.send(STOP)
    paper.leave(paper.sent[0])
    port.receive(0.0)
    assert paper.sent == raw_of(REQUEST, STOP) and port.trouble == ''


def test_a_frame_outlasts_its_socket(sockets: list[PaperSocket], port: SocketCan) -> None:
    port.send(SETPOINT)
    port.open()
    port.send(STOP)
    assert sent(sockets) == raw_of(SETPOINT)
    # for this socket it is one of another
    sockets[-1].arrive(*raw_of(SETPOINT))
    assert port.receive(0.0) == [] and sent(sockets) == raw_of(SETPOINT, STOP)


def test_another_program_of_this_computer_is_heard(paper: PaperSocket, port: SocketCan) -> None:
    port.send(STOP)
    paper.arrive(raw(0x605, SETPOINT.data), flags=socket.MSG_DONTROUTE)
    paper.arrive(raw(0, b'\2\5'), flags=socket.MSG_DONTROUTE)
    assert port.receive(0.0) == [SETPOINT], 'and no command of another'


@pytest.mark.parametrize('number', [errno.ENETDOWN, errno.ENODEV])
def test_an_interface_that_was_down_has_nothing_in_its_queue(
    sockets: list[PaperSocket], port: SocketCan, number: int
) -> None:
    port.send(SETPOINT)
    sockets[-1].fails['recvmsg'] = number
    with pytest.raises(PortError, match='can0'):
        port.receive(0.0)
    port.open()
    port.send(STOP)
    assert sockets[-1].sent == raw_of(STOP)


@pytest.mark.parametrize(
    ('restart', 'remark', 'trouble'),
    [
        (0, 'stays in bus-off for good.*sudo ip link set can0 down, then', 'bit rate; sudo ip'),
        (100, '^$', 'bit rate; it restarts by itself every 100 ms$'),
        (None, '^$', 'bit rate; where it does not restart by itself, sudo ip link'),
    ],
)
def test_an_interface_that_stays_in_bus_off_is_told(
    interface: Interface,
    paper: PaperSocket,
    monkeypatch: pytest.MonkeyPatch,
    restart: int | None,
    remark: str,
    trouble: str,
) -> None:
    monkeypatch.setattr(can, 'restart_ms', lambda name: restart)
    link = CanopenLink.on_port('can0', LineSettings(125_000, '8N1'))
    link.open()
    assert re.search(remark, ''.join(link.remarks.texts))
    interface.show('0')
    with pytest.raises(NoAnswer, match=trouble):
        link.read(5, Address('object', 0x2022, None, 2))
    link.close()


@pytest.mark.parametrize(
    ('method', 'number', 'problem'),
    [
        ('socket', errno.EAFNOSUPPORT, 'this kernel has no SocketCAN'),
        ('bind', errno.ENODEV, r'there is no CAN interface can0: .* Interfaces there are: vcan7'),
        ('send', errno.ENETDOWN, 'can0 is down: sudo ip link set can0 up type can bitrate'),
        ('recvmsg', errno.ENETDOWN, 'can0 is down'),
        ('recvmsg', errno.EIO, 'can0 was lost'),
    ],
)
def test_what_is_wrong_with_an_interface(
    paper: PaperSocket,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    method: str,
    number: int,
    problem: str,
) -> None:
    for name, kind in (('vcan7', '280'), ('eth0', '1')):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'type').write_text(f'{kind}\n', encoding='ascii')
    # one that goes away meanwhile
    (tmp_path / 'can9' / 'type').mkdir(parents=True)
    monkeypatch.setattr(can, '_INTERFACES', tmp_path)
    paper.fails[method] = number
    port = make()
    acts: dict[str, Callable[[], Any]] = {
        'send': lambda: port.send(REQUEST),
        'recvmsg': lambda: (paper.arrive(b''), port.receive(0.0)),
    }
    with pytest.raises(PortError, match=problem):
        port.open()
        acts[method]()


def test_a_closed_port() -> None:
    port = make()
    for act in (lambda: port.send(REQUEST), lambda: port.receive(0.0)):
        with pytest.raises(PortError, match='can0 is not open'):
            act()
