# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What carries bytes: serial ports, device servers, connections; and where each of them is.

Ports are opened here alone. What a port's place is (:mod:`.place`) decides whether what answers
there after a reconnect may be another drive.
"""
