# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A Classic master on the bench: frames by hand, answers in plain view."""

from nfo_sinus_driver.simulator.classic import Classic
from nfo_sinus_driver.simulator.family import simulated_drive

#: SWVer of a drive that each manual describes.
SW_VER = {'2.03': 4.38, '5.0': 4.21}
ACK, NAK = b'!\x06', b'!\x15'
SIO_FAIL = 14
RUN = 0x101


def bcc(text):
    """The XOR of all characters [M0 §6.1.3]."""
    check = 0
    for character in text:
        check ^= character
    return bytes([check])


def enquiry(id_, address=1):
    return bytes([4, 32 + address]) + id_.encode() + b'\x05'


def select(id_, value, address=1):
    text = f'{id_}={value & 0xFFFF:04X}'.encode() + b'\x03'
    return bytes([4, 32 + address, 2]) + text + bcc(text)


def reply(id_, value, address=1):
    text = f'{id_}={value & 0xFFFF:04X}'.encode() + b'\x03'
    return bytes([32 + address, 2]) + text + bcc(text)


class ClassicBench:
    """A drive that is spoken to in whole frames, and time that passes by command."""

    def __init__(self, dialect='2.03', **options):
        settings = {
            'fieldbus.sw_ver': SW_VER[dialect],
            'serial.bus_type': 'NFO',
            **options.pop('settings', {}),
        }
        self.drive = simulated_drive(settings=settings, **options)
        self.protocol = Classic()

    def say(self, frame):
        """Send a frame; return the answer, empty if there is none."""
        request = self.protocol.unwrap(frame)
        if request is None or not self.protocol.concerns(self.drive, request):
            return b''
        if request.whole:
            self.drive.note_frame()
        return self.protocol.answer(self.drive, request)

    def read(self, id_, address=1):
        """The value of a parameter, unsigned."""
        answer = self.say(enquiry(id_, address))
        assert answer[1] == 2, f'{id_} is not answered but {answer!r}'
        name, value = answer[2:12].decode().split('=')[0], answer[8:12].decode()
        assert name.upper() == id_.upper()
        assert bcc(answer[2:-1]) == answer[-1:]
        return int(value, 16)

    def write(self, id_, value, address=1):
        return self.say(select(id_, value, address))

    def run(self, setpoint=200):
        """Take control and run by the bus."""
        for id_, value in [('E0029', 3), ('E001E', setpoint), ('E00AD', RUN)]:
            assert self.write(id_, value) == ACK

    @property
    def flags(self):
        """The flags of SioErr, without reading them over the line."""
        return int(self.drive.faults.sio_err)

    @property
    def running(self):
        return self.drive.motor.driven
