# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A view of every drive in a terminal; what it shows comes from its source."""

from __future__ import annotations

import contextlib
import curses
import locale
import os
import sys

from nfo_sinus_driver.view.picture import Source
from nfo_sinus_driver.view.terminal import show

__all__ = ['Source', 'is_terminal', 'show', 'why_unavailable']


def is_terminal() -> bool:
    """Return whether there is one."""
    return sys.stdin.isatty() and sys.stdout.isatty()


def why_unavailable() -> str:
    """Return why the view cannot be shown here, and what to do; empty: it can."""
    if not is_terminal():
        return 'the view needs a terminal for its input and its output'
    encoding = locale.nl_langinfo(locale.CODESET)
    if encoding.lower() not in ('utf-8', 'utf8'):
        return f'the view needs a terminal with UTF-8, not {encoding}: export LC_ALL=C.UTF-8'
    with contextlib.suppress(curses.error):
        curses.setupterm()
        if curses.tigetstr('cup'):
            return ''
    return f'the view cannot be drawn with TERM={os.environ.get("TERM", "")}: export TERM=xterm'
