# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The demo: a test run of a simulated drive, recorded and drawn; and ``make run``."""
