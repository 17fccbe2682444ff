# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The last minute of a line, in memory, and a bag of it at each stop that was not asked for.

What is kept are the values that are published anyway; bytes are made of them only when there is
something to tell. A thread of its own writes, and pauses often: neither the bus nor what is
published waits for it. A bag that cannot be written is a warning, and nothing else.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
import logging
from pathlib import Path
import shutil
import struct
import threading
import time
from typing import Any

from rclpy.qos import QoSProfile

from nfo_sinus_driver.node.bags import bags
from nfo_sinus_driver.version import VERSION

_log = logging.getLogger(__name__)

#: So many values are kept at most, of all drives of a line together.
_MOST = 30_000
#: For how long it goes on after what it tells of, and how far apart two bags are at least, s.
_AFTER, _LEAST_APART = 2.0, 10.0
#: So many bytes its bags may have together; the oldest go first.
_MOST_BYTES = 200_000_000
#: After how many values the writer pauses, and for how long, s.
_AT_ONCE, _PAUSE = 20, 0.002
#: How long the end waits for a bag that is due, s.
_LAST_BAG = 3.0

_Keep = Callable[[float, Any], None]


@dataclass(eq=False)
class _Stream:
    """
    One topic of one drive.

    :ivar make: returns the bytes of a value of a moment of ``time.monotonic``.
    :ivar before: the newest value that is too old, of what holds until it changes.
    """

    topic: str
    type_: type
    qos: QoSProfile
    make: Callable[[float, Any], bytes]
    holds: bool
    before: list[Any] = field(default_factory=list)


class BlackBox:
    """
    The black box of one line.

    :param seconds: how much of the past it keeps; 0: none, and then nothing here costs anything.
    :param folder: returns where its bags go (OSError: there is no such place).
    :param warn: logs a line.
    """

    def __init__(
        self, seconds: float, folder: Callable[[], Path], warn: Callable[[str], object]
    ) -> None:
        self._seconds = seconds
        self._folder = folder
        self._warn = warn
        self._kept: deque[tuple[float, _Stream, Any]] = deque(maxlen=_MOST)
        self._streams: list[_Stream] = []
        #: What is to be told by the next bag, and since when.
        self._reasons: list[str] = []
        self._due = threading.Condition()
        self._closing = self._has_warned = False
        self._thread = threading.Thread(target=self._work, name='black box', daemon=True)

    @property
    def is_on(self) -> bool:
        """Something is kept."""
        return self._seconds > 0

    def start(self) -> None:
        """Begin to wait for something to tell."""
        if self.is_on:
            self._thread.start()

    def stream(
        self,
        topic: str,
        type_: type,
        qos: QoSProfile,
        make: Callable[[float, Any], bytes],
        *,
        holds: bool = False,
    ) -> _Keep:
        """
        Return what keeps a value of a topic, with its moment of ``time.monotonic``; any thread may.

        :param qos: what its publisher offers.
        :param holds: a value counts until the next one, so a bag begins with it.
        """
        if not self.is_on:
            return _nothing
        stream = _Stream(topic, type_, qos, make, holds)
        self._streams.append(stream)
        append = self._kept.append

        def keep(at: float, value: Any) -> None:
            append((at, stream, value))
            self._forget(at - self._seconds)

        return keep

    def testify(self, why: str) -> None:
        """Have a bag written soon; any thread may call it."""
        if self.is_on:
            with self._due:
                self._reasons.append(why)
                self._due.notify_all()

    def close(self) -> None:
        """Write a bag that is due, and no more."""
        with self._due:
            self._closing = True
            self._due.notify_all()
        if self._thread.is_alive():
            self._thread.join(_LAST_BAG)

    def _forget(self, before: float) -> None:
        """Drop what is older than a moment; another thread may do so meanwhile."""
        kept = self._kept
        try:
            while kept[0][0] < before:
                _, stream, value = kept.popleft()
                if stream.holds:
                    stream.before[:] = [value]
        except IndexError:
            # it is empty
            return

    # --- on its own thread --------------------------------------------------------------------

    def _work(self) -> None:
        # imported now: after a stop that would keep the other motors of the line waiting
        bags.why_none()
        while self._wait_for_reasons():
            with self._due:
                reasons, self._reasons = self._reasons, []
            try:
                self._write('; '.join(dict.fromkeys(reasons)))
                self._has_warned = False
            except OSError as error:
                if not self._has_warned:
                    self._has_warned = True
                    self._warn(f'the black box cannot write a bag: {error}')
            except Exception:
                _log.exception('the black box has not written a bag')
            with self._due:
                self._due.wait_for(lambda: self._closing, _LEAST_APART)

    def _wait_for_reasons(self) -> bool:
        """Wait until there is something to tell, and for what follows it; false at the end."""
        with self._due:
            self._due.wait_for(lambda: self._reasons or self._closing)
            self._due.wait_for(lambda: self._closing, _AFTER)
            return bool(self._reasons)

    def _write(self, why: str) -> None:
        folder = self._folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        _make_room(folder)
        kept = list(self._kept)
        begin = kept[0][0] if kept else time.monotonic()
        held = [(begin, stream, stream.before[0]) for stream in self._streams if stream.before]
        # threads may have kept what they measured a little later
        found = sorted((*held, *kept), key=lambda one: one[0])
        clock = time.time_ns() - time.monotonic_ns()
        bag = bags.create(_free(folder), {'why': why, 'nfo_sinus_driver': VERSION})
        try:
            topics = {stream.topic: stream for stream in self._streams}
            for stream in topics.values():
                bag.add_topic(stream.topic, stream.type_, stream.qos)
            for number, (at, stream, value) in enumerate(found, 1):
                try:
                    data = stream.make(at, value)
                except (OverflowError, ValueError, struct.error):
                    # what could not be published is not in it either
                    continue
                bag.write(stream.topic, clock + round(at * 1e9), data)
                if number % _AT_ONCE == 0 and not self._closing:
                    time.sleep(_PAUSE)
        finally:
            bag.close()


def _nothing(_at: float, _value: object) -> None:
    """Keep nothing: the black box is off."""


def _free(folder: Path) -> Path:
    """Return the name of a bag that is not there yet."""
    path = folder / time.strftime('%Y-%m-%d_%H-%M-%S')
    number = 1
    while path.exists():
        number += 1
        path = folder / f'{time.strftime("%Y-%m-%d_%H-%M-%S")}_{number}'
    return path


def _make_room(folder: Path) -> None:
    """Remove the oldest bags until the others are within their bound."""
    found = sorted(path.parent for path in folder.glob('[0-9]*-*_*-*-*/metadata.yaml'))
    sizes = {bag: sum(file.stat().st_size for file in bag.iterdir()) for bag in found}
    while sizes and sum(sizes.values()) > _MOST_BYTES:
        oldest = next(iter(sizes))
        shutil.rmtree(oldest)
        del sizes[oldest]
