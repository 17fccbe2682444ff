# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Real ports: pseudo-terminals, and a TCP socket on this machine."""

from __future__ import annotations

import array
from collections.abc import Iterator
import contextlib
import errno
import fcntl
import os
from pathlib import Path
import re
import select
import socket
import subprocess
import sys
import termios
import threading
import time
import tty
from types import SimpleNamespace

import pytest
from support.addresses import packed, register

from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.link.interface import BAUD_RATES, LineSettings, PortError
from nfo_sinus_driver.link.modbus.pdu import Read
from nfo_sinus_driver.link.modbus.rtu import crc, encode
from nfo_sinus_driver.link.ports import serial_port
from nfo_sinus_driver.link.ports.serial_port import SerialPort
from nfo_sinus_driver.link.ports.url_port import UrlPort

#: No honest wait here takes this long, on any machine, s.
PATIENCE = 30.0
EVERY_BYTE = bytes(range(256))
#: Whether a terminal is open for root alone (asm-generic/ioctls.h), its settings with the rates as
#: numbers, and its RS-485 mode.
_TIOCGEXCL = 0x80045440
_TCGETS2, _TCSETS2 = 0x802C542A, 0x402C542B
_TIOCGRS485, _TIOCSRS485 = 0x542E, 0x542F


class Pty:
    """A pseudo-terminal: ``far`` is the drive's end, ``path`` what the driver opens."""

    def __init__(self) -> None:
        self.far, self._near = os.openpty()
        tty.setraw(self._near)
        self.path = os.ttyname(self._near)

    def receive(self, count: int) -> bytes:
        data = b''
        while len(data) < count:
            assert select.select([self.far], [], [], PATIENCE)[0], f'only {len(data)} bytes came'
            data += os.read(self.far, 4096)
        return data

    def hang_up(self) -> None:
        for end in (self.far, self._near):
            if end >= 0:
                os.close(end)
        self.far = self._near = -1


@pytest.fixture
def pty() -> Iterator[Pty]:
    pty = Pty()
    yield pty
    pty.hang_up()


@pytest.fixture
def port(pty: Pty) -> Iterator[SerialPort]:
    port = SerialPort(pty.path, LineSettings())
    port.open()
    yield port
    port.close()


def read(port: SerialPort | UrlPort, count: int) -> bytes:
    """Read as many bytes, however they are cut."""
    deadline = time.monotonic() + PATIENCE
    data = b''
    while len(data) < count and time.monotonic() < deadline:
        data += port.read(deadline)
    return data


def descriptors() -> set[str]:
    return set(os.listdir('/proc/self/fd'))


# --- serial ports ---------------------------------------------------------------------------------


def test_bytes_go_both_ways(pty: Pty, port: SerialPort) -> None:
    port.write(EVERY_BYTE)
    assert pty.receive(256) == EVERY_BYTE
    os.write(pty.far, EVERY_BYTE)
    assert read(port, 256) == EVERY_BYTE


def test_read_gives_up_when_its_time_is_over(port: SerialPort) -> None:
    start = time.monotonic()
    assert port.read(start + 0.02) == b''
    assert time.monotonic() >= start + 0.02
    assert port.read(start - 5) == b''


def test_read_after_its_time_still_takes_what_is_there(pty: Pty, port: SerialPort) -> None:
    os.write(pty.far, b'x')
    assert read(port, 1) == b'x'
    os.write(pty.far, b'y')
    deadline = time.monotonic() + PATIENCE
    data = b''
    while not data and time.monotonic() < deadline:
        data = port.read(0.0)
    assert data == b'y'


@pytest.mark.parametrize(
    'char_format', [f'{bits}{parity}{stop}' for bits in '78' for parity in 'EON' for stop in '12']
)
def test_every_format_is_tolerated_by_a_pseudo_terminal(pty: Pty, char_format: str) -> None:
    port = SerialPort(pty.path, LineSettings(char_format=char_format))
    # a second time, too: this is where the C library says EINVAL
    for _ in range(2):
        port.open()
        port.write(EVERY_BYTE)
        assert pty.receive(256) == EVERY_BYTE
        os.write(pty.far, EVERY_BYTE)
        assert read(port, 256) == EVERY_BYTE
        port.close()


@pytest.mark.parametrize(
    ('char_format', 'expected'),
    [
        ('7E1', termios.CS7 | termios.PARENB),
        ('7N2', termios.CS7 | termios.CSTOPB),
        ('8E1', termios.CS8 | termios.PARENB),
        ('8O1', termios.CS8 | termios.PARENB | termios.PARODD),
        ('8N1', termios.CS8),
        ('8N2', termios.CS8 | termios.CSTOPB),
    ],
)
def test_every_format_is_set(
    pty: Pty, monkeypatch: pytest.MonkeyPatch, no_pty: None, char_format: str, expected: int
) -> None:
    # a pseudo-terminal keeps none of it
    kept = [termios.tcgetattr(pty.far)]
    monkeypatch.setattr(termios, 'tcgetattr', lambda fd: [*kept[-1]])
    monkeypatch.setattr(termios, 'tcsetattr', lambda fd, when, modes: kept.append(modes))
    port = SerialPort(pty.path, LineSettings(char_format=char_format))
    port.open()
    port.close()
    format_bits = termios.CSIZE | termios.PARENB | termios.PARODD | termios.CSTOPB
    assert kept[-1][2] & format_bits == expected


@pytest.mark.parametrize('baud', [*BAUD_RATES, 115_200, 250_000])
def test_every_baud_rate_is_set(pty: Pty, baud: int) -> None:
    port = SerialPort(pty.path, LineSettings(baud_rate=baud, char_format='8N1'))
    port.open()
    assert list(_settings(pty)[9:]) == [baud, baud]
    port.close()


def _settings(pty: Pty) -> array.array[int]:
    """Return four words of flags, 20 bytes of characters, and the rates of both directions."""
    settings = array.array('I', [0] * 11)
    fcntl.ioctl(pty.far, _TCGETS2, settings)
    return settings


@pytest.mark.parametrize('baud', [19_200, 250_000])
def test_nothing_of_an_earlier_program_is_left(pty: Pty, baud: int) -> None:
    settings = _settings(pty)
    settings[0] |= termios.BRKINT | termios.PARMRK | termios.IXOFF
    # all there are, and a rate of its own for what is received
    settings[2] |= 0xFFFFFFFF & ~termios.CIBAUD | termios.CBAUDEX << 16
    settings[3] |= termios.NOFLSH | termios.TOSTOP
    settings[9:] = array.array('I', [4800, 4800])
    fcntl.ioctl(pty.far, _TCSETS2, settings)
    port = SerialPort(pty.path, LineSettings(baud_rate=baud))
    port.open()
    now = _settings(pty)
    # a byte with wrong parity never comes, and a break is none
    assert list(now[:2]) == [termios.INPCK | termios.IGNPAR, 0]
    # a modem line that falls when the port is closed resets some adapters
    assert now[2] & ~termios.CBAUD == termios.CS8 | termios.CREAD | termios.CLOCAL
    assert [now[3], *now[9:]] == [0, baud, baud]
    port.close()


def test_what_an_earlier_program_wrote_does_not_leave(pty: Pty) -> None:
    written = 0
    os.set_blocking(pty._near, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            written += os.write(pty._near, EVERY_BYTE)
    port = SerialPort(pty.path, LineSettings())
    port.open()
    port.write(b'new')
    came = b''
    while not came.endswith(b'new'):
        came += pty.receive(1)
    # the far end of a terminal has some of it already
    assert len(came) < written
    port.close()


def test_modem_lines_stay_as_they_are(pty: Pty, ioctls: list[int]) -> None:
    port = SerialPort(pty.path, LineSettings(rs485=True))
    for _ in range(2):
        port.open()
    port.close()
    # RTS would have some ports transmit
    assert ioctls and not {termios.TIOCMBIS, termios.TIOCMBIC, termios.TIOCMSET} & {*ioctls}


@pytest.fixture
def ioctls(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """What was requested of descriptors."""
    ioctl = fcntl.ioctl
    requests: list[int] = []

    def note(fd: int, request: int, *rest: object) -> object:
        requests.append(request)
        return ioctl(fd, request, *rest)  # type: ignore[call-overload]

    monkeypatch.setattr(fcntl, 'ioctl', note)
    return requests


def test_nothing_waits(pty: Pty, port: SerialPort, monkeypatch: pytest.MonkeyPatch) -> None:
    def waits(*_: object) -> None:
        pytest.fail('it waits')

    for module, name in ((termios, 'tcdrain'), (termios, 'tcsendbreak'), (time, 'sleep')):
        monkeypatch.setattr(module, name, waits)
    own = set(map(int, descriptors()))
    ours = {fd for fd in own if _is_at(fd, pty.path)} - {pty._near}
    assert ours and not any(map(os.get_blocking, ours))
    # more than a terminal takes, and never read
    with contextlib.suppress(BlockingIOError):
        while os.write(ours.copy().pop(), EVERY_BYTE):
            pass
    port.open()
    port.close()


def _is_at(fd: int, path: str) -> bool:
    with contextlib.suppress(OSError):
        return os.path.samestat(os.fstat(fd), os.stat(path))
    return False


def test_line_is_set_raw(pty: Pty) -> None:
    # another program has left echo and line editing on
    attributes = termios.tcgetattr(pty.far)
    attributes[0] |= termios.ICRNL | termios.IXON | termios.ISTRIP
    attributes[1] |= termios.OPOST | termios.ONLCR
    attributes[3] |= termios.ECHO | termios.ICANON | termios.ISIG
    termios.tcsetattr(pty.far, termios.TCSANOW, attributes)
    port = SerialPort(pty.path, LineSettings())
    port.open()
    os.write(pty.far, EVERY_BYTE)
    assert read(port, 256) == EVERY_BYTE
    port.write(EVERY_BYTE)
    assert pty.receive(256) == EVERY_BYTE
    port.close()


def test_bytes_from_before_are_not_read(pty: Pty) -> None:
    os.write(pty.far, b'old')
    port = SerialPort(pty.path, LineSettings())
    port.open()
    os.write(pty.far, b'new')
    assert read(port, 3) == b'new'
    port.close()


def test_rs485_is_best_effort(pty: Pty, ioctls: list[int]) -> None:
    port = SerialPort(pty.path, LineSettings(rs485=True))
    port.open()
    assert _TIOCGRS485 in ioctls and _TIOCSRS485 not in ioctls
    assert termios.tcgetattr(pty.far)[0] == termios.INPCK | termios.IGNPAR
    port.write(b'x')
    assert pty.receive(1) == b'x'
    port.close()


def test_rs485_is_switched_by_rts_and_keeps_the_delays_of_the_board(
    pty: Pty, monkeypatch: pytest.MonkeyPatch
) -> None:
    ioctl = fcntl.ioctl
    written: list[list[int]] = []

    def rs485(fd: int, request: int, *rest: object) -> object:
        if request not in (_TIOCGRS485, _TIOCSRS485):
            return ioctl(fd, request, *rest)  # type: ignore[call-overload]
        (settings,) = rest
        assert isinstance(settings, array.array)
        if request == _TIOCGRS485:
            settings[1:3] = array.array(settings.typecode, [2, 3])
        else:
            written.append(settings.tolist())
        return 0

    monkeypatch.setattr(fcntl, 'ioctl', rs485)
    port = SerialPort(pty.path, LineSettings(rs485=True))
    port.open()
    # SER_RS485_ENABLED and SER_RS485_RTS_ON_SEND (linux/serial.h)
    assert written == [[3, 2, 3, 0, 0, 0, 0, 0]]
    port.close()


def test_a_port_that_appears_while_it_is_opened(
    pty: Pty, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ioctls: list[int]
) -> None:
    name = tmp_path / 'simulated'
    stat = os.stat

    def before(path: object, *rest: object, **kwargs: object) -> object:
        try:
            return stat(path, *rest, **kwargs)  # type: ignore[call-overload]
        finally:
            if path == str(name) and not name.is_symlink():
                name.symlink_to(pty.path)

    monkeypatch.setattr(os, 'stat', before)
    port = SerialPort(str(name), LineSettings(char_format='8N1'))
    with pytest.raises(PortError, match='does not exist'):
        port.open()
    port.open()
    port.close()
    # else it would stay open to root alone
    assert ioctls and termios.TIOCEXCL not in ioctls


def test_absent_port_names_those_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    port = SerialPort('/dev/ttyNONE', LineSettings())
    monkeypatch.setattr(serial_port, '_ports', lambda: ['/dev/ttyACM0', '/dev/ttyUSB7'])
    with pytest.raises(PortError) as error:
        port.open()
    assert str(error.value) == (
        '/dev/ttyNONE does not exist: is the adapter plugged in? '
        'Ports found: /dev/ttyACM0, /dev/ttyUSB7'
    )
    monkeypatch.setattr(serial_port, '_ports', list)
    with pytest.raises(PortError, match='Ports found: none'):
        port.open()


def test_ports_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    folders = {
        '/dev': ['null', 'ttyUSB0', 'tty1', 'ttyACM3', 'ttyS0'],
        '/dev/serial/by-id': ['usb-FTDI'],
    }

    def listdir(folder: str) -> list[str]:
        # it is gone with the last adapter
        if folder not in folders:
            raise FileNotFoundError(folder)
        return folders[folder]

    path = SimpleNamespace(isdir=lambda _: True)
    monkeypatch.setattr(serial_port, 'os', SimpleNamespace(listdir=listdir, path=path))
    assert serial_port._ports() == ['/dev/serial/by-id/usb-FTDI', '/dev/ttyACM3', '/dev/ttyUSB0']
    del folders['/dev/serial/by-id']
    assert serial_port._ports() == ['/dev/ttyACM3', '/dev/ttyUSB0']


def test_what_is_no_serial_port(tmp_path: Path) -> None:
    before = descriptors()
    (tmp_path / 'file').write_text('')
    for path in (tmp_path / 'file', Path('/dev/null')):
        with pytest.raises(PortError, match=f'{path} is not a serial port'):
            SerialPort(str(path), LineSettings()).open()
    with pytest.raises(PortError, match='cannot be opened'):
        SerialPort(str(tmp_path), LineSettings()).open()
    assert descriptors() == before


@pytest.mark.parametrize(
    ('number', 'message'),
    [
        (errno.EACCES, 'no permission to use {}: add yourself to its group'),
        (errno.EBUSY, '{} is in use by another process'),
        (errno.EIO, '{} cannot be opened: Input/output error'),
    ],
)
def test_port_that_cannot_be_opened(
    pty: Pty, monkeypatch: pytest.MonkeyPatch, number: int, message: str
) -> None:
    def refuse(*_: object) -> int:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, 'open', refuse)
    with pytest.raises(PortError) as error:
        SerialPort(pty.path, LineSettings()).open()
    monkeypatch.undo()
    assert str(error.value).startswith(message.format(pty.path))


def test_port_in_use(pty: Pty, port: SerialPort) -> None:
    before = descriptors()
    second = SerialPort(pty.path, LineSettings())
    with pytest.raises(PortError, match=f'{pty.path} is in use by another process'):
        second.open()
    assert descriptors() == before
    # the first one is none the worse for it
    port.write(b'x')
    assert pty.receive(1) == b'x'
    port.close()
    second.open()
    second.close()


_HOLDS = """
import fcntl, os, sys
_, slave = os.openpty() if len(sys.argv) == 1 else (0, os.open(sys.argv[1], os.O_RDWR))
if len(sys.argv) > 1:
    fcntl.flock(slave, fcntl.LOCK_EX)
print(os.ttyname(slave), flush=True)
sys.stdin.read()
"""


def test_who_has_the_other_end_is_not_named_as_having_the_port() -> None:
    with contextlib.ExitStack() as stack:

        def start(*arguments: str) -> tuple[int, str]:
            command = [sys.executable, '-c', _HOLDS, *arguments]
            pipe = subprocess.PIPE
            process = stack.enter_context(subprocess.Popen(command, stdin=pipe, stdout=pipe))
            assert process.stdout is not None
            return process.pid, process.stdout.readline().decode().strip()

        simulator, path = start()
        holder, _ = start(path)
        with pytest.raises(PortError, match=rf'in use by .*\(pid {holder}\): end that') as error:
            SerialPort(path, LineSettings()).open()
        assert str(simulator) not in str(error.value).replace(path, '')


def test_a_pseudo_terminal_stays_open_to_others_than_root(pty: Pty, port: SerialPort) -> None:
    port.close()
    again = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    exclusive = array.array('i', [-1])
    fcntl.ioctl(again, _TIOCGEXCL, exclusive)
    os.close(again)
    assert exclusive[0] == 0


def test_port_locked_as_pyserial_does(pty: Pty) -> None:
    other = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    fcntl.flock(other, fcntl.LOCK_EX)
    os.write(pty.far, b'its own')
    modes = termios.tcgetattr(other)
    port = SerialPort(pty.path, LineSettings(baud_rate=2400))
    with pytest.raises(PortError, match='is in use by another process'):
        port.open()
    # what has it goes on as before
    assert termios.tcgetattr(other) == modes and os.read(other, 100) == b'its own'
    os.close(other)
    port.open()
    port.close()


def test_other_programs_find_it_in_use(pty: Pty, ioctls: list[int], no_pty: None) -> None:
    other = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    port = SerialPort(pty.path, LineSettings(char_format='8N1'))
    port.open()
    # those that look for a lock, and those that do not
    with pytest.raises(BlockingIOError):
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    assert termios.TIOCEXCL in ioctls
    fcntl.ioctl(other, termios.TIOCNXCL)
    os.close(other)
    port.close()


@pytest.fixture
def no_pty(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pseudo-terminal is treated as any other port."""
    monkeypatch.setattr(serial_port, '_is_pty', lambda _: False)


def test_a_port_by_another_name_that_goes_and_comes_back(pty: Pty, tmp_path: Path) -> None:
    # as udev does it with /dev/serial/by-id
    name = tmp_path / 'by-id'
    name.symlink_to(pty.path)
    port = SerialPort(str(name), LineSettings())
    port.open()
    before = descriptors()
    pty.hang_up()
    name.unlink()
    with pytest.raises(PortError, match=f'{name} was lost'):
        read(port, 1)
    with pytest.raises(PortError, match=f'{name} does not exist: is the adapter plugged in'):
        port.open()
    with pytest.raises(PortError, match='is not open'):
        port.write(b'x')
    assert len(descriptors()) < len(before)
    again = Pty()
    name.symlink_to(again.path)
    port.open()
    port.write(b'x')
    assert again.receive(1) == b'x'
    port.close()
    again.hang_up()


def test_adapter_that_cannot_do_the_settings(
    pty: Pty, monkeypatch: pytest.MonkeyPatch, no_pty: None
) -> None:
    def refuse(*_: object) -> None:
        raise termios.error(errno.EINVAL, 'Invalid argument')

    monkeypatch.setattr(serial_port.termios, 'tcsetattr', refuse)
    before = descriptors()
    with pytest.raises(PortError, match=r'cannot do 19200 bit/s 7O2 .* choose a rate and format'):
        SerialPort(pty.path, LineSettings(char_format='7O2')).open()
    assert descriptors() == before


@pytest.mark.parametrize(
    ('call', 'works'),
    [(call, works) for call in ('tcgetattr', 'tcsetattr', 'tcflush') for works in (0, 1)],
)
def test_adapter_that_goes_away_while_it_is_opened(
    pty: Pty, monkeypatch: pytest.MonkeyPatch, no_pty: None, call: str, works: int
) -> None:
    real = getattr(termios, call)
    left = [real] * works

    def gone(*arguments: object) -> object:
        if left:
            return left.pop()(*arguments)
        raise termios.error(errno.EIO, 'Input/output error')

    monkeypatch.setattr(termios, call, gone)
    before = descriptors()
    with pytest.raises(PortError, match=f'{pty.path} cannot be opened: Input/output') as error:
        SerialPort(pty.path, LineSettings(char_format='8N1')).open()
    # closed, although what failed is kept
    assert error.value and descriptors() == before


def test_port_that_cannot_be_locked(pty: Pty, monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object) -> None:
        raise OSError(errno.ENOLCK, 'No locks available')

    monkeypatch.setattr(serial_port.fcntl, 'flock', gone)
    with pytest.raises(PortError):
        SerialPort(pty.path, LineSettings()).open()


def test_hang_up_is_noticed(pty: Pty, port: SerialPort) -> None:
    pty.hang_up()
    with pytest.raises(PortError, match=f'{pty.path} was lost'):
        read(port, 1)
    with pytest.raises(PortError, match=f'{pty.path} was lost'):
        port.write(b'x')
    port.close()
    port.close()


def test_hang_up_while_waiting(pty: Pty, port: SerialPort) -> None:
    timer = threading.Timer(0.05, pty.hang_up)
    timer.start()
    with pytest.raises(PortError, match='was lost'):
        port.read(time.monotonic() + PATIENCE)
    timer.join()


def test_closed_port(pty: Pty) -> None:
    port = SerialPort(pty.path, LineSettings())
    for use in (lambda: port.write(b'x'), lambda: port.read(0.0)):
        with pytest.raises(PortError, match='is not open'):
            use()
    port.close()
    port.open()
    port.close()
    with pytest.raises(PortError, match='is not open'):
        port.read(0.0)


def test_long_write_in_parts(pty: Pty, port: SerialPort) -> None:
    data = EVERY_BYTE * 512
    got = bytearray()
    reader = threading.Thread(target=lambda: got.extend(pty.receive(len(data))))
    reader.start()
    port.write(data)
    reader.join(PATIENCE)
    assert bytes(got) == data


def test_write_that_takes_long_but_goes_on(
    pty: Pty, port: SerialPort, monkeypatch: pytest.MonkeyPatch
) -> None:
    # one byte a call, half a second each
    clock = iter(range(10_000))
    monkeypatch.setattr(
        serial_port, 'time', SimpleNamespace(monotonic=lambda: next(clock) * 0.5)
    )
    write = os.write
    monkeypatch.setattr(serial_port.os, 'write', lambda fd, data: write(fd, data[:1]))
    port.write(b'slowly')
    monkeypatch.undo()
    assert pty.receive(6) == b'slowly'


def test_port_that_takes_nothing(
    port: SerialPort, monkeypatch: pytest.MonkeyPatch, discarded: list[int]
) -> None:
    def full(*_: object) -> int:
        raise BlockingIOError

    monkeypatch.setattr(serial_port.os, 'write', full)
    monkeypatch.setattr(serial_port.select, 'select', lambda *_: ([], [], []))
    with pytest.raises(PortError, match='takes no more bytes'):
        port.write(b'x')
    # else Linux would wait for it for half a minute when the port is closed
    assert discarded


@pytest.fixture
def discarded(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The descriptors of which was discarded what had not left."""
    flush = termios.tcflush
    discarded: list[int] = []

    def note(fd: int, queue: int) -> None:
        if queue == termios.TCOFLUSH:
            discarded.append(fd)
        flush(fd, queue)

    monkeypatch.setattr(serial_port.termios, 'tcflush', note)
    return discarded


def test_an_open_port_is_opened_again(pty: Pty, port: SerialPort, discarded: list[int]) -> None:
    before = descriptors()
    os.write(pty.far, b'before')
    port.open()
    assert descriptors() == before and len(discarded) == 1
    port.write(b'now')
    assert pty.receive(3) == b'now'
    os.write(pty.far, b'x')
    assert read(port, 1) == b'x'


def test_what_took_a_port_that_is_opened_again_is_named(
    pty: Pty, port: SerialPort, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[int] = []

    def close(fd: int) -> None:
        os_close(fd)
        if not taken:
            taken.append(os.open(pty.path, os.O_RDWR | os.O_NOCTTY))
            fcntl.flock(taken[0], fcntl.LOCK_EX)

    os_close = os.close
    monkeypatch.setattr(serial_port.os, 'close', close)
    try:
        with pytest.raises(PortError, match=r'is in use by .*: end that first'):
            port.open()
    finally:
        monkeypatch.undo()
        os.close(taken[0])
    port.open()


# --- ports reached by URL -------------------------------------------------------------------------


#: More than a client receives that does not read, and less than can be handed over, bytes.
_MUCH = 1_000_000


class Server:
    """A serial device server on this machine that takes one client after another."""

    def __init__(self) -> None:
        self.listener = socket.create_server(('127.0.0.1', 0))
        self.listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self.listener.settimeout(PATIENCE)
        self.url = f'socket://127.0.0.1:{self.listener.getsockname()[1]}'
        self.client: socket.socket | None = None

    def accept(self) -> socket.socket:
        self.client, _ = self.listener.accept()
        self.client.settimeout(PATIENCE)
        return self.client

    def close(self) -> None:
        self.listener.close()
        if self.client is not None:
            self.client.close()


@pytest.fixture
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.close()


def received(client: socket.socket, count: int) -> bytes:
    data = b''
    while len(data) < count:
        data += client.recv(4096)
    return data


def test_bytes_go_both_ways_over_tcp(server: Server) -> None:
    port = UrlPort(server.url, LineSettings())
    port.open()
    client = server.accept()
    port.write(EVERY_BYTE)
    assert received(client, 256) == EVERY_BYTE
    client.sendall(EVERY_BYTE)
    assert read(port, 256) == EVERY_BYTE
    port.close()
    port.close()
    assert client.recv(1) == b''


def test_an_open_connection_is_made_anew(server: Server) -> None:
    port = UrlPort(server.url, LineSettings())
    port.open()
    old = server.accept()
    port.write(bytes(_MUCH))
    port.open()
    # what has not arrived never does
    arrived = 0
    with contextlib.suppress(ConnectionResetError):
        while some := old.recv(4096):
            arrived += len(some)
    assert arrived < _MUCH
    old.close()
    new = server.accept()
    port.write(b'now')
    assert received(new, 3) == b'now'
    new.sendall(b'x')
    assert read(port, 1) == b'x'
    port.close()


def test_a_server_for_one_client_is_told_as_that(server: Server) -> None:
    port = UrlPort(server.url, LineSettings())
    port.open()
    server.accept().close()
    with pytest.raises(PortError, match=r'was lost .*serves one client at a time and another has'):
        read(port, 1)
    server.close()
    with pytest.raises(PortError, match=r'refused.*serves one client at a time and another has it'):
        port.open()


def test_read_over_tcp_gives_up_when_its_time_is_over(server: Server) -> None:
    port = UrlPort(server.url, LineSettings())
    port.open()
    start = time.monotonic()
    assert port.read(start + 0.02) == b''
    assert time.monotonic() >= start + 0.02
    assert port.read(start - 5) == b''
    port.close()


def test_device_server_that_is_not_there(server: Server) -> None:
    server.close()
    port = UrlPort(server.url, LineSettings())
    with pytest.raises(PortError, match=f'{server.url} cannot be opened .*refused.*switched on'):
        port.open()
    with pytest.raises(PortError, match='is not open'):
        port.write(b'x')


@pytest.mark.parametrize(
    ('url', 'why'),
    [
        ('foo://127.0.0.1:1', 'there is no foo:// here; write socket://host:port'),
        ('://x', 'write socket://host:port'),
        ('socket://127.0.0.1', 'lacks a host or a port.*write socket://host:port'),
        ('socket://:4001', 'lacks a host'),
        ('socket://127.0.0.1:x', 'lacks a host or a port'),
        ('socket://127.0.0.1:0', '1 to 65535'),
        ('rfc2217://127.0.0.1:65536', '1 to 65535'),
        ('socket://127.0.0.1:1?fast', r"omit '\?fast', which is no option of socket://"),
        ('rfc2217://127.0.0.1:1?timeout=x', r"omit '\?timeout=x'"),
    ],
)
def test_url_that_can_lead_nowhere_is_refused_at_once(url: str, why: str) -> None:
    with pytest.raises(ValueError, match=f'^port {re.escape(repr(url))}.*{why}'):
        open_link('modbus_rtu', url, LineSettings())


@pytest.mark.parametrize(
    'url', ['RFC2217://server:1?ign_set_control', 'spy:///dev/null', 'hwgrep://not there']
)
def test_url_that_may_lead_somewhere_is_not_refused(url: str) -> None:
    open_link('modbus_rtu', url, LineSettings())


@pytest.mark.parametrize('port', ['10.0.0.1:502', 'server:4001', '[::1]:1'])
def test_host_and_port_without_a_kind_of_url_are_refused_with_the_kind(port: str) -> None:
    with pytest.raises(ValueError, match=f'^port .*write socket://{re.escape(port)} for'):
        open_link('modbus_rtu', port, LineSettings())


def test_a_device_without_its_folder_is_refused_with_the_whole_path() -> None:
    with pytest.raises(PortError, match=r'ttyNone does not exist: should it be /dev/ttyNone\?'):
        SerialPort('ttyNone', LineSettings()).open()


def test_no_port() -> None:
    with pytest.raises(ValueError, match='port is empty'):
        open_link('modbus_rtu', '', LineSettings())


def test_device_server_that_goes_away(server: Server) -> None:
    port = UrlPort(server.url, LineSettings())
    port.open()
    server.accept().close()
    with pytest.raises(PortError, match=f'{server.url} was lost'):
        read(port, 1)
    port.close()
    # and comes back
    port.open()
    server.accept().sendall(b'again')
    assert read(port, 5) == b'again'
    port.close()


def test_write_to_a_device_server_that_goes_away(server: Server) -> None:
    port = UrlPort(server.url, LineSettings())
    port.open()
    server.accept().close()
    deadline = time.monotonic() + PATIENCE
    with pytest.raises(PortError, match=f'{server.url} was lost'):
        # the first write may still go out: the other side's farewell takes its time
        while time.monotonic() < deadline:
            port.write(b'x')
    port.close()


# --- the whole link -------------------------------------------------------------------------------


def answer_one_read(far: int | socket.socket) -> None:
    fd = far if isinstance(far, int) else far.fileno()
    request = encode(Read(1, 0x2A5, 1))
    data = b''
    while len(data) < len(request):
        assert select.select([fd], [], [], PATIENCE)[0]
        data += os.read(fd, 100)
    assert data == request
    body = b'\x01\x03\x02\x00\x25'
    os.write(fd, body + crc(body))


def test_link_over_a_serial_port(pty: Pty) -> None:
    link = open_link('modbus_rtu', pty.path, LineSettings(response_timeout=10))
    link.open()
    drive = threading.Thread(target=answer_one_read, args=(pty.far,))
    drive.start()
    assert link.read(1, register(0x2A5)).data == packed(37)
    drive.join()
    link.close()


def test_link_over_tcp(server: Server) -> None:
    link = open_link('modbus_rtu', server.url, LineSettings(response_timeout=10))
    link.open()
    drive = threading.Thread(target=answer_one_read, args=(server.accept(),))
    drive.start()
    assert link.read(1, register(0x2A5)).data == packed(37)
    drive.join()
    link.close()
