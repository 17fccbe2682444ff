# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Shared parts of the simulated Sinus families; it is no family of its own."""
