# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The node of a line: its statistics, and services for all drives on it.

They are of the line because a stop of all must not depend on the node of any drive.
"""
