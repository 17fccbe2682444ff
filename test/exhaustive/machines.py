# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The connections that ``make exhaustive`` tries beside those of a campaign."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from any_order_machine import AnyOrder
from any_order_machines import MACHINES, Canopen, CanopenDs402, Classic, G2ModeScmd, OptimalModeScmd
from support.rig import CONNECTIONS, Connection

from nfo_sinus_driver.drive.known.settings import AS_THE_DRIVE_CAN


class _Of(AnyOrder):
    """One of :data:`CONNECTIONS`; for a machine."""

    name = ''

    @property
    def connection(self) -> Connection:
        return CONNECTIONS[self.name]


class G2Ascii(_Of, G2ModeScmd):
    name = 'ascii'


class G2Tcp(_Of, G2ModeScmd):
    name = 'tcp'


class ClassicOfOldFirmware(_Of, Classic):
    name = 'classic v5.0'
    line: ClassVar[Mapping[str, Any]] = {'response_timeout': 0.1}


class CanopenWord(_Of, Canopen):
    name = 'canopen, control word'
    method = 'drive_control'


class Ds402Alone(_Of, CanopenDs402):
    name = 'canopen, ds402 alone'


class OptimalAscii(_Of, OptimalModeScmd):
    name = 'optimal ascii'


class _Plain(_Of):
    """Without the rules of a family: what its run asks for is here."""

    boot_times = (0.05, 0.5, 2.0)
    drive_timeout = 0.0

    def begin_for_each_event(self) -> None:
        self.model, self.method = self.connection.model, self.connection.method
        self.begin_with({}, {}, {}, drive_timeout=self.drive_timeout)
        self.faults = (self.rig.a_fault,)

    def forget_faults(self) -> None:
        self.rig.far.faults.acknowledge()


class _BehindPlc(_Plain):
    enders = ('first_fault', 'run_input_off', 'plc_restarts', 'plc_misses_the_drive')

    def begin_for_each_event(self) -> None:
        super().begin_for_each_event()
        # a power cycle may end the fault before the word that acknowledges it is sent
        self.rig.excused.append('no fault to acknowledge')

    def plc_restarts(self, wait: float) -> None:
        """Switch the PLC off and on: its registers are 0 then."""
        self.laws.disturbed()
        self.laws.lose(self.laws.times.found)
        self.rig.line.plc.restart(self.rig.clock.now + 0.5)
        self.let(wait)

    def plc_misses_the_drive(self, wait: float) -> None:
        """Cut the line between PLC and drive for so long that the PLC shows its data as invalid."""
        self.laws.disturbed()
        self.laws.lose(self.laws.times.found)
        (channel,) = self.rig.line.plc.channels.values()
        channel.cut_until = self.rig.clock.now + 1.0
        self.let(wait)


class G2BehindPlc(_BehindPlc):
    name = 'telegram1 g2'


class G2ByMailbox(_BehindPlc):
    name = 'telegram1 g2, mailbox'


class OptimalBehindPlc(_BehindPlc):
    name = 'telegram1 optimal'


class SinusH(_BehindPlc):
    name = 'telegram1 sinus_h'
    # no manual tells whether its terminal counts beside the bus
    enders = ('first_fault', 'plc_restarts', 'plc_misses_the_drive')
    # the stop that follows is another word, and for a start the judge of words would not have it
    not_refused = ('telegram.clear',)


class _Described(_Plain):
    enders = ('first_fault', 'run_input_off')
    drive_timeout = AS_THE_DRIVE_CAN


class Described(_Described):
    name = 'described'


class DescribedByStates(_Described):
    name = 'described, by states'


class DescribedWithoutHolder(_Described):
    name = 'described, no holder'


class DescribedByPulses(_Described):
    name = 'described, by pulses'


class DescribedBySetpoint(_Described):
    name = 'described, by set-point'


EVERY_MACHINE = (
    *MACHINES,
    G2Ascii,
    G2Tcp,
    ClassicOfOldFirmware,
    CanopenWord,
    Ds402Alone,
    OptimalAscii,
    G2BehindPlc,
    G2ByMailbox,
    OptimalBehindPlc,
    SinusH,
    Described,
    DescribedByStates,
    DescribedWithoutHolder,
    DescribedByPulses,
    DescribedBySetpoint,
)
