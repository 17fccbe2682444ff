# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Prints, as that of ros2doctor does."""

import sys


def doctor_warn(message: str) -> None:
    print(f'UserWarning: {message}', file=sys.stderr)


def doctor_error(message: str) -> None:
    print(f'UserWarning: ERROR: {message}', file=sys.stderr)
