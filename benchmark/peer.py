# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The node that a user would write instead of the driver: rclpy and minimalmodbus.

One node for each drive, on one line; the same five topics, set-points and two services. A timer
polls; one thread does everything, so that no two requests meet. It knows no lost answers, no
time-outs and no faults, and checks nothing: it is the least that does the job.
"""

from __future__ import annotations

import argparse
import time

import minimalmodbus
from nfo_sinus_msgs.msg import DriveStatus, InvSt, Telemetry
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rig import TOPICS
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.catalog import load_family

_MODEL = load_family('sinus_g2')
#: Control by the bus; run; stop.
_BUS, _RUN, _STOP = 3, 0x101, 0
#: s.
_PERIOD = 0.001
_TELEMETRY_PERIOD = 0.5
_MEASURED = {
    'output_current': 'status.i_rms',
    'output_voltage': 'status.u_rms',
    'output_power': 'status.p_out',
    'torque': 'status.trq_act',
    'dc_link_voltage': 'status.dc_link',
}


class Drive(Node):
    """The node of one drive."""

    def __init__(self, name: str, address: int, port: str, baud_rate: int) -> None:
        super().__init__(name)
        # all of one port share its serial object
        self._drive = minimalmodbus.Instrument(port, address)
        serial = self._drive.serial
        # two stop bits: a pseudo-terminal has no parity, and a character is as long
        serial.baudrate, serial.stopbits, serial.timeout = baud_rate, 2, 0.5
        self._publish = {
            topic: self.create_publisher(kind, f'~/{topic}', 10) for topic, kind in TOPICS.items()
        }
        self._setpoint = 0.0
        self._telemetry_due = 0.0
        self.create_subscription(Float32, '~/setpoint', self._on_setpoint, 1)
        self.create_service(SetBool, '~/enable', self._on_enable)
        self.create_service(Trigger, '~/stop', self._on_stop)
        # as often as the line allows
        self.create_timer(_PERIOD, self._poll)

    def _read(self, key: str) -> float:
        place = _MODEL[key].at('modbus')
        words = self._drive.read_registers(place.index, place.codec.size // 2)
        # the low word comes first
        data = b''.join(word.to_bytes(2, 'big') for word in words)
        value = _MODEL[key].decode(data, 'modbus')
        return float(value) if isinstance(value, (int, float)) else 0.0

    def _write(self, key: str, word: int) -> None:
        self._drive.write_register(_MODEL[key].at('modbus').index, word, functioncode=6)

    def _poll(self) -> None:
        """Read the drive once, and publish what it said."""
        stamp = self.get_clock().now().to_msg()
        word = int(self._read('fieldbus.drive_status'))
        code = int(self._read('fieldbus.inv_st'))
        frequency, speed = self._read('status.frq_act'), self._read('status.spd_act')
        status = DriveStatus(connected=True, setpoint=self._setpoint, actual=frequency, unit='Hz')
        status.header.stamp = stamp
        status.enabled = bool(word & 1)
        self._publish['status'].publish(status)
        self._publish['inv_st'].publish(InvSt(code=code, text=str(code)))
        self._publish['actual_frequency'].publish(Float32(data=frequency))
        self._publish['actual_speed'].publish(Float32(data=speed))
        if time.monotonic() >= self._telemetry_due:
            self._telemetry_due = time.monotonic() + _TELEMETRY_PERIOD
            telemetry = Telemetry(**{name: self._read(key) for name, key in _MEASURED.items()})
            telemetry.header.stamp = stamp
            self._publish['telemetry'].publish(telemetry)

    def _on_setpoint(self, message: Float32) -> None:
        self._setpoint = message.data
        self._write_setpoint(message.data)

    def _write_setpoint(self, value: float) -> None:
        data = _MODEL['status.frq_set'].quantise(value, 'modbus')
        words = [int.from_bytes(data[at : at + 2], 'big') for at in range(0, len(data), 2)]
        self._drive.write_registers(_MODEL['status.frq_set'].at('modbus').index, words)

    def _on_enable(
        self, request: SetBool.Request, response: SetBool.Response
    ) -> SetBool.Response:
        if request.data:
            self._write_setpoint(0.0)
            self._write('fieldbus.mode', _BUS)
        self._write('fieldbus.scmd', _RUN if request.data else _STOP)
        response.success = True
        return response

    def _on_stop(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._write('fieldbus.scmd', _STOP)
        response.success = True
        return response


def main() -> None:
    """Poll all drives, until ended."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('port')
    parser.add_argument('baud_rate', type=int)
    parser.add_argument('names', nargs='+')
    options = parser.parse_args()
    rclpy.init()
    executor = SingleThreadedExecutor()
    for address, name in enumerate(options.names, start=1):
        executor.add_node(Drive(name, address, options.port, options.baud_rate))
    executor.spin()


if __name__ == '__main__':
    main()
