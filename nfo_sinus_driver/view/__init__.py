# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A view of every drive in a terminal: what it shows and how; others know where that comes from."""
