# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Bags: one writer and one reader, for the recorder, the demo and the black box of a line.

It knows messages by their types and bytes alone, so that what is recorded is what was published.
"""
