# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the tests know of the drives of a family: how they are set, what they show, who has them."""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from nfo_sinus_driver.simulator.control import Client as Simulated

State = Mapping[str, Any]


class Fault(NamedTuple):
    """
    A fault by its code, what it is called, and words of what is said of it.

    :ivar reported: the code that the driver reports, where the drive does not say which it is.
    """

    code: int
    text: str
    explained: tuple[str, ...] = ()
    reported: int = 0

    def __str__(self) -> str:
        return f'{self.reported or self.code} {self.text}'


@dataclass(frozen=True)
class Drives(abc.ABC):
    """
    The drives of one family, in the words of their simulator.

    :ivar control_method: the usual one, and its constant in `DriveStatus`.
    :ivar up: the setting for the ramp up, and that for the ramp down.
    :ivar overload: a fault, likewise the others.
    :ivar silence: the text of the fault of its own time-out.
    :ivar no_timeout: the options of a simulated drive that runs on when the bus is silent.
    :ivar stopped: the text that it shows when nothing has it run.
    :ivar running: the text while it runs under control of the bus.
    :ivar most: the highest set-point, Hz.
    :ivar nominal: what its motor is made for, Hz; `most` where the drive does not tell it.
    :ivar without_run_input: what is said where the input that has to be closed is open.
    :ivar tells_run_input: it is read whether that input is closed, before anything is enabled.
    :ivar quick_stopped: what is answered to a quick stop of a motor that runs.
    """

    control_method: str
    up: str
    down: str
    overload: Fault
    overheating: Fault
    overvoltage: Fault
    hot_motor: Fault
    silence: str
    stopped: str
    running: str
    most: float
    nominal: float
    without_run_input: str
    no_timeout: tuple[str, ...] = ()
    tells_run_input: bool = False
    quick_stopped: str = 'released: the motor coasts'

    def ramps(self, up: float, down: float | None = None) -> tuple[str, ...]:
        """Return the options of a simulated drive with these ramps, s; one says both."""
        down = up if down is None else down
        return '--set', f'{self.up}={up:g}', '--set', f'{self.down}={down:g}'

    @abc.abstractmethod
    def commanded(self, state: State) -> bool:
        """Return whether a run command of the bus stands."""

    @abc.abstractmethod
    def taken(self, state: State) -> bool:
        """Return whether the bus has control."""

    @abc.abstractmethod
    def left(self, state: State) -> bool:
        """Return whether a driver that has ended left the drive as it should."""

    @abc.abstractmethod
    def stopping(self, state: State) -> bool:
        """Return whether the drive drives its motor to a stop, or not at all."""

    @abc.abstractmethod
    def timeout(self, seconds: float) -> tuple[str, ...]:
        """Return the options of a simulated drive whose own time-out stops the motor so soon."""

    @abc.abstractmethod
    def has_timeout(self, state: State, seconds: float) -> bool:
        """Return whether its own time-out is set so, and stops the motor."""

    @abc.abstractmethod
    def stop_at_keypad(self, drive: Simulated, noticed: Callable[[], object]) -> None:
        """Have a person stop it at its keypad, who leaves it when that was noticed."""

    @abc.abstractmethod
    def run_by_terminals(self, drive: Simulated) -> None:
        """Have another master change who controls it, and run it by its terminals."""

    @abc.abstractmethod
    def end_run_by_terminals(self, drive: Simulated) -> None:
        """Have the same end that, and leave it so that it can be enabled."""


class Sinus(Drives):
    """Those with MODE, and a run command that stands until another comes."""

    def commanded(self, state: State) -> bool:
        return bool(state['scmd'])

    def taken(self, state: State) -> bool:
        return bool(state['mode'] == 3)

    def left(self, state: State) -> bool:
        # MODE = Ext can start the motor
        return state['mode'] == 1 and not state['scmd'] and not state['mode_ext_writes']

    def stopping(self, state: State) -> bool:
        return state['state'] in (
            'SHUTDOWN',
            'STOPPING',
            'DISABLE',
            'QUICK_STOP',
            'SWITCHED_ON',
            'READY_TO_SWITCH_ON',
            'SWITCH_ON_DISABLED',
            'FAULT_REACTION_ACTIVE',
            'FAULTED',
        )

    def timeout(self, seconds: float) -> tuple[str, ...]:
        return '--set', f'serial.sio_tot={seconds:g}', '--set', 'serial.auto_stop=ON'

    def has_timeout(self, state: State, seconds: float) -> bool:
        parameters = state['parameters']
        return parameters['serial.sio_tot'] == seconds and parameters['serial.auto_stop'] is True

    def stop_at_keypad(self, drive: Simulated, noticed: Callable[[], object]) -> None:
        drive.inject('keypad', 'stop')
        noticed()

    def run_by_terminals(self, drive: Simulated) -> None:
        drive.inject('keypad', 'ext')

    def end_run_by_terminals(self, drive: Simulated) -> None:
        drive.inject('keypad', 'stop')


class OnCanopen(Sinus):
    """
    A G2 on CANopen: its module holds it in bus mode, whatever is there [M0 §6.4].

    It watches over the heartbeat of the driver, which shows in no parameter.
    """

    def left(self, state: State) -> bool:
        return state['mode'] == 3 and not state['scmd'] and not state['mode_ext_writes']

    def has_timeout(self, state: State, seconds: float) -> bool:
        return state['parameters']['serial.auto_stop'] is True


class Movitrac(Drives):
    """Those with function bits, which count while P841 is Remote control."""

    def commanded(self, state: State) -> bool:
        # CW and CCW
        return bool(state['function_bits'] & 3)

    def taken(self, state: State) -> bool:
        return state['parameters']['serial.control_mode'] == 'Remote control'

    def left(self, state: State) -> bool:
        # P841 stays, for another one can start the motor
        return not state['function_bits'] and not state['setpoint']

    def stopping(self, state: State) -> bool:
        return state['phase'] != 'running'

    def timeout(self, seconds: float) -> tuple[str, ...]:
        return '--set', f'serial.pc_timeout={seconds:g}'

    def has_timeout(self, state: State, seconds: float) -> bool:
        return bool(state['parameters']['serial.pc_timeout'] == seconds)

    def stop_at_keypad(self, drive: Simulated, noticed: Callable[[], object]) -> None:
        drive.inject('keypad', 'manual')
        noticed()
        drive.inject('keypad', 'automatic')

    def run_by_terminals(self, drive: Simulated) -> None:
        drive.inject('set', 'serial.control_mode', 'Standard')
        drive.inject('terminal', 41, 'closed')

    def end_run_by_terminals(self, drive: Simulated) -> None:
        drive.inject('terminal', 41, 'open')


@dataclass(frozen=True)
class BehindPlc(Drives):
    """
    Those that a PLC commands for the driver, by STW1 of telegram 1.

    :ivar run: the bits of STW1 that are there for no other reason than a run command.
    :ivar control: the bit by which the PLC has control, or one that always comes with it.
    """

    run: int = 0
    control: int = 1 << 10

    def ramps(self, up: float, down: float | None = None) -> tuple[str, ...]:
        return super().ramps(up, down) if self.up else ()

    def commanded(self, state: State) -> bool:
        return bool(state['plc']['stw1'] & self.run)

    def taken(self, state: State) -> bool:
        return bool(state['plc']['stw1'] & self.control)

    def left(self, state: State) -> bool:
        # what is left is that the PLC commands it
        return not self.commanded(state) and not state['plc']['setpoint']

    def stopping(self, state: State) -> bool:
        return not state['driven'] or not self.commanded(state)

    def timeout(self, seconds: float) -> tuple[str, ...]:
        raise NotImplementedError('that is the affair of the PLC')

    def has_timeout(self, state: State, seconds: float) -> bool:
        raise NotImplementedError('that is the affair of the PLC')

    def stop_at_keypad(self, drive: Simulated, noticed: Callable[[], object]) -> None:
        drive.inject('keypad', 'stop')
        noticed()

    def run_by_terminals(self, drive: Simulated) -> None:
        raise NotImplementedError('the PLC alone commands it')

    def end_run_by_terminals(self, drive: Simulated) -> None:
        raise NotImplementedError('the PLC alone commands it')


_SINUS = {
    'control_method': 'mode_scmd',
    'up': 'control.accel',
    'down': 'control.retard',
    'overload': Fault(5, 'Overload'),
    'overheating': Fault(3, 'Temp Hi'),
    'silence': 'Sio Fail',
    'stopped': 'Stop',
    'running': 'Bus Run',
    'most': 150.0,
    'without_run_input': 'RUN input (DIN1) is not active',
}
_NO_QUICK_STOP = 'stopping: it ramps down (this drive has no quick stop)'
_G2 = {
    **_SINUS,
    'overvoltage': Fault(8, 'DC High', ('control.retard',)),
    'hot_motor': Fault(4, 'PTC Temp', ('thermistor', 'Let the motor cool')),
    'no_timeout': ('--set', 'serial.auto_stop=OFF'),
    'nominal': 50.0,
}
#: Whatever it is, the telegram tells that there is one.
_SOME_FAULT = {'text': 'Fault', 'reported': 191}
_PLC = {
    **_SINUS,
    'control_method': 'telegram1',
    'overload': Fault(5, **_SOME_FAULT),
    'overheating': Fault(3, **_SOME_FAULT),
    'overvoltage': Fault(8, **_SOME_FAULT),
    'hot_motor': Fault(4, **_SOME_FAULT),
    'silence': 'Fault',
}
DRIVES = {
    'sinus_g2': Sinus(**_G2),
    # the module holds it in bus mode, and watches over the driver
    'sinus_g2 canopen': OnCanopen(**{**_G2, 'silence': 'Bus Fail', 'stopped': 'Bus Stby'}),
    'sinus_optimal': Sinus(
        **_SINUS,
        nominal=150.0,
        overvoltage=Fault(8, 'DC High', ('Lengthen the retardation time',)),
        hot_motor=Fault(4, 'PTC Temp', ('temperature sensor', 'Let the motor cool')),
        quick_stopped=_NO_QUICK_STOP,
    ),
    'sinus_optimal telegram1': BehindPlc(
        **_PLC, run=0x0001, nominal=150.0, quick_stopped=_NO_QUICK_STOP
    ),
    'sinus_g2 telegram1': BehindPlc(**_PLC, run=0x0001, nominal=150.0),
    # its ramps are set at its keypad alone
    'sinus_h': BehindPlc(
        **{
            **_PLC,
            'up': '',
            'down': '',
            'overload': Fault(11, **_SOME_FAULT),
            'overheating': Fault(11, **_SOME_FAULT),
            'overvoltage': Fault(11, **_SOME_FAULT),
            'hot_motor': Fault(11, **_SOME_FAULT),
        },
        run=0x0008, nominal=60.0,
    ),
    'movitrac31': Movitrac(
        control_method='function_bits',
        up='ramp.t11_up',
        down='ramp.t11_down',
        overload=Fault(104, 'Continuous overload'),
        overheating=Fault(106, 'Overheating'),
        overvoltage=Fault(102, 'DC-link voltage', ('Lengthen the ramp (P121, P140)',)),
        hot_motor=Fault(112, 'Motor overload', ('overloaded', 'let the motor cool')),
        silence='PC time out',
        stopped='No enable',
        running='Enable',
        # fmax from the factory
        most=50.0,
        nominal=50.0,
        without_run_input='terminal 43 (Enable/Stop) is open',
        no_timeout=('--set', 'serial.pc_timeout=0'),
        tells_run_input=True,
    ),
}
