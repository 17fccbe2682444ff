# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A view of every drive in a terminal, where there is one; what it shows comes from its source."""

from __future__ import annotations

import importlib.metadata
import sys

from nfo_sinus_driver.view.picture import Source

#: Ubuntu 24.04 has no such version, and there `pip` refuses to install beside its packages.
_INSTALL = 'pip install "textual>=3" (on Ubuntu in an environment of its own: docs/monitor.md)'


def is_terminal() -> bool:
    """Return whether there is one; what draws the view writes to the standard error."""
    return all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))


def why_unavailable() -> str:
    """Return why the view cannot be shown here, and what to do; empty: it can."""
    if not is_terminal():
        return 'the view needs a terminal for its input, its output and its errors'
    encoding = (sys.stdout.encoding or '').lower()
    if encoding not in ('utf-8', 'utf8'):
        return f'the view needs a terminal with UTF-8, not {encoding}: export LC_ALL=C.UTF-8'
    try:
        version = importlib.metadata.version('textual')
    except importlib.metadata.PackageNotFoundError:
        return f'the view needs the library textual, 3 or newer: {_INSTALL}'
    if int(version.split('.')[0]) < 3:
        return f'the view needs the library textual, 3 or newer, not {version}: {_INSTALL}'
    return ''


def show(source: Source) -> None:
    """Show the view until the operator ends it; call :func:`why_unavailable` first."""
    # only here: without the view textual is not needed
    from nfo_sinus_driver.view.app import MonitorApp

    MonitorApp(source).run()
