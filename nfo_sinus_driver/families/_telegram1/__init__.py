# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What telegram 1 through a PLC or gateway is the same in, whatever family is behind it."""
