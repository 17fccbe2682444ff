# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The node of one drive: lifecycle, set-points, services, status.

A callback of ROS decides nothing about a motor: it stores a set-point or calls a method of
:class:`~nfo_sinus_driver.drive.Drive`, whose errors :mod:`..messages.wording` explains.
"""
