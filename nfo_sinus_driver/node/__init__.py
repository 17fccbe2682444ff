# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""ROS 2 and nothing else: parameters, topics, services, action, diagnostics, lifecycle."""

import os

# A field of a wrong type would end the whole process by an assertion in C, with the motors
# running; checked in Python it is an exception. It is read when the messages are imported.
os.environ.setdefault('ROS_PYTHON_CHECK_FIELDS', '1')
