# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Errors that the driver did not expect: it goes on, and logs them with their traceback."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import logging


class _Found(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info:
            self.texts.append(logging.Formatter().format(record))


@contextlib.contextmanager
def unexpected_errors() -> Iterator[list[str]]:
    """Collect those that are logged meanwhile."""
    found, log = _Found(), logging.getLogger('nfo_sinus_driver')
    log.addHandler(found)
    try:
        yield found.texts
    finally:
        log.removeHandler(found)
