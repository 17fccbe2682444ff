# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The executor of one node: its thread sleeps until a request comes for this node.

Services have no order among them: of two requests the later may be taken first. So each request
has the time at which it was received.

A new client may call before the middleware knows where its answer goes, which it then drops. So
this sends the answer again.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
import contextlib
from contextvars import ContextVar
import logging
import threading
import time
from typing import Any
import warnings

from rclpy.exceptions import InvalidHandle
from rclpy.executors import (
    ConditionReachedException,
    Executor,
    ExternalShutdownException,
    ShutdownException,
    TimeoutException,
    await_or_execute,
)
from rclpy.node import Node
from rclpy.service import Service
from rclpy.task import Task

_log = logging.getLogger(__name__)

#: What rclpy raises when there is nothing to run.
_NOTHING = (
    ConditionReachedException, ExternalShutdownException, ShutdownException, TimeoutException
)

#: No request waits for its turn for longer, s: a start delay before it may last an hour.
_LONGEST_WAIT = 4000.0
#: When an answer that was dropped is sent again, s after the last time. Each vain try holds up all
#: threads for 0.1 s, for rclpy lets none of them run while the middleware waits.
_SENT_AGAIN_AFTER = (0.2, 0.5, 2.0)
#: How rclpy reports that an answer was dropped: as a warning, which is not shown a second time.
_DROPPED = 'failed to send response'
_received: ContextVar[float] = ContextVar('received')


def received_at() -> float:
    """
    Return when the request was received that this thread is serving, s, monotonic.

    It is the present where the middleware does not say.
    """
    return _received.get(time.monotonic())


def _received_at(received: int) -> float:
    """Return the moment of a wall time in ns, s, monotonic; the present if it cannot be one."""
    ago = (time.time_ns() - received) / 1e9
    # a middleware may give 0 or another epoch, and the clock may be set just now
    return time.monotonic() - (ago if 0.0 <= ago <= _LONGEST_WAIT else 0.0)


class NodeExecutor(Executor):
    """
    Runs the callbacks of one node, each on a thread of a pool.

    An executor of rclpy looks through everything of all its nodes before it waits again. This has
    one node, so that a call to one drive costs the same however many there are, and no time-out,
    so that it sleeps while no request comes.

    :param threads: how many callbacks may be waiting for something at once.
    """

    def __init__(self, node: Node, threads: int) -> None:
        super().__init__()
        name = f'executor of {node.get_name()}'
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix=name)
        self._ending = False
        self._thread = threading.Thread(target=self._serve, name=name, daemon=True)
        self.add_node(node)

    def start(self) -> None:
        """Begin to serve."""
        warnings.filterwarnings('error', _DROPPED, RuntimeWarning)
        self._thread.start()

    @property
    def alive(self) -> bool:
        """The thread works."""
        return self._thread.is_alive()

    def end(self) -> None:
        """Begin no more callbacks."""
        self._ending = True
        self.wake()

    def join(self, timeout: float) -> None:
        """Wait for the end of the thread after :meth:`end`, for a limited time."""
        self._thread.join(timeout)

    def finish(self) -> None:
        """Wait for the callbacks that run."""
        self._pool.shutdown()

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait for one callback and begin it, as every executor does."""
        try:
            task, _, _ = self.wait_for_ready_callbacks(timeout_sec, None, self._is_ending)
        except _NOTHING:
            return
        begun = threading.Event()
        self._pool.submit(_run, task, begun)
        # until then rclpy would hand out the same again and again
        begun.wait()

    def _take_service(self, srv: Service) -> Callable[[], Awaitable[None]] | None:
        """Take a request as rclpy does, which forgets when it was received."""
        try:
            with srv.handle:
                request, header = srv.handle.service_take_request(srv.srv_type.Request)
        except InvalidHandle:
            # the service is being destroyed
            return None
        if header is None:
            return _do_nothing
        received = _received_at(header.received_timestamp)

        async def answer() -> None:
            token = _received.set(received)
            try:
                response = await await_or_execute(srv.callback, request, srv.srv_type.Response())
            finally:
                _received.reset(token)
            self._respond(srv, response, header)

        return answer

    def _respond(
        self,
        srv: Service,
        response: Any,
        header: Any,
        again_after: tuple[float, ...] = _SENT_AGAIN_AFTER,
    ) -> None:
        """Send an answer, and soon again if the middleware does not know yet where to."""
        try:
            srv.send_response(response, header)
        except InvalidHandle:
            # the service was destroyed meanwhile
            return
        except (RuntimeWarning, SystemError) as error:
            if not _is_dropped(error):
                raise
        else:
            return
        if not again_after:
            with contextlib.suppress(InvalidHandle):
                _log.warning(
                    'an answer of %s was dropped by the middleware, which does not find the '
                    'caller: it may be gone; if it waits, call again', srv.service_name,
                )
            return
        # not on a thread of the pool, for the next call may need it
        timer = threading.Timer(
            again_after[0], self._respond, (srv, response, header, again_after[1:])
        )
        timer.daemon = True
        timer.start()

    def _is_ending(self) -> bool:
        return self._ending

    def _serve(self) -> None:
        while not self._ending and self._context.ok():
            try:
                self.spin_once()
            except Exception:
                _log.exception('error in an executor; it goes on')


def _is_dropped(error: BaseException) -> bool:
    """Whether rclpy says that an answer was dropped, itself or as the cause of another error."""
    while not isinstance(error, RuntimeWarning):
        if error.__cause__ is None:
            return False
        error = error.__cause__
    return _DROPPED in str(error)


async def _do_nothing() -> None:
    """Another thread has taken the request."""


def _run(task: Task, begun: threading.Event) -> None:
    begun.set()
    task()
    error = task.exception()
    if error is not None:
        # a mistake in one callback must not take the others with it
        _log.error('error in a callback; the driver goes on', exc_info=error)


def end_all(executors: Iterable[NodeExecutor], timeout: float) -> None:
    """Let callbacks end before what they use is destroyed, within a limited time (s)."""
    executors = list(executors)
    for executor in executors:
        executor.end()
    deadline = time.monotonic() + timeout
    for executor in executors:
        executor.join(max(0.0, deadline - time.monotonic()))

    def finish_all() -> None:
        for executor in executors:
            executor.finish()

    waiter = threading.Thread(target=finish_all, daemon=True)
    waiter.start()
    waiter.join(timeout)


@contextlib.contextmanager
def spinning(executor: Executor) -> Iterator[None]:
    """Spin an executor of rclpy on a thread that ends before what it waits for is gone."""
    ended = threading.Event()

    def spin() -> None:
        with contextlib.suppress(ExternalShutdownException):
            while not ended.is_set():
                executor.spin_once()

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    try:
        yield
    finally:
        executor.create_task(ended.set)
        thread.join()
        executor.shutdown()
