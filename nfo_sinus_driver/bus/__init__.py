# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What is sent next on one line: the scheduler, its tasks, and its counters.

**One thread owns the line.** A line carries one transaction at a time, so more threads would only
wait for each other; with one, what coroutines share needs no lock. Everything that takes several
transactions (an enable, a stop, reading a log) is a coroutine, which the worker steps from one
transaction to the next. What other threads want is put into an inbox.

**A request is ranked again before each transaction**, so a stop waits for the one on the line and
for nothing else. Of a set-point only the newest counts: it has a slot (:class:`LatestValue`) and no
queue, and its value is made when its turn comes. A command that must not be carried out late says
so by ``require_wanted``, which is called at that moment, too.

**What is urgent may not take the whole line.** Each rule of the scheduler has its case:

- Set-points may come faster than the line carries them, and without polls a fault goes unnoticed:
  after each set-point something else has a turn.
- On a full line telemetry would never come: it and the repeated reading of settings have a share
  of the time.
- A drive without power costs a whole time-out with each request, and would slow all others: those
  that do not answer have a share together, a small one after two seconds.
- The stop of such a drive would keep the line from the stops of its neighbours, and one that is
  recognised and hardly answers from their polls: after each stop or service without an answer
  another drive has a turn, and none for which as much was in vain.

**Silence is no loss, and a mute port no silent drive.** :class:`~.silences.Silences` has for how
long each unit has not answered, and since when another drive may be in its place (law 11). Where no
unit answers, the port is opened again (:mod:`.mute_port`): some adapters pass nothing until then
and report no error; others restart by it and need time for that, so the pauses grow.

**Time in which this process did not run** (a suspended or overloaded machine) is no silence of a
drive; what was read meanwhile may be old, and is read again (:mod:`..link.thread_clock`).

What a public call guarantees:

===================  =============================================================================
:meth:`Bus.run`      It waits for nothing. The coroutine begins with the next step of the worker;
                     its future always ends, with the bus at the latest.
``stops=True``       Besides: what the link only listens for is cut short.
:meth:`Bus.request`  It waits for nothing. The newest value is made and written in its turn.
:meth:`Bus.close`    The transaction on the line is over, the port is closed, every coroutine has
                     ended: nothing more is sent. It stops no motor. A transaction that takes longer
                     than ``timeout`` is not waited for.
===================  =============================================================================

Rejected: asyncio (with it, a command took two to four times as long from another thread to the
link, and virtual time is harder); a thread for each drive (the line is the limit); repeats for all
in one place of the worker (it hides how often a status was missed, which drive control counts).
"""

from nfo_sinus_driver.bus.by_address import ByAddress
from nfo_sinus_driver.bus.calls import Run, on_bus, stops_on_bus
from nfo_sinus_driver.bus.lock import Lock
from nfo_sinus_driver.bus.silences import SWAP_TIME
from nfo_sinus_driver.bus.statistics import Statistics
from nfo_sinus_driver.bus.tasks import Cancelled, LatestValue, Priority, Request, Task
from nfo_sinus_driver.bus.worker import Bus, Watch

__all__ = [
    'SWAP_TIME',
    'Bus',
    'ByAddress',
    'Cancelled',
    'LatestValue',
    'Lock',
    'Priority',
    'Request',
    'Run',
    'Statistics',
    'Task',
    'Watch',
    'on_bus',
    'stops_on_bus',
]
