# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Network management of CANopen, without I/O: start, boot-up, signs of life (CiA 301 §7.2.8)."""

from __future__ import annotations

from nfo_sinus_driver.link.can import Frame

#: Added to the address of a node, the identifier of its boot-up and of its heartbeat.
HEARTBEATS = 0x700
#: The node ids that there are.
NODES = range(1, 128)

_COMMANDS = 0x000
_START = 0x01
_BOOTED, _OPERATIONAL = b'\x00', b'\x05'


def heartbeat(client: int) -> Frame:
    """Return what a client sends for as long as it is there; it is this node to those who watch."""
    return Frame(HEARTBEATS + client, _OPERATIONAL)


def guarding(unit: int) -> Frame:
    """Return what asks a node for its state; one that is asked no more notices."""
    return Frame(HEARTBEATS + unit, bytes(1), remote=True)


def start(unit: int) -> Frame:
    """Return what makes a node operational; there is no answer to it."""
    return Frame(_COMMANDS, bytes((_START, unit)))


def booted(frame: Frame) -> int | None:
    """Return which node has started anew; ``None``: the frame says nothing of the kind."""
    unit = frame.identifier - HEARTBEATS
    return unit if unit in NODES and frame.data == _BOOTED else None
