# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

from contextlib import contextmanager
import os
from pathlib import Path
import select
import shutil
import tempfile
import time
import tty

import pytest
from support.addresses import packed, words_of

from nfo_sinus_driver.simulator import pymodbus_compat
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.memory import Refused
from nfo_sinus_driver.simulator.modbus import server

#: How long an answer of known length is waited for on the slowest machine, one of any length, s.
PATIENCE, SOON = 60.0, 2.0
#: Longer than any answer.
MOST = 256


#: The run command of a Sinus, and its set-point in Frequency mode.
KEYS = {
    'sinus_g2': ('fieldbus.scmd', 'status.frq_set'),
    'sinus_optimal': ('fieldbus.smode', 'fieldbus.input_freq_setpoint'),
}


class Bench:
    """A Sinus on the bench: commands by name, and time that passes by command."""

    def __init__(self, model='sinus_g2', **options):
        self.drive = simulated_drive(model, **options)
        self._command, self._setpoint = KEYS[model]

    def write(self, key, value):
        parameter = self.drive.model[key]
        words = words_of(parameter.encode(value))
        server(self.drive).write(parameter.at('modbus').index, words)

    def read(self, key):
        parameter = self.drive.model[key]
        place = parameter.at('modbus')
        words = server(self.drive).read(place.index, place.codec.size // 2)
        return parameter.decode(packed(*words))

    def mode(self, code):
        self.write('fieldbus.mode', code)

    def scmd(self, code):
        self.write(self._command, code)

    def setpoint(self, hertz):
        self.write(self._setpoint, hertz)

    def run(self, setpoint, seconds=0.0):
        """Take control, run by the bus, and let time pass."""
        self.mode(3)
        self.setpoint(setpoint)
        self.scmd(0x101)
        self.drive.advance(seconds)

    @contextmanager
    def refuses(self, reason):
        """Expect that the drive refuses what happens in this block, and why."""
        with pytest.raises(Refused) as caught:
            yield
        assert caught.value.reason is reason

    @property
    def state(self):
        return self.drive.control_unit.state

    @property
    def inv_st(self):
        return self.read('fieldbus.inv_st')

    def shown(self, seconds=0.0):
        """The inverter status after a time."""
        self.drive.advance(seconds)
        return self.inv_st

    @property
    def running(self):
        return self.drive.motor.driven


class Master:
    """The other end of a line: writes requests and reads what comes back."""

    def __init__(self, port):
        self.fd = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.fd)

    def close(self):
        os.close(self.fd)

    def send(self, data):
        os.write(self.fd, data)

    def receive(self, count=None, timeout=None):
        """Return ``count`` bytes, or what came within the time; of an unknown number soon."""
        timeout = timeout or (PATIENCE if count else SOON)
        count = count or MOST
        data = b''
        end = time.monotonic() + timeout
        while len(data) < count:
            ready, _, _ = select.select([self.fd], [], [], max(0.0, end - time.monotonic()))
            if not ready:
                break
            data += os.read(self.fd, 4096)
        return data

    def ask(self, address, pdu, count=None, timeout=None):
        self.send(frame(address, pdu))
        return self.receive(count, timeout)


def frame(address, pdu):
    body = bytes([address]) + bytes(pdu)
    return body + pymodbus_compat.crc(body)


@pytest.fixture
def bench():
    return Bench()


@pytest.fixture
def make_bench():
    return Bench


@pytest.fixture
def make_frame():
    return frame


@pytest.fixture
def open_master():
    masters = []

    def open_(port):
        masters.append(Master(port))
        return masters[-1]

    yield open_
    for master in masters:
        master.close()


@pytest.fixture
def folder():
    """A folder with a short name: the path of a Unix socket has 107 characters at most."""
    path = Path(tempfile.mkdtemp(prefix='sim'))
    yield path
    shutil.rmtree(path)
