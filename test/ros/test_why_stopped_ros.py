# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``~/status`` says why the motor stopped, and who wanted that."""

from __future__ import annotations

from bench import Bench, Client
from connections import needs
from lifecycle_msgs.msg import Transition
from nfo_sinus_msgs.msg import DriveStatus
from std_srvs.srv import SetBool, Trigger


def shown(client: Client, reason: int, text: str) -> None:
    """Wait until the topic has a reason, and in words."""
    client.wait_for(
        'status',
        lambda status: status.stop_reason == reason and text in status.stop_text,
        text or 'nothing',
    )


@needs('own')
def test_the_topic_says_why_it_stopped_and_who_requested_that(bench: Bench) -> None:
    simulator = bench.simulator()
    bench.driver('-p', 'setpoint_timeout:=1.0')
    client = bench.client().connected()
    name = client.node.get_fully_qualified_name()
    shown(client, DriveStatus.REASON_NONE, '')
    others = bench.client('/nfo_sinus_bus')
    commands = {
        DriveStatus.REASON_STOP: (lambda: client.call('stop'), '/nfo_sinus/stop'),
        DriveStatus.REASON_DISABLE: (
            lambda: client.call('enable', SetBool, data=False), '/nfo_sinus/enable (false)'
        ),
        DriveStatus.REASON_QUICK_STOP: (
            lambda: client.call('quick_stop'), '/nfo_sinus/quick_stop'
        ),
        DriveStatus.REASON_STOP_ALL: (
            lambda: others.call('stop_all', Trigger), '/nfo_sinus_bus/stop_all'
        ),
    }
    client_of = dict.fromkeys(commands, name)
    client_of[DriveStatus.REASON_STOP_ALL] = others.node.get_fully_qualified_name()
    for reason, (stop, service) in commands.items():
        client.call('enable', SetBool, data=True)
        shown(client, DriveStatus.REASON_NONE, '')
        stop()
        shown(client, reason, f'{service} called by {client_of[reason]}')
    client.call('enable', SetBool, data=True)
    client.publish(10.0)
    shown(client, DriveStatus.REASON_SETPOINT_TIMEOUT, 'no set-point for 1 s')
    simulator.inject('fault', '5')
    shown(client, DriveStatus.REASON_FAULT, 'Overload')
    client.call('fault_ack')
    client.call('enable', SetBool, data=True)
    client.change_state(Transition.TRANSITION_DEACTIVATE)
    shown(client, DriveStatus.REASON_LIFECYCLE, '/nfo_sinus/change_state (deactivated) called by')
