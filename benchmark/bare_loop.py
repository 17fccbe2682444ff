# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.
"""
The least that a master in Python can do; a process of its own.

Sends the requests of a cycle over and over: raw descriptor, ``select``, answers of known length, a
sleep of t3.5 before each request. It neither makes nor checks a frame. It runs until it is ended.
"""

from __future__ import annotations

import argparse
import itertools
import os
import select
import time
import tty

import recorded_cycle

_TIMEOUT = 0.5


def main() -> None:
    """Run until somebody ends it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('port')
    parser.add_argument('gap', type=float, help='between an answer and the next request, s')
    parser.add_argument('cycle')
    options = parser.parse_args()
    cycle = recorded_cycle.load(options.cycle)
    gap = options.gap
    port = os.open(options.port, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(port)
    for request, length in itertools.cycle(cycle):
        os.write(port, request)
        while length > 0:
            if not select.select((port,), (), (), _TIMEOUT)[0]:
                raise SystemExit(f'no answer on a perfect line to {request.hex()}')
            length -= len(os.read(port, length))
        if gap:
            time.sleep(gap)


if __name__ == '__main__':
    main()
