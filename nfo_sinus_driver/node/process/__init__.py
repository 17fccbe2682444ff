# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The process: its command line, its nodes, and how it ends.

A signal is taken before ROS is loaded, and every way out stops the motors first.
"""
