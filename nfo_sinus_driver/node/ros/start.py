# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Starts ROS in a program that handles its signals itself."""

from __future__ import annotations

from collections.abc import Sequence

import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerOptions


def init_ros(arguments: Sequence[str] | None = None) -> None:
    """Begin with ROS (ValueError: it cannot, and what to do)."""
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except rclpy_implementation.RCLError as error:
        text = ' '.join(str(error).split())
        if 'log' in text and 'directory' in text:
            raise ValueError(
                'ROS has no folder for its logs, set ROS_LOG_DIR to one that can be written: '
                f'{text}'
            ) from error
        raise
