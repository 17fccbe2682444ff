# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A simulated Sinus Optimal, asked by registers and codes copied from its manual [M1] by hand."""

import struct

from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.modbus import server

STATOR_FREQUENCY = 0x0400
CONTROL_FREQUENCY = 0x0518
CONTROL_SPEED = 0x0260
MODE = 0x0294
SMODE = 0x0298
INPUT_FREQUENCY = 0x03FC
STATUS_WITH_ACK = 0x02A4
STATUS = 0x02A5
DRIVE_CONTROL = 0x0254
DRIVE_STATUS = 0x0258

MANUAL, AUTO, BUS = 1, 2, 3
STOP, RUN_TERMINAL, RUN_INPUT = 0, 0x081, 0x101

# bits of Drive Status
READY = 1 << 0
SWITCHED_ON = 1 << 1
ENABLED = 1 << 2
FAULT = 1 << 3
DISABLED = 1 << 6
ALARM = 1 << 7
FROM_BUS = 1 << 9
REACHED = 1 << 10
SLEEP = 1 << 12
BRAKE = 1 << 13
REVERSE = 1 << 14
STOPPING = 1 << 15


class OptimalBench:
    """One drive; time passes by command."""

    def __init__(self, **options):
        self.drive = simulated_drive('sinus_optimal', **options)

    def ask(self, pdu):
        return server(self.drive).answer(bytes.fromhex(pdu) if isinstance(pdu, str) else pdu)

    def read(self, register):
        """Read one register, signed."""
        pdu = self.ask(struct.pack('>BHH', 3, register, 1))
        assert pdu[:2] == b'\x03\x02', pdu.hex()
        return struct.unpack('>h', pdu[2:])[0]

    def write(self, register, value):
        pdu = struct.pack('>BHH', 6, register, value & 0xFFFF)
        assert self.ask(pdu) == pdu

    @property
    def bits(self):
        return self.read(DRIVE_STATUS) & 0xFFFF

    @property
    def code(self):
        return self.read(STATUS)

    @property
    def text(self):
        return self.drive.model.status_code(self.code).text

    @property
    def running(self):
        return self.drive.motor.driven

    def run(self, setpoint, seconds=0.0):
        """Run by SMODE = 101h at Hz."""
        self.write(MODE, BUS)
        self.write(INPUT_FREQUENCY, round(10 * setpoint))
        self.write(SMODE, RUN_INPUT)
        self.wait(seconds)

    def switch_on(self, seconds=0.0):
        """Run by Drive Control, as the manual's example does."""
        for word, bit in ((0x4000, FROM_BUS), (0x4008, ENABLED), (0x4009, SWITCHED_ON)):
            self.write(DRIVE_CONTROL, word)
            self.wait(0.1)
            assert self.bits & bit
        self.wait(seconds)

    def wait(self, seconds):
        self.drive.advance(seconds)
