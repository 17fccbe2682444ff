# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Sinus H of Enertronica Santerno, through a PLC on PROFINET [M3]."""
