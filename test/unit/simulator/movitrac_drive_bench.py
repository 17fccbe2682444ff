# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A MOVITRAC master on the bench: frames by hand, indices and codes copied from [M4]."""

import struct

from hypothesis import strategies as st

from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.movitrac import Movitrac

ACK = b'\xd2\xd2'

# indices
FREQUENCY, MOTOR_VOLTAGE, DC_LINK, HEAT_SINK = 0, 1, 2, 4
SPEED, TERMINALS = 17, 13
FAULT_T0, FAULT_T1 = 8, 9
T11_UP, T11_DOWN, T13_STOP = 25, 26, 28
F_MIN, F_BASE, F_MAX = 79, 80, 81
INPUT_42, INPUT_43, INPUT_47, INPUT_48 = 150, 151, 152, 153
MANUAL_OPERATION = 196
LOCK, FACTORY_SETTING, CONTROL_MODE, ADDRESS, RESPONSE_TIME = 202, 203, 205, 206, 207
SETPOINT, SAVE_TO_EEPROM, BITS, STATUS, PC_TIMEOUT = 223, 236, 281, 284, 285

STANDARD, REMOTE_SETPOINT, REMOTE_CONTROL, FIELDBUS = 0, 1, 2, 3

# function bits
CW, CCW, ENABLE, SECOND_SET, RESET, INHIBIT = 0x01, 0x02, 0x04, 0x08, 0x40, 0x100
SECOND_RAMP = 0x1000

# inverter status
CONTROLLER_INHIBIT, NO_ENABLE, ENABLED, CHANGE_DIRECTION = 0, 1, 10, 11
NORMAL_STOP, RAPID_STOP = 12, 13


def summed(body):
    """A frame with the sum of its bytes, without carry [M4 §2.1.1]."""
    return body + bytes([sum(body) % 256])


def enquiry(index, address=0):
    return summed(struct.pack('>BBH', 0xB5, address, index))


def select(index, value, address=0):
    """Write 4 bytes."""
    return summed(struct.pack('>BBH', 0xA9, address, index) + value)


def long_select(index, value, address=0):
    """Write 8 bytes."""
    return summed(struct.pack('>BBH', 0xAD, address, index) + value)


#: Any frame of a master.
requests = st.one_of(
    st.builds(enquiry, st.integers(0, 0xFFFF), st.integers(0, 63)),
    st.builds(select, st.integers(0, 0xFFFF), st.binary(min_size=4, max_size=4)),
    st.builds(long_select, st.integers(0, 0xFFFF), st.binary(min_size=8, max_size=8)),
)


def data(index, value):
    return summed(struct.pack('>BH', 0xC8, index) + value)


def long_data(index, value):
    return summed(struct.pack('>BH', 0xAC, index) + value)


def nack(code):
    return summed(bytes([0xF3, code]))


def bcd(value):
    """4 bytes of packed decimal digits with two decimals."""
    return bytes.fromhex(f'{round(100 * value):08d}')


class MovitracBench:
    """A drive that is spoken to in whole frames, and time that passes by command."""

    def __init__(self, **options):
        self.address = options.pop('address', 0)
        self.drive = simulated_drive('movitrac31', self.address, **options)
        self.unit = self.drive.control_unit
        self.protocol = Movitrac()

    def say(self, frame):
        """Send a frame; return the answer, empty if there is none."""
        request = self.protocol.unwrap(frame)
        if request is None or not self.protocol.concerns(self.drive, request):
            return b''
        self.drive.note_frame()
        return self.protocol.answer(self.drive, request)

    def ask(self, index):
        """The bytes that stand at an index."""
        answer = self.say(enquiry(index, self.address))
        assert answer[:1] == b'\xc8', answer.hex(' ')
        assert answer == summed(answer[:-1])
        assert answer[1:3] == struct.pack('>H', index)
        return answer[3:-1]

    def read(self, index):
        """A number with two decimals."""
        return int(self.ask(index).hex()) / 100

    def word(self, index):
        return int.from_bytes(self.ask(index), 'big')

    def write(self, index, value):
        """Write a number with two decimals; return the answer."""
        return self.say(select(index, bcd(value), self.address))

    def bits(self, word):
        return self.say(select(BITS, struct.pack('>I', word), self.address))

    def set(self, **values):
        """Write settings by the names above, in small letters."""
        for name, value in values.items():
            assert self.write(globals()[name.upper()], value) == ACK, name

    def take(self, setpoint=25.0):
        """Take control: no bits, the set-point, then the control mode."""
        self.write(CONTROL_MODE, REMOTE_CONTROL)
        assert self.bits(0) == ACK
        assert self.write(SETPOINT, setpoint) == ACK

    def run(self, setpoint=25.0, bits=CW | ENABLE, seconds=2.0):
        self.take(setpoint)
        assert self.bits(bits) == ACK
        self.wait(seconds)

    def wait(self, seconds):
        self.drive.advance(seconds)

    def terminal(self, number, closed):
        self.unit.switch(number, closed)

    @property
    def number(self):
        """The inverter status, byte 1 of index 284."""
        return self.ask(STATUS)[1]

    @property
    def fault(self):
        """Byte 0 of index 284."""
        return self.ask(STATUS)[0]

    @property
    def clockwise(self):
        return bool(self.ask(STATUS)[3] & 0x10)

    @property
    def running(self):
        return self.drive.motor.driven

    def until(self, condition, seconds=10.0):
        """Let time pass until something is so."""
        for _ in range(round(seconds / 0.01)):
            if condition():
                return
            self.wait(0.01)
        raise AssertionError('it never came to that')
