# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A simulated Santerno Sinus H behind its PROFINET module [M3]."""
