# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A serial port as a raw descriptor: exclusive, configured, read without delay."""

from __future__ import annotations

import array
import contextlib
import errno
import fcntl
import os
from pathlib import Path
import select
import struct
import termios
import time

from nfo_sinus_driver.link.interface import LineSettings, PortError

# Linux ioctls that Python's termios module lacks
_TIOCGSERIAL = 0x541E
_TIOCSSERIAL = 0x541F
_TIOCGRS485 = 0x542E
_TIOCSRS485 = 0x542F
_ASYNC_LOW_LATENCY = 1 << 13
_SER_RS485_ENABLED = 1 << 0
_SER_RS485_RTS_ON_SEND = 1 << 1
#: The flags are the fifth int of struct serial_struct.
_SERIAL_STRUCT_INTS = 20
_SERIAL_FLAGS = 4
_RS485_STRUCT_INTS = 8
#: Device numbers of pseudo-terminals, which have no parity and no baud rate to set.
_PTY_MAJORS = range(136, 144)
#: The device that a process with the other end of one has open.
_PTMX = os.makedev(5, 2)

_READ_SIZE = 512


class SerialPort:
    """One serial port, non-blocking."""

    def __init__(self, path: str, settings: LineSettings) -> None:
        self._path = path
        self._settings = settings
        self._fd: int | None = None

    def open(self) -> None:
        """
        Open the port, lock it and configure it; one that is open is closed before.

        Its modem lines stay as they are meanwhile, for they reset some adapters.

        :raises PortError: absent, not permitted, in use, or unable to do the settings.
        """
        self._discard()
        self.close()
        fd = _open_device(self._path)
        try:
            self._lock(fd)
            self._configure(fd)
            _prefer_low_latency(fd)
            if self._settings.rs485:
                _switch_transmitter_by_port(fd)
            termios.tcflush(fd, termios.TCIOFLUSH)
        except BaseException as error:
            os.close(fd)
            if isinstance(error, (OSError, termios.error)):
                raise PortError(f'{self._path} cannot be opened: {error.args[-1]}') from error
            raise
        self._fd = fd

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""
        fd, self._fd = self._fd, None
        if fd is not None:
            os.close(fd)

    def write(self, data: bytes) -> None:
        """Hand all bytes to the port (PortError: the port is gone)."""
        fd = self._descriptor()
        deadline = time.monotonic() + 1.0
        try:
            while data:
                data = data[self._write_some(fd, data) :]
                wait = max(0.0, deadline - time.monotonic())
                if data and not select.select((), (fd,), (), wait)[1]:
                    self._discard()
                    raise PortError(f'{self._path} takes no more bytes: is the adapter stuck?')
        except OSError as error:
            raise self._lost(error) from error

    def read(self, until: float) -> bytes:
        """Return what has come, or nothing; wait for the first byte until a moment."""
        fd = self._descriptor()
        try:
            if not select.select((fd,), (), (), max(0.0, until - time.monotonic()))[0]:
                return b''
            data = os.read(fd, _READ_SIZE)
        except BlockingIOError:
            return b''
        except OSError as error:
            raise self._lost(error) from error
        if not data:
            raise self._lost(OSError(errno.EIO, 'end of file'))
        return data

    def _discard(self) -> None:
        """Discard what has not left: it must not leave later, and closing would wait for it."""
        if self._fd is not None:
            with contextlib.suppress(termios.error):
                termios.tcflush(self._fd, termios.TCOFLUSH)

    @staticmethod
    def _write_some(fd: int, data: bytes) -> int:
        try:
            return os.write(fd, data)
        except BlockingIOError:
            return 0

    def _descriptor(self) -> int:
        if self._fd is None:
            raise PortError(f'{self._path} is not open')
        return self._fd

    def _lost(self, error: OSError) -> PortError:
        return PortError(f'{self._path} was lost ({error.strerror}): is the adapter unplugged?')

    def _lock(self, fd: int) -> None:
        try:
            # pyserial and other masters check flock; TIOCEXCL stops those that do not
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise _busy(self._path) from None
        if not _is_pty(fd):
            # a pseudo-terminal would keep it when closed, and then open for root alone
            fcntl.ioctl(fd, termios.TIOCEXCL)

    def _configure(self, fd: int) -> None:
        settings = self._settings
        rate = getattr(termios, f'B{settings.baud_rate}')
        cflag = termios.CREAD | termios.CLOCAL
        cflag |= termios.CS7 if settings.data_bits == 7 else termios.CS8
        if settings.parity != 'N':
            cflag |= termios.PARENB
        if settings.parity == 'O':
            cflag |= termios.PARODD
        if settings.stop_bits == 2:
            cflag |= termios.CSTOPB
        # a byte with wrong parity is dropped, so that the frame is too short to count
        iflag = termios.INPCK | termios.IGNPAR if settings.parity != 'N' else 0
        cc = termios.tcgetattr(fd)[6]
        cc[termios.VMIN] = 0
        cc[termios.VTIME] = 0
        try:
            termios.tcsetattr(fd, termios.TCSANOW, [iflag, 0, cflag, 0, rate, rate, cc])
        except termios.error as error:
            # the C library compares what it set with the result, and a pseudo-terminal has neither
            # parity nor seven bits
            if not _is_pty(fd):
                raise PortError(
                    f'{self._path} cannot do {settings.baud_rate} bit/s {settings.char_format} '
                    f'({error.args[-1]}): choose a rate and format that the adapter has'
                ) from error


def _open_device(path: str) -> int:
    try:
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except FileNotFoundError:
        whole = path.startswith('/')
        remedy = 'is the adapter plugged in?' if whole else f'should it be /dev/{path}?'
        raise PortError(
            f'{path} does not exist: {remedy} Ports found: {", ".join(_ports()) or "none"}'
        ) from None
    except PermissionError:
        raise PortError(
            f'no permission to use {path}: add yourself to its group '
            '(often: sudo usermod -aG dialout $USER, then log in again)'
        ) from None
    except OSError as error:
        if error.errno == errno.EBUSY:
            raise _busy(path) from None
        raise PortError(f'{path} cannot be opened: {error.strerror}') from error
    if not os.isatty(fd):
        os.close(fd)
        raise PortError(f'{path} is not a serial port')
    return fd


def _busy(path: str) -> PortError:
    who = ', '.join(holders(path)) or 'another process'
    return PortError(f'{path} is in use by {who}: end that first, or choose another port')


def _ports() -> list[str]:
    by_id = '/dev/serial/by-id'
    names = [f'{by_id}/{name}' for name in os.listdir(by_id)] if os.path.isdir(by_id) else []
    prefixes = ('ttyUSB', 'ttyACM', 'ttyAMA')
    names += [f'/dev/{name}' for name in os.listdir('/dev') if name.startswith(prefixes)]
    return sorted(names)


def _is_pty(fd: int) -> bool:
    return os.major(os.fstat(fd).st_rdev) in _PTY_MAJORS


def _prefer_low_latency(fd: int) -> None:
    """Request low latency; without it an FTDI adapter holds answers back for 16 ms."""
    settings = array.array('i', [0] * _SERIAL_STRUCT_INTS)
    try:
        fcntl.ioctl(fd, _TIOCGSERIAL, settings)
        settings[_SERIAL_FLAGS] |= _ASYNC_LOW_LATENCY
        fcntl.ioctl(fd, _TIOCSSERIAL, settings)
    except OSError:
        # best effort: pseudo-terminals and some adapters do not support it
        return


def _switch_transmitter_by_port(fd: int) -> None:
    """Let the port's driver switch the RS-485 transmitter with RTS, if it can."""
    settings = array.array('I', struct.unpack('8I', bytes(4 * _RS485_STRUCT_INTS)))
    try:
        fcntl.ioctl(fd, _TIOCGRS485, settings)
        settings[0] |= _SER_RS485_ENABLED | _SER_RS485_RTS_ON_SEND
        fcntl.ioctl(fd, _TIOCSRS485, settings)
    except OSError:
        # best effort: most adapters switch by themselves and do not support it
        return


def holders(path: str) -> list[str]:
    """
    Return the other processes that have a device open, ``name (pid 123)``, as far as visible.

    Of a pseudo-terminal not those at its other end, such as a simulator.
    """
    try:
        device = os.stat(path).st_rdev
    except OSError:
        return []
    found = []
    for process in Path('/proc').iterdir():
        other = process.name.isdigit() and int(process.name) != os.getpid()
        if other and _has_open(process, device) and not _is_behind(process, device):
            found.append(f'{_name(process)} (pid {process.name})')
    return sorted(found)


def _has_open(process: Path, device: int) -> bool:
    try:
        descriptors = list((process / 'fd').iterdir())
    except OSError:
        # ended meanwhile, or not permitted
        return False
    return any(_device(descriptor) == device for descriptor in descriptors)


def _is_behind(process: Path, device: int) -> bool:
    return os.major(device) in _PTY_MAJORS and _has_open(process, _PTMX)


def _device(descriptor: Path) -> int | None:
    try:
        return descriptor.stat().st_rdev or None
    except OSError:
        return None


def _name(process: Path) -> str:
    """Return the command without its folder; of a script, the script and not its interpreter."""
    try:
        words = (process / 'cmdline').read_bytes().split(b'\0')
    except OSError:
        return 'a process'
    names = [os.path.basename(word.decode(errors='replace')) for word in words if word]
    if len(names) > 1 and names[0].startswith('python'):
        script = names[2] if names[1] == '-m' and len(names) > 2 else names[1]
        return names[0] if script.startswith('-') else script
    return names[0] if names else 'a process'
