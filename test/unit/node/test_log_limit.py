# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""An error that comes with every message is logged once in ten seconds, and the others counted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import io
import logging
import sys
import threading
import time

import pytest

from nfo_sinus_driver.node.ros.log_limit import PERIOD, LogLimit, limit_errors
from nfo_sinus_driver.node.ros.publish_queue import PublishQueue

_log = logging.getLogger('nfo_sinus_driver.made_up')
#: Far longer than anything here takes, s.
PATIENCE = 20.0


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The steady clock, s, as a list of one."""
    moment = [1000.0]
    monkeypatch.setattr(time, 'monotonic', lambda: moment[0])
    return moment


@pytest.fixture
def output(monkeypatch: pytest.MonkeyPatch) -> Iterator[io.StringIO]:
    """What a process that limits its errors writes to standard error."""
    written = io.StringIO()
    monkeypatch.setattr(sys, 'stderr', written)
    monkeypatch.setattr(threading, 'excepthook', threading.excepthook)
    handler = limit_errors()
    yield written
    logging.getLogger().removeHandler(handler)


@pytest.fixture
def ends_thread(output: io.StringIO) -> Callable[..., object]:
    """What is called with an error that ends a thread; older pytest puts its own there later."""
    return threading.excepthook


def fail(error: Exception) -> None:
    raise error


def catch(error: Exception) -> None:
    """Log an error, as everything that calls something does."""
    try:
        fail(error)
    except Exception:
        _log.exception('error in a callback')


def test_each_kind_is_logged_once_in_a_period_and_says_how_many_were_not() -> None:
    limit = LogLimit()
    # 200 times a second, of two kinds
    found = [
        (tick / 200, kind, left_out)
        for tick in range(200 * 25)
        for kind in ('one', 'other')
        if (left_out := limit.left_out(kind, 1000 + tick / 200)) is not None
    ]
    assert found == [
        (moment, kind, left_out)
        for moment, left_out in ((0.0, 0), (PERIOD, 1999), (2 * PERIOD, 1999))
        for kind in ('one', 'other')
    ]


@pytest.mark.provokes
def test_an_error_with_every_message_is_logged_once_in_ten_seconds(
    now: list[float], output: io.StringIO
) -> None:
    for tick in range(200 * 15):
        now[0] = 1000 + tick / 200
        # what differs in its text is the same kind
        catch(ValueError(f'number {tick}'))
        catch(KeyError('missing'))
    text = output.getvalue()
    assert text.count('Traceback') == 4
    assert text.count('error in a callback (1999 of the same were not logged)') == 2
    assert 'ValueError: number 0\n' in text and 'ValueError: number 2000\n' in text


def test_what_is_no_error_is_not_limited(output: io.StringIO) -> None:
    for number in range(5):
        _log.warning('answer %d was dropped', number)
    assert output.getvalue().splitlines() == [f'answer {n} was dropped' for n in range(5)]


@pytest.mark.provokes
def test_what_ends_a_thread_is_logged_the_same_way(
    output: io.StringIO, ends_thread: Callable[..., object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(threading, 'excepthook', ends_thread)
    for _ in range(20):
        thread = threading.Thread(target=fail, args=(ValueError('oops'),))
        thread.start()
        thread.join()
    assert output.getvalue().count('Traceback') == 1
    assert 'error in a thread' in output.getvalue()


@pytest.mark.provokes
def test_messages_that_cannot_be_sent_are_logged_once_and_silence_no_other(
    output: io.StringIO,
) -> None:
    queue = PublishQueue()
    sent = threading.Event()
    for _ in range(500):
        queue.put(lambda: 1 / 0)
    queue.put(sent.set)
    queue.start()
    assert sent.wait(PATIENCE)
    queue.close()
    assert output.getvalue().count('a message could not be published') == 1
