# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""ROS 2 driver for NFO Sinus variable-frequency drives."""
