# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What rclpy does not do, or does otherwise than a driver needs: executors, publishing, log, terminal.

Each file has one such case; what is private in rclpy is used in :mod:`.rclpy_internals` alone.
"""
