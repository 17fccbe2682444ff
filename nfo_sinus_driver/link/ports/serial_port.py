# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A serial port: pyserial opens, locks and sets it; its descriptor is read and written here."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from pathlib import Path
import select
import termios
import time

import serial
from serial.rs485 import RS485Settings

from nfo_sinus_driver.link.interface import LineSettings, PortError
from nfo_sinus_driver.link.ports.place import place_of_tty

#: Device numbers of pseudo-terminals, which have no parity and no seven bits.
_PTY_MAJORS = range(136, 144)
#: The device that a process with the other end of one has open.
_PTMX = os.makedev(5, 2)

#: What pyserial sets of how characters are sent and received.
_FORMAT_AND_RATE = (
    termios.CBAUD | termios.CSIZE | termios.CSTOPB | termios.PARENB | termios.PARODD
    | termios.CREAD | termios.CLOCAL
)

_READ_SIZE = 512


class _Serial(serial.Serial):
    """A port of pyserial, whose modem lines stay as the system sets them when it is opened."""

    def _update_rts_state(self) -> None:
        # pyserial sets both; with RTS some kernels turn on the transmitter of an RS-485 port
        return

    _update_dtr_state = _update_rts_state


class SerialPort:
    """One serial port, non-blocking."""

    def __init__(self, path: str, settings: LineSettings) -> None:
        self._path = path
        self._settings = settings
        self._port: _Serial | None = None
        self.place = ''

    def open(self) -> None:
        """
        Open the port, lock it and configure it; one that is open is closed before.

        Its modem lines stay as they are meanwhile, for they reset some adapters.

        :raises PortError: absent, not permitted, in use, or unable to do the settings.
        """
        self._discard()
        self.close()
        settings = self._settings
        port = _Serial(baudrate=settings.baud_rate, stopbits=settings.stop_bits, exclusive=True)
        port.port = self._path
        try:
            pty = _is_pty(self._path)
            # the C library compares what it set with the result
            port.bytesize = 8 if pty else settings.data_bits
            port.parity = 'N' if pty else settings.parity
            port.open()
            if not pty:
                # the lock of pyserial stops those alone that look for it. A pseudo-terminal would
                # keep this when closed, and then open for root alone
                fcntl.ioctl(port.fileno(), termios.TIOCEXCL)
            self._complete(port)
        except BaseException as error:
            port.close()
            if isinstance(error, (OSError, ValueError, termios.error)):
                raise self._not_opened(error) from error
            raise
        self._port = port
        self.place = self._place(port.fileno())

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

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

    def _place(self, fd: int) -> str:
        device = os.fstat(fd).st_rdev
        if os.major(device) in _PTY_MAJORS:
            return self._path if os.path.islink(self._path) else ''
        return place_of_tty(device)

    def _discard(self) -> None:
        """Discard what has not left: it must not leave later, and closing would wait for it."""
        if self._port is not None:
            with contextlib.suppress(termios.error):
                self._port.reset_output_buffer()

    @staticmethod
    def _write_some(fd: int, data: bytes) -> int:
        try:
            return os.write(fd, data)
        except BlockingIOError:
            return 0

    def _descriptor(self) -> int:
        if self._port is None:
            raise PortError(f'{self._path} is not open')
        fd: int = self._port.fileno()
        return fd

    def _lost(self, error: OSError) -> PortError:
        return PortError(f'{self._path} was lost ({error.strerror}): is the adapter unplugged?')

    def _complete(self, port: _Serial) -> None:
        """Do what pyserial does not, or does not do everywhere."""
        # best effort: pseudo-terminals and some adapters do not support it
        with contextlib.suppress(ValueError):
            # an FTDI adapter holds answers back for 16 ms without
            port.set_low_latency_mode(True)
        if self._settings.rs485:
            # best effort: most adapters switch by themselves and do not support it
            with contextlib.suppress(ValueError):
                port.rs485_mode = RS485Settings()
        # pyserial leaves what it does not know as an earlier program set it, such as a rate of its
        # own to receive at
        _, _, cflag, _, *rates_and_characters = termios.tcgetattr(port.fileno())
        # a byte with wrong parity is dropped, so that the frame is too short to count; pyserial
        # passes it on. A break empties no queue
        iflag = termios.INPCK | termios.IGNPAR if self._settings.parity != 'N' else 0
        # without HUPCL, for closing it would have the modem lines fall
        modes = [iflag, 0, cflag & _FORMAT_AND_RATE, 0, *rates_and_characters]
        termios.tcsetattr(port.fileno(), termios.TCSANOW, modes)
        # what an earlier program has written must not leave now
        termios.tcflush(port.fileno(), termios.TCIOFLUSH)

    def _not_opened(self, error: OSError | ValueError | termios.error) -> PortError:
        """Return why the port was not opened, and what to do."""
        path, settings = self._path, self._settings
        # pyserial has the error of the system in its sentence
        wraps = isinstance(error, (serial.SerialException, ValueError))
        cause = error.__context__ if wraps and error.__context__ else error
        number, reason = cause.args[0], cause.args[-1]
        if number == errno.ENOENT:
            whole = path.startswith('/')
            remedy = 'is the adapter plugged in?' if whole else f'should it be /dev/{path}?'
            found = ', '.join(_ports()) or 'none'
            return PortError(f'{path} does not exist: {remedy} Ports found: {found}')
        if number in (errno.EACCES, errno.EPERM):
            return PortError(
                f'no permission to use {path}: add yourself to its group '
                '(often: sudo usermod -aG dialout $USER, then log in again)'
            )
        if number in (errno.EBUSY, errno.EAGAIN):
            return _busy(path)
        if number == errno.ENOTTY:
            return PortError(f'{path} is not a serial port')
        if number == errno.EINVAL:
            return PortError(
                f'{path} cannot do {settings.baud_rate} bit/s {settings.char_format} ({reason}): '
                'choose a rate and format that the adapter has'
            )
        return PortError(f'{path} cannot be opened: {reason}')


def _busy(path: str) -> PortError:
    who = ', '.join(holders(path)) or 'another process'
    return PortError(f'{path} is in use by {who}: end that first, or choose another port')


def _ports() -> list[str]:
    by_id = '/dev/serial/by-id'
    try:
        names = [f'{by_id}/{name}' for name in os.listdir(by_id)]
    except OSError:
        # it comes with the first adapter, and goes with the last
        names = []
    prefixes = ('ttyUSB', 'ttyACM', 'ttyAMA')
    names += [f'/dev/{name}' for name in os.listdir('/dev') if name.startswith(prefixes)]
    return sorted(names)


def _is_pty(path: str) -> bool:
    return os.major(os.stat(path).st_rdev) in _PTY_MAJORS


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
