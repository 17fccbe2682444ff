# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The connections to a drive: which protocol, dialect and model a test is run over."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import pytest
from support.drives import DRIVES, Drives

#: What only some of the connections have, and why the others go without; see :func:`needs`.
WITHOUT = {
    'rtu': 'it reads frames of Modbus RTU to a G2 by hand',
    'eight': 'it is about the 8 data bits of Modbus RTU',
    'seven': 'it is about the 7 data bits of Modbus ASCII',
    'modbus': 'it is about Modbus',
    'classic': 'it is about what has no register, and Classic alone reaches',
    'serial': 'it is about a serial port',
    'gateway': 'it is about a gateway',
    'fine': 'its values are finer than the steps of Classic',
    'newer': 'the firmware of this dialect has not got it [C5], [C21]',
    'later': 'on this firmware it counts at once, and the line is gone [C7]',
    'at_once': 'on this firmware it counts from the next power-up on [C7]',
    'fast': 'this dialect knows no more than 9600 bit/s',
    'parameters': 'this model has not the settings that it names',
    'timeout': 'this model has no time-out of its own',
    'sio_tot': 'its time-out is no setting of the drive',
    'bare': 'this model has drive parameters',
    'states': 'there is no state machine that the words of the test are about',
    'scmd': 'it is about the run commands of a G2',
    'movitrac': 'it is about a MOVITRAC',
    'nominal': 'this model does not tell how many pole pairs its motor has',
    'delay': 'this model has no start delay',
    'format': 'the character format of this model is fixed',
    'identity': 'nothing there tells which drive it is',
    'own': 'it goes the one way that its command goes',
    'canopen': 'it is about CANopen',
    'characters': 'no program sees a damaged frame of this bus: it is sent again at once',
    'direct': 'a PLC is between, and the telegram tells little: see test_telegram1_ros.py',
    'watched': 'its telegram tells its state to who commands it alone',
    'keypad': 'no manual tells how STW1 has control again after STOP at the keypad of this drive',
    'reverse': 'this model turns one way by its telegram',
    'run_input': 'no manual tells whether its terminal counts beside the enable of the bus',
    'local': 'the module holds the drive in bus mode, so that it is stopped as soon as it is found',
}

#: How unit and PDU are got out of a frame of Modbus.
UNFRAMED: Mapping[str, Callable[[bytes], bytes]] = {
    'modbus_rtu': lambda frame: frame[:-2],
    'modbus_ascii': lambda frame: bytes.fromhex(frame[1:-4].decode()),
    'modbus_tcp': lambda frame: frame[6:],
}
#: What a driver says where no drive answers, and what is to be checked, in order.
SILENCE = 'no response', 'BusType', 'jumper S5', 'the address,', 'baud', 'parity'
_SILENCE_OF_OTHERS = 'no response', 'protocol', 'RS485', 'the address,', 'baud', 'parity'
_SILENCE_OF_MOVITRACS = 'no response', 'power', 'USS 11A', 'P880', 'P842', 'wires'
_SILENCE_OF_NODES = 'no response', 'power', 'the node id', 'the bit rate', 'CAN_H', '120 ohms'


@dataclass(frozen=True)
class Connection:
    """
    One connection.

    :ivar baud_rate: bit/s, of both ends.
    :ivar dialect: the manual that describes the Classic protocol; of the simulator.
    :ivar features: those of :data:`WITHOUT` that it has.
    :ivar method: the control method that the driver is given, where it is not the usual one.
    :ivar block: the first register of the block, behind a PLC.
    :ivar beyond: the settings of the drive that it does not reach.
    :ivar unreported: what a running drive does not tell of itself, by the fields of `DriveStatus`.
    :ivar unmeasured: the same of `Telemetry`.
    """

    name: str
    protocol: str
    features: frozenset[str]
    model: str = 'sinus_g2'
    dialect: str = ''
    baud_rate: int = 57600
    method: str = ''
    block: int = 0
    beyond: frozenset[str] = frozenset()
    unreported: frozenset[str] = frozenset()
    unmeasured: frozenset[str] = frozenset()

    @property
    def bus(self) -> str:
        """How parameters are addressed."""
        return self.protocol if self.protocol in ('classic', 'movitrac') else 'modbus'

    @property
    def drives(self) -> Drives:
        """What is to be known of its drives."""
        return DRIVES.get(f'{self.model} {self.method or self.protocol}') or DRIVES[self.model]

    @property
    def simulator(self) -> dict[str, str | int]:
        """The settings of a simulated line, as `Simulator` names them."""
        if self.method == 'telegram1':
            return {'protocol': self.method, 'model': self.model}
        settings: dict[str, str | int] = {
            'protocol': self.protocol, 'model': self.model, 'baud': self.baud_rate
        }
        return {**settings, 'dialect': self.dialect} if self.dialect else settings

    @property
    def driver(self) -> dict[str, str | int]:
        """The settings of the driver."""
        settings: dict[str, str | int] = {
            'protocol': self.protocol, 'model': self.model, 'baud_rate': self.baud_rate
        }
        if self.method:
            settings |= {'control_method': self.method, 'block_address': self.block}
        # v2.03 is what a driver takes a drive for that is not said to be older
        return {**settings, 'classic_dialect': 'v5.0'} if self.dialect == '5.0' else settings

    @property
    def tells(self) -> bool:
        """The drive has settings to be read, and the driver knows from them how it is set."""
        return 'bare' not in self.features

    @property
    def absent(self) -> tuple[str, str]:
        """What a driver says where there is no port, and what is to be looked after."""
        if self.protocol == 'modbus_tcp':
            return 'cannot be reached', 'switched on'
        return 'does not exist', 'plugged in'

    @property
    def no_answer(self) -> tuple[str, ...]:
        """What a driver says where no drive answers, and what is to be checked, in order."""
        if self.protocol == 'modbus_tcp':
            return 'has no path to unit', 'table of units', 'serial port'
        if self.protocol == 'canopen':
            return _SILENCE_OF_NODES
        if self.protocol == 'movitrac':
            return _SILENCE_OF_MOVITRACS
        return SILENCE if self.model == 'sinus_g2' else _SILENCE_OF_OTHERS

    @property
    def noise(self) -> tuple[str, ...]:
        """What a driver says of damaged answers, and what is to be checked, in order."""
        # no gateway passes them on
        return SILENCE if self.protocol == 'modbus_tcp' else ('is no answer', 'baud rate', 'parity')


#: Of any firmware, and of the usual one.
_OLD_G2 = frozenset((
    'characters', 'local', 'delay', 'direct', 'format', 'keypad', 'nominal', 'parameters',
    'reverse', 'run_input', 'sio_tot', 'timeout', 'watched',
))
_G2 = _OLD_G2 | {'fast', 'later', 'newer', 'scmd', 'states'}
_OPTIMAL = frozenset((
    'bare', 'characters', 'delay', 'direct', 'fast', 'fine', 'format', 'keypad', 'later', 'local',
    'modbus', 'newer', 'nominal', 'reverse', 'run_input', 'watched',
))
_MODBUS = frozenset(('fine', 'identity', 'modbus'))
_ON_CANOPEN = (_G2 | {'canopen', 'fine', 'identity'}) - {
    'characters', 'fast', 'format', 'local', 'sio_tot'
}
_CLASSIC = frozenset(('classic', 'serial'))
_RTU = frozenset(('eight', 'serial'))
_ASCII = frozenset(('seven', 'serial'))

#: It has no register [M0 table 4].
_NOT_ON_MODBUS = frozenset(('control.any_bus',))
#: What the newer manual alone has [C21], and what has other codes in the older firmware [C5].
NEWER = frozenset((
    'control.f_sleep', 'error.short_c_err_cnt', 'serial.bus_type', 'serial.si_prot'
))
#: Without a status word the inverter status tells the rest [C21].
_NO_STATUS_WORD = frozenset((
    'ready', 'switched_on', 'network_reference', 'setpoint_reached', 'reverse'
))
_NOT_OF_THE_OPTIMAL = frozenset((
    'output_voltage', 'dc_link_voltage', 'torque', 'motor_temperature', 'pt1000_temperature',
    'brake_time', 'energy', 'total_energy',
))
_NOT_IN_INDEX_284 = frozenset(('network_control', 'network_reference', 'setpoint_reached'))
_NOT_OF_THE_MOVITRAC = frozenset((
    'output_current', 'output_power', 'power_factor', 'torque', 'motor_temperature',
    'pt1000_temperature', 'operating_time', 'running_time', 'brake_time', 'energy', 'total_energy',
))

CONNECTIONS = {
    connection.name: connection
    for connection in (
        Connection(
            'modbus_rtu', 'modbus_rtu', _G2 | _MODBUS | _RTU | {'own', 'rtu'},
            beyond=_NOT_ON_MODBUS,
        ),
        Connection('modbus_ascii', 'modbus_ascii', _G2 | _MODBUS | _ASCII, beyond=_NOT_ON_MODBUS),
        Connection('modbus_tcp', 'modbus_tcp', _G2 | _MODBUS | {'gateway'}, beyond=_NOT_ON_MODBUS),
        Connection('classic_v2', 'classic', _G2 | _CLASSIC, dialect='2.03'),
        Connection(
            'classic_v5', 'classic', _OLD_G2 | _CLASSIC | {'at_once'},
            dialect='5.0', baud_rate=9600, beyond=NEWER,
            unreported=_NO_STATUS_WORD, unmeasured=frozenset(('energy', 'total_energy')),
        ),
        *(
            Connection(
                f'optimal_{kind}', f'modbus_{kind}', _OPTIMAL | features, 'sinus_optimal',
                unreported=frozenset(('network_reference',)), unmeasured=_NOT_OF_THE_OPTIMAL,
            )
            for kind, features in (('rtu', _RTU), ('ascii', _ASCII))
        ),
        Connection(
            'movitrac', 'movitrac',
            frozenset(
                (
                    'characters', 'direct', 'keypad', 'local', 'movitrac', 'nominal', 'reverse',
                    'serial', 'states', 'timeout', 'watched',
                )
            ),
            'movitrac31', baud_rate=9600, unreported=_NOT_IN_INDEX_284,
            unmeasured=_NOT_OF_THE_MOVITRAC,
        ),
        Connection(
            'canopen', 'canopen', _ON_CANOPEN,
            baud_rate=125_000, beyond=_NOT_ON_MODBUS,
        ),
        *(
            Connection(
                f'telegram1_{name}', 'modbus_tcp', features, model, method='telegram1', block=7,
            )
            for name, model, features in (
                ('h', 'sinus_h', frozenset(('keypad', 'watched'))),
                ('optimal', 'sinus_optimal', frozenset(('reverse',))),
                ('g2', 'sinus_g2', frozenset(('keypad', 'reverse'))),
            )
        ),
    )
}
#: Through a PLC, which tells less than any line of the drives themselves, by their models.
TELEGRAM1 = {
    connection.model: connection
    for connection in CONNECTIONS.values()
    if connection.method == 'telegram1'
}
#: Those of a normal run: the others behind a PLC have their share in test_telegram1_ros.py.
USUAL = tuple(name for name in CONNECTIONS if name not in ('telegram1_optimal', 'telegram1_g2'))
DEFAULT = 'modbus_rtu'
#: One of each family of protocols and drives, where the others are the same to a test.
EACH_KIND = ('modbus_rtu', 'classic_v5', 'optimal_ascii', 'movitrac')


def needs(*features: str) -> pytest.MarkDecorator:
    """Mark a test, or a module, that makes sense only over connections with these features."""
    assert WITHOUT.keys() >= set(features), features
    return pytest.mark.needs(*features)


def reason_to_skip(connection: Connection, features: tuple[str, ...]) -> str:
    """Return why a test with a mark is not run over a connection; ``''``: it is."""
    missing = [feature for feature in features if feature not in connection.features]
    return f'not over {connection.name}: {WITHOUT[missing[0]]}' if missing else ''
