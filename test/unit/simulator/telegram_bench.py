# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive behind a fieldbus: telegrams by hand, and time that passes by them."""

from nfo_sinus_driver.simulator.family import simulated_drive


class TelegramBench:
    """One drive on a fieldbus with a telegram every 20 ms, or none."""

    def __init__(self, model, settings=None, **options):
        self.drive = simulated_drive(model, settings=settings, boot_time=0.0, **options)
        self.server = self.drive.servers['telegram1']
        self.unit = self.drive.control_unit
        self.word = self.setpoint = 0
        self.zsw1 = self.actual = 0

    def send(self, word, setpoint=None):
        """Exchange one telegram."""
        self.word = word
        if setpoint is not None:
            self.setpoint = setpoint
        self.zsw1, self.actual = self.server.exchange(word, self.setpoint)

    def wait(self, seconds, telegrams=True):
        for _ in range(round(seconds / 0.02)):
            self.drive.advance(0.02)
            if telegrams:
                self.send(self.word)

    def step(self, word, setpoint=None):
        """Give a word and wait until the drive has responded to it."""
        self.send(word, setpoint)
        self.wait(0.1)
        return self.zsw1

    @property
    def state(self):
        return self.unit.report()['state']

    @property
    def motor(self):
        return self.drive.motor
