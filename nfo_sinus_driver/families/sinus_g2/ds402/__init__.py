# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The G2 by the drive profile of its CANopen module: DS402 [M0 §6.4.2]."""
