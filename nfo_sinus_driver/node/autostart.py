# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Configures and activates a drive node by itself, and retries until it works."""

from __future__ import annotations

from collections.abc import Callable
import logging
import threading

_log = logging.getLogger(__name__)

#: How long it rests after a failed try, at first and at last, s: meanwhile an operator may change
#: the lifecycle, and the drives that do respond have the bus.
_REST = 1.0
_LONGEST_REST = 4.0


class Autostart:
    """
    Tries, by ``attempt``, to start one drive, on a thread that ends when the drive has started.

    A try waits for the bus; so every drive has a thread, and all are tried at once.
    """

    def __init__(self, name: str, attempt: Callable[[], bool]) -> None:
        self._attempt = attempt
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._work, name=f'autostart of {name}', daemon=True)

    def start(self) -> None:
        """Begin to try."""
        self._thread.start()

    @property
    def trying(self) -> bool:
        """This thread is the one that tries."""
        return threading.current_thread() is self._thread

    @property
    def going_on(self) -> bool:
        """It has begun, and has not started the drive yet."""
        return self._thread.is_alive() and not self.over

    @property
    def over(self) -> bool:
        """It has stopped trying."""
        return self._over.is_set()

    def give_up(self) -> None:
        """Stop trying; a try under way goes on."""
        self._over.set()

    def join(self, timeout: float) -> None:
        """Wait for the end of the thread after :meth:`give_up`, for a limited time (s)."""
        if self._thread.is_alive():
            self._thread.join(timeout)

    def _work(self) -> None:
        rest = 0.0
        while not self._over.wait(rest):
            rest = min(rest + _REST, _LONGEST_REST)
            try:
                if self._attempt():
                    self.give_up()
            except Exception:
                _log.exception('error in an autostart; it is tried again')
