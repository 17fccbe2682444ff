# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""TCP ports for the servers of tests."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import socket


@contextlib.contextmanager
def reserved() -> Iterator[int]:
    """Have the number of a TCP port that is given to nothing else, and that can yet be served."""
    with socket.socket() as claim:
        claim.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        claim.bind(('127.0.0.1', 0))
        yield claim.getsockname()[1]
