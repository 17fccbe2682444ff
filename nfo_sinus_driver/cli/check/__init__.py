# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``check``: what a real drive shows of the readings of its manual.

The driver rests on manuals that contradict each other in places; ``docs/readings.md`` says which
reading it follows. Here a drive is asked by frames of their own, so that no mistake of the driver's
codec hides one of its own, and nothing is written.

======================  ===========================================================================
module                  what it knows
======================  ===========================================================================
:mod:`.wire`            frames and the time that an answer takes
:mod:`.sight`           what one drive has answered so far, word by word
:mod:`.verdict`         what a drive can show of a reading
``*_readings``          of one protocol each: what looks at a drive
:mod:`.readings`        ``readings.csv``: for each reading what a drive shows of it
:mod:`.turn`            what a drive shows while its motor turns
:mod:`.report`          one screen for people, one JSON file to send
:mod:`.verb`            what may be typed, and what is done then
======================  ===========================================================================
"""
