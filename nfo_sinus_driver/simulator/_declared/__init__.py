# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Simulated drives that a file describes; of the driver's side they know nothing but that file."""
