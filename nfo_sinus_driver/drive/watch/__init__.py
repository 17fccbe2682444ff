# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
When to look at a drive: its status and set-points in use, its measurements, its error log.

A poll has no side effects: what acknowledges a fault is never read unless a person asks. What is
read here is judged elsewhere (:mod:`..motion`); what is lost here is a loss there.
"""
