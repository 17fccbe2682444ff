# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Transactions on one line, one at a time. No ROS, no knowledge of drives or parameters.

What is wanted of a unit is a value (``Read``, ``Write``, ``WriteAndRead``, ``ReadThenWrite``,
``Ask``), with an address and bytes that mean nothing here; ``carry_out`` has the link of a protocol
do it. A link returns a reply, or raises an error that says two things: whether the unit answered
(its type), and whether it may have carried out the request (``maybe_done``).

**Nothing received is believed because it fits.** A Modbus answer does not say which register it is
from, and after a missing answer the next frame of the right shape may be the late one: an old
"stopped" would confirm a stop. So a frame is believed only if no earlier request can have caused
it (:mod:`.late_replies`). If one can, a request with an answer of another kind goes first: answers
come in order, so all late ones have come before that one.
A write is sent at once all the same, for it may be a stop; only its answer is not trusted then.

**A line is not ours alone.** Half-duplex adapters return what is sent, other masters ask the same
units, and what they hear is no answer to us (:mod:`.foreign_traffic`). On a line that is never
silent, writes go out into the noise.

**Nothing is repeated here that has an effect:** no write, and no read that acknowledges (``once``);
what comes of a run command, the status shows. Another read is, where another master has damaged its
answer or a gateway has closed the connection. Where an operation is several transactions, a stop
goes between them, but never between a read and the write that depends on it.

**Frames are coded here, not by a library.** pymodbus codes the simulator's side: one mistake cannot
be on both ends, and ours take a third of its time. pyserial opens and sets a port; its descriptor
is read and written directly, because a frame ends by its length or by a silence of 3.5 characters,
while a read of pyserial ends by a number of bytes or a time-out.

====================  ============================================================================
``carry_out``
====================  ============================================================================
returns               The unit has answered this request and no other: a read gives what it held
                      between request and answer (behind a PLC: what that had of it at
                      ``arrived``), a write was taken.
raises ``NotSent``    Nothing was sent.
raises ``NotReady``   Nothing was sent, or one transaction of several was done: call again, later.
raises ``Refused``    The unit answered that it did not do it.
raises ``NoAnswer``,  The unit may have done it, unless ``maybe_done`` is false; read what came of
``DamagedAnswer``     it.
raises ``PortError``  The port is lost. What was sent just before, the unit may have done.
====================  ============================================================================

Rejected: one pause after each lost answer that is long enough for any late one (a stop would wait
for it, too); a link with threads or callbacks of its own (only the bus knows what is urgent).
"""

from nfo_sinus_driver.link.interface import (
    MAILBOX,
    Address,
    AnotherValue,
    Ask,
    Clock,
    Connecting,
    DamagedAnswer,
    GatewayFault,
    GatewayLate,
    GatewaySilent,
    Identification,
    InProgress,
    Interrupted,
    LineProtocol,
    LineSettings,
    Link,
    LinkError,
    MailboxSilent,
    NoAnswer,
    NoData,
    NoPath,
    NotReady,
    NotSent,
    Operation,
    Plan,
    PortError,
    Read,
    ReadThenWrite,
    Refused,
    Remarks,
    Reply,
    Supervision,
    Unconfirmed,
    Why,
    Write,
    WriteAndRead,
    Written,
    silent,
)
from nfo_sinus_driver.link.ports.reconnect import Reconnect
from nfo_sinus_driver.link.protocols import ADDRESSES, BIT_RATES, PROTOCOLS, BusSettings, open_link

__all__ = [
    'ADDRESSES',
    'BIT_RATES',
    'MAILBOX',
    'PROTOCOLS',
    'Address',
    'AnotherValue',
    'Ask',
    'BusSettings',
    'Clock',
    'Connecting',
    'DamagedAnswer',
    'GatewayFault',
    'GatewayLate',
    'GatewaySilent',
    'Identification',
    'InProgress',
    'Interrupted',
    'LineProtocol',
    'LineSettings',
    'Link',
    'LinkError',
    'MailboxSilent',
    'NoAnswer',
    'NoData',
    'NoPath',
    'NotReady',
    'NotSent',
    'Operation',
    'Plan',
    'PortError',
    'Read',
    'ReadThenWrite',
    'Reconnect',
    'Refused',
    'Remarks',
    'Reply',
    'Supervision',
    'Unconfirmed',
    'Why',
    'Write',
    'WriteAndRead',
    'Written',
    'open_link',
    'silent',
]
