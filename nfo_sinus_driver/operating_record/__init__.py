# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a drive has done, kept over restarts: hours, starts, stops, faults, energy, highest values.

It is counted from what the driver reads anyway: no request is sent for it. The total and the shift
get the same increments, as whole numbers, so that a shift is never more than the total, however
long it goes on. A file has one writer, and is replaced as a whole: a kill at any moment leaves the
one before.

Rejected: one file for all drives (a damaged one would lose them all, and two drivers could not run
beside each other); a line of a log for each event (it grows, and has to be summed up to be read).
"""
