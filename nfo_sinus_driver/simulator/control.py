# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The control channel of a running simulator: a Unix socket, a connection for each request.

A request is a line of JSON with a ``verb`` and its ``arguments``; the answer is one with ``ok`` and
either ``result`` or ``error``, a text for people.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import contextlib
import json
import os
from pathlib import Path
import socket
import socketserver
import tempfile
import threading
import time
from typing import Any

#: How often a state that is waited for is asked for, s: it costs both ends two milliseconds.
_PERIOD = 0.02


class ControlError(Exception):
    """The simulator cannot be reached, or it refuses; the message says what to do."""


def control_path(link: str | None = None, tcp: int | None = None) -> str:
    """Return where a simulator's control channel is by default: by its link, or its TCP port."""
    if link is not None:
        return f'{link}.control'
    name = f'tcp-{tcp}' if tcp is not None else str(os.getpid())
    return str(Path(tempfile.gettempdir()) / f'nfo-simulator-{name}.control')


def require_free(path: str) -> None:
    """Ensure that no live simulator has its control channel at ``path`` (ControlError)."""
    with socket.socket(socket.AF_UNIX) as probe:
        probe.settimeout(1.0)
        try:
            probe.connect(path)
        except OSError:
            return
    raise ControlError(
        f'a simulator already serves there (control channel {path}): stop it, or choose another '
        '--link or --control'
    )


def typed(verb: str, *values: object, **flags: bool) -> list[str]:
    """Return an injection as it is typed; a value that is a boolean is on or off."""
    texts = [('off', 'on')[value] if isinstance(value, bool) else str(value) for value in values]
    # behind the dashes alone a negative number is no option
    chosen = [f'--{name}' for name, on in flags.items() if on]
    return [verb, *chosen, *(['--', *texts] if texts else [])]


class _Request(socketserver.StreamRequestHandler):
    server: ControlServer

    def handle(self) -> None:
        # a client that goes away is no error
        with contextlib.suppress(ConnectionError):
            self.wfile.write(self._answer(self.rfile.readline()).encode() + b'\n')

    def _answer(self, line: bytes) -> str:
        try:
            request = json.loads(line)
            result = self.server.verbs[request['verb']](**request.get('arguments', {}))
            return json.dumps({'ok': True, 'result': result})
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            return json.dumps({'ok': False, 'error': str(error)})


class ControlServer(socketserver.ThreadingUnixStreamServer):
    """
    Serves the control channel in threads of its own.

    :param path: the socket's path; a dead simulator's socket there is replaced.
    :param verbs: what carries out each, with its arguments; raises ``ValueError`` to refuse.
    :raises ControlError: a live simulator has it, or it cannot be made.
    """

    daemon_threads = True
    block_on_close = False
    #: Clients that come at once wait here; a full queue would turn them away.
    request_queue_size = 128

    def __init__(self, path: str, verbs: Mapping[str, Callable[..., object]]) -> None:
        require_free(path)
        self._place = Path(path)
        if self._place.exists() and not self._place.is_socket():
            raise ControlError(f'{path} is no socket: choose another --control')
        self.verbs = verbs
        try:
            self._place.unlink(missing_ok=True)
            super().__init__(path, _Request)
        except OSError as error:
            raise ControlError(
                f'cannot make the control channel {path} ({error.strerror or error}): '
                'choose another --control'
            ) from error
        threading.Thread(
            target=self.serve_forever, kwargs={'poll_interval': 0.1}, daemon=True
        ).start()

    def close(self) -> None:
        """Stop serving and remove the socket."""
        self.shutdown()
        self.server_close()
        self._place.unlink(missing_ok=True)


class Client:
    """
    Speaks to a running simulator by its control channel; a ControlError says why not.

    It may be a context manager, with nothing to close.
    """

    def __init__(self, path: str) -> None:
        self.path = path

    @classmethod
    def at_link(cls, link: str) -> Client:
        """Return a client for the simulator that serves the pseudo-terminal at ``link``."""
        return cls(control_path(link))

    def state(self, address: int | None = None) -> dict[str, Any]:
        """Return the state of a drive; without an address, of the only one."""
        result: dict[str, Any] = self.call('state', address=address)
        return result

    def states(self) -> dict[int, dict[str, Any]]:
        """Return the states of all drives, by address."""
        states: dict[str, dict[str, Any]] = self.call('states')
        return {int(address): state for address, state in states.items()}

    def inject(
        self, verb: str, *values: object, address: int | None = None, **flags: bool
    ) -> None:
        """Let something happen: a verb of ``simulator inject`` with its arguments."""
        self.call('inject', words=typed(verb, *values, **flags), address=address)

    def wait_for(
        self,
        condition: Callable[[dict[str, Any]], object],
        timeout: float = 5.0,
        address: int | None = None,
    ) -> dict[str, Any]:
        """Wait until the state of a drive fulfils a condition, and return that state."""
        end = time.monotonic() + timeout
        while True:
            state = self.state(address)
            if condition(state):
                return state
            if time.monotonic() >= end:
                shown = {key: state[key] for key in state if key != 'parameters'}
                raise TimeoutError(f'not within {timeout:g} s; the drive is at {shown}')
            time.sleep(_PERIOD)

    def call(self, verb: str, **arguments: object) -> Any:
        """Send a request and return its result."""
        request = json.dumps({'verb': verb, 'arguments': arguments}).encode() + b'\n'
        try:
            with socket.socket(socket.AF_UNIX) as connection:
                connection.settimeout(10.0)
                connection.connect(self.path)
                connection.sendall(request)
                line = connection.makefile('rb').readline()
            if not line:
                raise ConnectionResetError('it went away')
        except OSError as error:
            raise ControlError(
                f'no simulator listens at {self.path}: start one there, or name the right one '
                f'with --link or --control ({error.strerror or error})'
            ) from error
        answer = json.loads(line)
        if not answer['ok']:
            raise ControlError(answer['error'])
        return answer['result']

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        """Do nothing: a connection is for one request."""
