# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Settings, and parameters of the drive, as ROS parameters: names, descriptors, types.

rclpy accepts what it was not asked to refuse, and drops what it does not know. So each parameter
has a descriptor, a wrong type says what to write, and a misspelt name is reported with the one that
was meant.
"""
