# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the Sinus drives do alike; no family of its own, but what its families are made of."""
