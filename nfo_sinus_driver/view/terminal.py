# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Draws the view on a whole terminal, and reads its keys, by curses."""

from __future__ import annotations

from collections.abc import Mapping
import contextlib
import curses
import io
import os
import signal
import sys
import threading
import time

from nfo_sinus_driver.view.layout import PERIOD, Layout
from nfo_sinus_driver.view.picture import Source

_KEYS = {
    curses.KEY_UP: 'up',
    curses.KEY_DOWN: 'down',
    curses.KEY_PPAGE: 'page up',
    curses.KEY_NPAGE: 'page down',
    curses.KEY_HOME: 'home',
    curses.KEY_END: 'end',
}
_QUIT = (ord('q'), 3)
_ESCAPE = 27
_COLOURS = {
    'red': curses.COLOR_RED,
    'green': curses.COLOR_GREEN,
    'yellow': curses.COLOR_YELLOW,
    'magenta': curses.COLOR_MAGENTA,
    'cyan': curses.COLOR_CYAN,
}


def show(source: Source) -> None:
    """Show the view until the operator or a signal ends it; the terminal is then as it was."""
    ended = threading.Event()
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, lambda *_: ended.set()) for number in numbers}
    # it would be written across the view
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            curses.wrapper(_run, Layout(source), ended)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.stderr.write(said.getvalue())


def _run(window: curses.window, layout: Layout, ended: threading.Event) -> None:
    styles = _styles()
    # Ctrl-C is a key, 3, and so is Ctrl-S, which would stop all that is drawn
    curses.raw()
    with contextlib.suppress(curses.error):
        curses.curs_set(0)
    due = time.monotonic()
    # a terminal that was closed is none any more
    while not ended.is_set() and sys.stdin.isatty():
        if time.monotonic() >= due:
            due = time.monotonic() + PERIOD
            layout.take_picture()
        _fit(window)
        _draw(window, layout, styles)
        window.timeout(max(0, round(1000 * (due - time.monotonic()))))
        key = window.getch()
        if key in _QUIT:
            return
        if key == _ESCAPE:
            # how keys begin that are none here, and some end in a letter that is one
            curses.flushinp()
        elif key >= 0:
            layout.press(_KEYS.get(key, chr(key)))


def _fit(window: curses.window) -> None:
    """Have the window of the size of the terminal: the signal of another one may be lost."""
    with contextlib.suppress(OSError):
        columns, lines = os.get_terminal_size(sys.stdin.fileno())
        # a serial console does not tell
        if columns and lines and (lines, columns) != window.getmaxyx():
            curses.resizeterm(lines, columns)


def _draw(window: curses.window, layout: Layout, styles: Mapping[str, int]) -> None:
    window.erase()
    height, width = window.getmaxyx()
    for line, row in enumerate(layout.rows(width, height)):
        # behind the last place of the screen there is none, which is an error, but only then
        with contextlib.suppress(curses.error):
            window.move(line, 0)
            for text, style in row:
                window.addstr(text, sum(styles.get(name, 0) for name in set(style.split())))
    window.refresh()


def _styles() -> dict[str, int]:
    """Return the attributes of each style, as far as this terminal has them."""
    styles = {
        'dim': curses.A_DIM,
        'bold': curses.A_BOLD,
        'reverse': curses.A_REVERSE,
    }
    # see no-color.org
    if curses.has_colors() and not os.environ.get('NO_COLOR'):
        curses.use_default_colors()
        for number, (name, colour) in enumerate(_COLOURS.items(), 1):
            curses.init_pair(number, colour, -1)
            styles[name] = curses.color_pair(number)
    return styles
