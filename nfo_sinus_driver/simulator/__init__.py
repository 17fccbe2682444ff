# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive made of software, on a line made of software. Shares the catalog and nothing else."""
