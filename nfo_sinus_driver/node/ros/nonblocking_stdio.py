# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Keeps a stopped terminal, or a full pipe, from stopping the process."""

from __future__ import annotations

import os
import threading

_INPUT = 0
_STREAMS = (1, 2)
#: Each stream keeps a buffer of this size.
_CHUNK = 4096
_LAST_WORDS = 1.0


def open_closed_streams() -> None:
    """Open standard streams that are closed to nowhere, before another file gets their number."""
    standard = (_INPUT, *_STREAMS)
    with open(os.devnull, 'r+b', buffering=0) as nowhere:
        # each gets the lowest free number, and the last is none of the standard ones
        first = nowhere.fileno()
        others = [os.dup(first) for _ in standard]
    if first in standard:
        os.dup2(others[-1], first)
    for number in others:
        if number not in standard:
            os.close(number)


class NonblockingStdio:
    """
    Puts a pipe in front of standard output and error, and a thread behind it.

    ROS writes its log with the interpreter locked. After Ctrl-S in the terminal, or with a reader
    that does not read, one such line would stop every thread, and with them the stop of a motor.
    Now only output is lost, once the pipe is full.
    """

    def __init__(self) -> None:
        self._threads = [_begin_to_pump(descriptor) for descriptor in _STREAMS]

    def close(self) -> None:
        """Write what is waiting, for a limited time; later output goes nowhere."""
        with open(os.devnull, 'wb', buffering=0) as nowhere:
            for descriptor in _STREAMS:
                os.dup2(nowhere.fileno(), descriptor)
        for thread in self._threads:
            thread.join(_LAST_WORDS)


def _begin_to_pump(descriptor: int) -> threading.Thread:
    original = os.dup(descriptor)
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    os.dup2(writing, descriptor)
    os.close(writing)
    thread = threading.Thread(target=_pump, args=(reading, original), name='stdio', daemon=True)
    thread.start()
    return thread


def _pump(reading: int, original: int) -> None:
    while data := os.read(reading, _CHUNK):
        try:
            while data:
                data = data[os.write(original, data) :]
        except OSError:
            # the reader is gone; later output goes nowhere
            continue
