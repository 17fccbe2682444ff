# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with set-points that are each valid: two sources at once, or one repeated."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import math
import time
from typing import NamedTuple

#: So many changes from one source to another within so many s are two at once: one that hands over
#: to another, and has the motor back later, changes twice.
_CHANGES = 4
_WITHIN = 5.0


class Origin(NamedTuple):
    """
    Where a message came from.

    :ivar topic: its whole name.
    :ivar number: how many the publisher had sent by then; ``None``: the middleware does not count.
    """

    topic: str
    number: int | None = None


class Sources:
    """
    Notices that two sources give one drive different set-points at once.

    The middleware does not name the publisher of a message. Each counts its own messages: where a
    number is not greater than the one before on the same topic, another one has sent it.
    """

    def __init__(self) -> None:
        self._last = Origin(''), math.nan
        #: The last number of each topic.
        self._numbers: dict[str, int] = {}
        #: When a set-point came from another source than the one before, s, and their topics.
        self._changes: deque[tuple[float, frozenset[str]]] = deque(maxlen=_CHANGES)

    def take_setpoint(self, origin: Origin, value: float, now: float) -> frozenset[str]:
        """Take a set-point; return the topics of two sources at once, or nothing."""
        (before, last), self._last = self._last, (origin, value)
        another = origin.topic != before.topic
        if origin.number is not None:
            another = another or origin.number <= self._numbers.get(origin.topic, -1)
            self._numbers[origin.topic] = origin.number
        if not another or math.isnan(last) or value == last:
            return frozenset()
        self._changes.append((now, frozenset((before.topic, origin.topic))))
        if len(self._changes) < _CHANGES or now - self._changes[0][0] > _WITHIN:
            return frozenset()
        return frozenset().union(*(topics for _, topics in self._changes))


class Old(NamedTuple):
    """
    Why a stamp is not of now.

    :ivar kind: ``old``, ``ahead``, or ``repeated``.
    """

    kind: str
    text: str


class Freshness:
    """
    Whether the stamps of messages are of now.

    One that is to come would be fresh until then. It is the clock that is wrong. One that is
    repeated for longer than the time-out by the clock of this machine is not of now, whatever that
    of the node shows.

    :param clock: returns what the clock of the node shows, ns.
    """

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._repeated = Repeated()

    def why_not(self, made: int, timeout: float) -> Old | None:
        """
        Return why a stamp is not within a time-out of now; 0 is now.

        :param made: ns; the type of the message can have moments that are none for rclpy.
        :param timeout: s; 0: every stamp is of now.
        """
        if not (made and timeout):
            return None
        clock = self._clock()
        age = (clock - made) / 1e9
        if age > timeout:
            return Old('old', f'it was made {age:.1f} s ago')
        if age < -timeout:
            return Old(
                'ahead',
                f'its stamp is {-age:.1f} s ahead of the clock of this node: set the clocks of '
                'both computers alike by NTP, such as chrony, and use_sim_time of both nodes',
            )
        repeated = self._repeated.age(made, clock, time.monotonic())
        if repeated <= timeout:
            return None
        return Old(
            'repeated',
            f'for {repeated:.1f} s none has come with a newer stamp: an old one is repeated, or '
            'the clock of its publisher stands, as /clock at pause',
        )


class Repeated:
    """
    Notices that the same stamp comes again and again.

    A clock that stands, such as that of a simulation at pause, makes no stamp old.
    """

    def __init__(self) -> None:
        self._clock = 0
        #: The newest stamp since the clock was set back, and when it came, s of the steady clock.
        self._newest, self._came_at = 0, -math.inf

    def age(self, stamp: int, clock: int, now: float) -> float:
        """
        Return for how long no newer stamp has come, s.

        :param stamp: of a message that is otherwise fresh, ns.
        :param clock: what the clock of the node shows, ns.
        :param now: what the steady clock shows, s.
        """
        # a simulation that begins anew has its stamps once more
        is_back = clock < self._clock
        self._clock = clock
        if stamp > self._newest or is_back:
            self._newest, self._came_at = stamp, now
        return now - self._came_at
