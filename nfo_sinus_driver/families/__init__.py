# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the makers' manuals say: a folder for each drive family, which the catalog reads."""

#: The family of a drive whose model is not given.
USUAL = 'sinus_g2'
#: A setting of such a drive, and a value, for help and documentation.
EXAMPLE = ('control.accel', 5.0)
