# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The English sentences for what drives report, with what an operator types where it is read."""

from nfo_sinus_driver.wording.templates import Calls, sentence

__all__ = ['Calls', 'sentence']
