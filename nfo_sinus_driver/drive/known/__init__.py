# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What is known of a drive: its identity, its status, its scales, what the driver does with it.

**What counts is the status, never what was written.** What a drive has taken, a terminal may have
undone; what got no answer, it may have carried out. So all that judges a drive judges what it has
shown (:mod:`.drive_state`), and how old that is.

**Whether the motor may turn is known in one place**, the table of :mod:`.control_state`: every
command, status, loss and refusal is an event of it, and set-points are followed in ENABLED alone.
With flags in several classes, two events in an unforeseen order went wrong again and again;
``test_control_table`` goes through all states of the table with a model of drive and line.

**Whether it answers, and whether it is the same, is known in one place,** too (:mod:`.contact`).
Nothing is written to a drive that was not recognised: after a silence in which a plug can be moved,
another one may be at the address; to it, a stop may be a run command.

**From when on a motor stands, or no longer falls,** is a matter of thresholds, which are all in
:mod:`.movement`. What follows is judged where the moment is known from which it counts: a stop's
begin (:mod:`..motion.stopping`), a set-point's turn (:mod:`..motion.following`), the last event of
control (:mod:`..motion.controller`).

Nothing here decides to move a motor, or when to poll. What is in :mod:`..motion`, :mod:`..change`
and :mod:`..watch` depends on this, and this on none of them.
"""
