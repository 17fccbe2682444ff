# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What ends a process that drives motors: which signals, which it must not obey, how it gets them; and
the end of the process that it was started by.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import select
import signal

#: Signals that would suspend a process and leave the motors running.
SUSPENDING = frozenset((signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU))
#: Signals that end no process, or that cannot or must not be caught: those of a crash.
_OTHERS = frozenset(
    (
        signal.SIGCHLD,
        signal.SIGCONT,
        signal.SIGURG,
        signal.SIGWINCH,
        signal.SIGPIPE,
        signal.SIGKILL,
        signal.SIGSTOP,
        signal.SIGBUS,
        signal.SIGFPE,
        signal.SIGILL,
        signal.SIGSEGV,
        signal.SIGSYS,
    )
)
#: Every other signal ends a process, and therefore stops the motors first.
ENDING = frozenset(signal.valid_signals()) - SUSPENDING - _OTHERS


def signal_name(number: int) -> str:
    """Return what a signal is called."""
    try:
        return signal.Signals(number).name
    except ValueError:
        # the real-time signals have no names but the first and the last
        return f'signal {number}'


_HELD = ENDING | SUSPENDING
#: What has held signals is all that this process is for: see :func:`hold_to_the_end`.
_to_the_end = False


def hold_to_the_end() -> None:
    """
    Have signals that were held stay so after it, until the process ends by itself.

    What is done then has an exit status, which one more signal would take the place of. For the
    main function of a command alone: it has to end.
    """
    global _to_the_end
    _to_the_end = True


def are_held_to_the_end() -> bool:
    """Return whether signals that were held stay so."""
    return _to_the_end


class HeldSignals:
    """
    Holds signals back until they are asked for: nothing may end or freeze who drives a motor.

    Whatever was inherited, ignored signals too, counts for nothing while the ``with`` block lasts.
    It has to begin in the main thread and before any other does, for a thread that does not hold
    them may get them; from there they are passed on, too.
    """

    def __init__(self) -> None:
        self._cleanup = contextlib.ExitStack()
        self._came = -1

    def __enter__(self) -> HeldSignals:
        self.hold()
        return self

    def hold(self) -> None:
        """Begin without a ``with`` block, for as long as the process lasts."""
        with contextlib.ExitStack() as cleanup:
            blocked = signal.pthread_sigmask(signal.SIG_BLOCK, _HELD)
            cleanup.callback(signal.pthread_sigmask, signal.SIG_SETMASK, blocked)
            self._came, wakeup = os.pipe()
            for end in (self._came, wakeup):
                cleanup.callback(os.close, end)
                os.set_blocking(end, False)
            # each signal that comes to any thread leaves its number there
            before = signal.set_wakeup_fd(wakeup, warn_on_full_buffer=False)
            cleanup.callback(signal.set_wakeup_fd, before)
            for number in _HELD:
                cleanup.callback(_put_back, number, signal.signal(number, _noted))
            # what was not requested would end it when all is done
            cleanup.callback(self._forget)
            self._cleanup = cleanup.pop_all()

    def __exit__(self, *_: object) -> None:
        if not _to_the_end:
            self._cleanup.close()

    def next(self, timeout: float) -> int | None:
        """Return the next signal, or ``None`` when none came in time, s."""
        # not sigtimedwait: when it was suspended meanwhile, CPython takes for a signal what
        # happens to be in its memory
        with _let_through():
            select.select([self._came], [], [], timeout)
        try:
            while number := os.read(self._came, 1):
                if number[0] in _HELD:
                    return number[0]
        except BlockingIOError:
            pass
        return None

    def _forget(self) -> None:
        while self.next(0.0) is not None:
            continue


@contextlib.contextmanager
def _let_through() -> Iterator[None]:
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _HELD)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_BLOCK, _HELD)


def _noted(*_: object) -> None:
    """Nothing more: its number has been left already."""


def _put_back(number: int, handler: signal._HANDLER) -> None:
    # one that does not come from Python cannot be
    if handler is not None:
        signal.signal(number, handler)


class OtherProcess:
    """
    A process of another user, such as the one that started this one.

    :raises ProcessLookupError: there is none of that number.
    """

    def __init__(self, pid: int) -> None:
        self.pid = pid
        os.kill(pid, 0)
        try:
            # its number may be given to another one later
            self._descriptor: int | None = os.pidfd_open(pid)
        except ProcessLookupError:
            raise
        except OSError:
            # some containers forbid it
            self._descriptor = None

    @property
    def ended(self) -> bool:
        """It has ended, waited for by its parent or not."""
        if self._descriptor is not None:
            readable, _, _ = select.select([self._descriptor], [], [], 0)
            return bool(readable)
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return True
        except PermissionError:
            # it is there, of another user
            pass
        return False


def ros2_parent(pid: int) -> OtherProcess | None:
    """
    Return the parent of that number if it is the ``ros2`` command, else ``None``.

    ``ros2 run`` and ``ros2 launch`` can end without a word to what they have started. Of any other
    parent nothing is known: a script may leave the driver to itself on purpose.
    """
    try:
        words = Path(f'/proc/{pid}/cmdline').read_bytes().split(b'\0')
        # the second word where an interpreter runs it
        is_ros2 = any(os.path.basename(word) == b'ros2' for word in words[:2])
        return OtherProcess(pid) if is_ros2 else None
    except OSError:
        # it has ended already, or this system does not say
        return None
