# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the makers' manuals say: a folder for each drive family, which the catalog reads.

**Only this folder, and the simulated drives, name a family or one of its parameters.** Drive
control knows roles (``actual_speed``), facts (``from_bus``) and steps. Drives differ in more than
numbers: a G2 refuses nearly everything in a fault, a MOVITRAC has no status word, behind a PLC a
word stands until the PLC has passed it on. So a family is tables for what can be listed, and a
Python file for what has an order.

- ``parameters.csv``, ``addresses.csv``, ``status_codes.csv``, ``roles.csv``: one row a fact, each
  with its place in the manual. Where manuals disagree, ``docs/readings.md`` says what is followed.
- ``words.py``: the bits of control and status words; the simulated drives read it, too. It is the
  only code of a family that both ends share; golden frames of the manuals check it.
- ``profile.py``: how to start, stop, release and acknowledge, as sequences.

**A profile says what to write, never when.** A sequence is a generator that yields steps and
receives the answer of each; a refusal is raised where the step was yielded, so each sequence says
itself what then comes. Rejected: a function from the status to the next write, which cannot say
what follows a step that was refused, lost or late; and methods with I/O of their own, which no test
could play by hand and no stop could end between two steps.

**Rules for every sequence**, which the laws hold over all connections:

- Set-point 0 before a run command, and the run command once.
- A stop takes the run command first, then the set-point, then control, and goes on after a refusal.
- What a drive echoes proves nothing: standstill, control and a run are taken from its status.
- Where a drive would run on after a fault, its run command is removed before an acknowledgement;
  where it refuses that in a fault, by the very next frame.

A drive that a file describes has the profile ``_declared/``, made from that file alone. It stays a
description: what would need a condition in the file belongs in a family of its own.
"""

#: The family of a drive whose model is not given.
USUAL = 'sinus_g2'
#: A setting of such a drive, and a value, for help and documentation.
EXAMPLE = ('control.accel', 5.0)
