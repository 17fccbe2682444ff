# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The version of the package, as in package.xml."""

VERSION = '0.9.0'
