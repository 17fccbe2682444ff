# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Drives behind a PLC, which copies a block of registers to their fieldbus and back.

A word stands in the block until the PLC has taken it, and what it shows may be old. So what was
sent counts as taken only when the exchange counter has moved twice (:mod:`.telegram`); parameters
go through a mailbox with a number for each request (:mod:`.mailbox`).
"""
