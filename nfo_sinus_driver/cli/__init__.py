# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The command ``nfo-sinus``: looks after drives from the command line. No ROS."""
