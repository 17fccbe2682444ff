# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Modbus: RTU and ASCII on a serial line, and TCP; what they share is the message (:mod:`.pdu`).

The answer to a read names no register, that to a write is the request again. So on a serial line
what is believed rests on the answers before (:mod:`.serial`), and of another master what it asked
has to be known, too (:mod:`.foreign`). On TCP each answer has the number of its request.
"""
