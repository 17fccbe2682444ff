# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The Classic link on real ports: pseudo-terminals, with a drive in a thread at the other end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import os
import select
import threading
import time
import tty

import classic_far_end as far
from classic_link_bench import know_g2
import pytest
from support.addresses import classic_id, packed

from nfo_sinus_driver.link import BusSettings
from nfo_sinus_driver.link.classic import ClassicLink
from nfo_sinus_driver.link.interface import DamagedAnswer, LinkError, NoAnswer, PortError, Refused

#: Longer than any drive here takes to answer, on any machine, s.
PATIENT = 10.0
#: For those that never answer, s.
SHORT = 0.05

SPEED = classic_id(0x94)
SETPOINT = classic_id(0x1E)
OP_TIME = classic_id(0x27, 0x127)
INV_ST = classic_id(far.INV_ST)
MODE = classic_id(0x29)


class PtyDrive:
    """
    A drive with address 1 at the far end of a pseudo-terminal.

    :ivar values: its parameters.
    :ivar limits: the greatest value that it takes.
    :ivar serial_control: what is wrong with a request is a serial fault.
    :ivar answer: how it sends an answer; to be replaced.
    :ivar asked: what was read, and what was written.
    """

    def __init__(self) -> None:
        self.end, self._near = os.openpty()
        tty.setraw(self._near)
        self.path = os.ttyname(self._near)
        self.values = {0x94: 1450, 0x1E: 0, 0x27: 0xFFFE, 0x127: 2, far.INV_ST: 37, 0x29: 3}
        self.limit = 1500
        self.serial_control = False
        self.flags = 0
        self.echo = False
        self.answer: Callable[[bytes], None] = self.send
        self.asked: list[tuple[int, int | None]] = []
        self._thread = threading.Thread(target=self._work)
        self._stop, self._stopped = os.pipe()
        self._thread.start()

    def close(self) -> None:
        os.write(self._stopped, b'x')
        self._thread.join()
        for fd in (self.end, self._near, self._stop, self._stopped):
            os.close(fd)

    def send(self, data: bytes) -> None:
        os.write(self.end, data)

    def _work(self) -> None:
        buffer = b''
        while self._stop not in (ready := select.select([self.end, self._stop], [], [])[0]):
            assert ready
            data = os.read(self.end, 100)
            if self.echo:
                self.send(data)
            buffer += data
            while match := far.REQUEST.search(buffer):
                buffer = buffer[match.end() :]
                self._obey(*far.parsed(match[0]))

    def _obey(self, unit: int, number: int, word: int | None) -> None:
        self.asked.append((number, word))
        if unit not in (0, 1, 95):
            return
        if word is None:
            answer = self._value(number)
        elif self._takes(number, word):
            self.values[number] = word
            answer = far.verdict(1, True)
        else:
            answer = far.verdict(1, False)
            if self.serial_control:
                self.flags |= 1 << 10
                self.values[far.INV_ST] = 14
        if unit != 95:
            self.answer(answer)

    def _value(self, number: int) -> bytes:
        if number == far.SIO_ERR:
            word, self.flags = self.flags, 0
            self.values[far.INV_ST] = 24
            return far.reply(1, number, word)
        known = number in self.values
        return far.reply(1, number, self.values[number]) if known else far.verdict(1, False)

    def _takes(self, number: int, word: int) -> bool:
        return number in self.values and word <= self.limit and self.values[far.INV_ST] > 23


@pytest.fixture
def drive() -> Iterator[PtyDrive]:
    drive = PtyDrive()
    yield drive
    drive.close()


def connect(drive: PtyDrive, timeout: float = PATIENT, char_format: str = '') -> ClassicLink:
    link = BusSettings(
        drive.path, 'classic', char_format=char_format, response_timeout=timeout
    ).open()
    assert isinstance(link, ClassicLink)
    know_g2(link)
    link.open()
    return link


@pytest.fixture
def link(drive: PtyDrive) -> Iterator[ClassicLink]:
    link = connect(drive)
    yield link
    link.close()


@pytest.fixture
def hasty(drive: PtyDrive) -> Iterator[ClassicLink]:
    link = connect(drive, SHORT)
    yield link
    link.close()


def test_the_factory_setting_is_that_of_the_drive() -> None:
    settings = BusSettings(protocol='classic').line
    assert (settings.baud_rate, settings.char_format) == (9600, '7E1')


@pytest.mark.parametrize('unit', [0, 1])
def test_read_and_write(drive: PtyDrive, link: ClassicLink, unit: int) -> None:
    assert link.read(unit, SPEED).data == packed(1450)
    assert link.write(unit, SETPOINT, packed(500)).data == b''
    assert link.read(unit, SETPOINT).data == packed(500)
    words = [link.read(unit, part).data for part in link.protocol.parts(OP_TIME)]
    assert words == [packed(0xFFFE), packed(2)]
    assert drive.asked[-2:] == [(0x27, None), (0x127, None)]


@pytest.mark.parametrize('char_format', ClassicLink.protocol.char_formats)
def test_every_format(drive: PtyDrive, char_format: str) -> None:
    link = connect(drive, char_format=char_format)
    assert link.read(1, SPEED).data == packed(1450)
    link.close()


def test_refused_value(drive: PtyDrive, link: ClassicLink) -> None:
    with pytest.raises(Refused, match='does not accept this value') as raised:
        link.write(1, SETPOINT, packed(1501))
    assert raised.value.code == Refused.ILLEGAL_VALUE
    assert [number for number, _ in drive.asked] == [0x1E, far.INV_ST]
    assert link.read(1, SPEED).data == packed(1450)


def test_refused_value_under_serial_control(drive: PtyDrive, link: ClassicLink) -> None:
    drive.serial_control = True
    link.read(1, INV_ST)
    with pytest.raises(Refused, match='out of range') as raised:
        link.write(1, SETPOINT, packed(1501))
    assert raised.value.code == Refused.ILLEGAL_VALUE
    assert link.read(1, INV_ST).data == packed(24)


def test_a_standing_fault_stays(drive: PtyDrive, link: ClassicLink) -> None:
    drive.values[far.INV_ST] = 14
    link.read(1, INV_ST)
    with pytest.raises(Refused, match='a serial fault') as raised:
        link.write(1, SETPOINT, packed(1))
    assert raised.value.code == Refused.DEVICE_FAILURE
    assert drive.values[far.INV_ST] == 14


def test_no_such_parameter(drive: PtyDrive, link: ClassicLink) -> None:
    with pytest.raises(Refused) as raised:
        link.read(1, classic_id(0x1234))
    assert raised.value.code == Refused.ILLEGAL_ADDRESS


def test_broadcast(drive: PtyDrive, link: ClassicLink) -> None:
    link.write(95, MODE, packed(1))
    assert link.read(1, MODE).data == packed(1)


def test_echo(drive: PtyDrive, link: ClassicLink) -> None:
    drive.echo = True
    test_read_and_write(drive, link, 1)
    test_broadcast(drive, link)


def test_answer_byte_by_byte(drive: PtyDrive, link: ClassicLink) -> None:
    drive.answer = lambda data: [drive.send(bytes((byte,))) for byte in data] and None
    assert link.read(1, SPEED).data == packed(1450)
    link.write(1, SETPOINT, packed(5))


def test_no_unit_there(hasty: ClassicLink) -> None:
    with pytest.raises(NoAnswer):
        hasty.read(2, SPEED)
    with pytest.raises(NoAnswer):
        hasty.write(2, SETPOINT, packed(1))


@pytest.mark.parametrize('late', [1.5, 3.0])
def test_late_answer(drive: PtyDrive, hasty: ClassicLink, late: float) -> None:
    given_up = threading.Event()

    def hold_back(data: bytes) -> None:
        # whatever it is asked meanwhile is answered behind this
        drive.answer = drive.send
        given_up.wait(PATIENT)
        time.sleep((late - 1) * SHORT)
        drive.send(data)

    drive.answer = hold_back
    with pytest.raises(NoAnswer):
        hasty.read(1, SPEED)
    given_up.set()
    drive.values[0x94] = 7
    deadline = time.monotonic() + PATIENT
    reply = b''
    while not reply:
        assert time.monotonic() < deadline
        try:
            reply = hasty.read(1, SPEED).data
        except LinkError as error:
            assert not isinstance(error, (PortError, Refused))
    assert reply == packed(7)


def test_answer_of_another(drive: PtyDrive, hasty: ClassicLink) -> None:
    drive.answer = lambda data: drive.send(b'"' + data[1:])
    with pytest.raises(DamagedAnswer):
        hasty.read(1, SPEED)


def test_noise_and_doubled_answers(drive: PtyDrive, link: ClassicLink) -> None:
    drive.answer = lambda data: drive.send(b'\x00!\x02E' + data + data)
    for speed in range(20):
        drive.values[0x94] = speed
        assert link.read(1, SPEED).data == packed(speed)


def test_hang_up(drive: PtyDrive) -> None:
    link = connect(drive)
    link.close()
    with pytest.raises(PortError):
        link.read(1, SPEED)
