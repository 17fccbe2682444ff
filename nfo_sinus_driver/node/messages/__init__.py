# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Messages and sentences: what of a drive is in which field, in which unit, at which moment.

Nothing here knows a node but by its name, so that all of it can be tested without one.
"""
