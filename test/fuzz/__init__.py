# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A fuzz campaign through everything that turns bytes into meaning; ``make fuzz``."""
