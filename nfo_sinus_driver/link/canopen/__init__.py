# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
CANopen: SDO transfers, the supervision of nodes, and the adapters that carry frames.

An SDO answer names its object, so that a late one is recognised. What differs is the medium: frames
of others come all the time, and an adapter may have gone to bus-off (:mod:`.can`,
:mod:`.netlink`), or be a serial one (:mod:`.lawicel`).
"""
