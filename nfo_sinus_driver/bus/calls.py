# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Methods that any thread may call, and that run on the bus."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from concurrent.futures import Future
import functools
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

_T = TypeVar('_T')
_P = ParamSpec('_P')


class Run(Protocol):
    """Runs a coroutine on the bus."""

    def __call__(
        self, command: Callable[[], Coroutine[Any, Any, _T]], *, stops: bool = False
    ) -> Future[_T]:
        """
        Begin it with the next step of the worker.

        :param stops: it stops the motor.
        """


class OnBus(Protocol):
    """What has methods that any thread may call."""

    @property
    def run(self) -> Run:
        """Runs what such a method does."""


_Self = TypeVar('_Self', bound=OnBus)


def on_bus(
    method: Callable[Concatenate[_Self, _P], Coroutine[Any, Any, _T]], *, stops: bool = False
) -> Callable[Concatenate[_Self, _P], Future[_T]]:
    """Have a method run on the bus: it may be called from any thread, and returns a future."""

    @functools.wraps(method)
    def run(me: _Self, /, *args: _P.args, **kwargs: _P.kwargs) -> Future[_T]:
        return me.run(lambda: method(me, *args, **kwargs), stops=stops)

    return run


def stops_on_bus(
    method: Callable[Concatenate[_Self, _P], Coroutine[Any, Any, _T]],
) -> Callable[Concatenate[_Self, _P], Future[_T]]:
    """Have a method that stops the motor run on the bus, as :func:`on_bus` does."""
    return on_bus(method, stops=True)
