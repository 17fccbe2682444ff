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

"""A ROS domain for oneself, so that demo and tests disturb nobody and are not disturbed."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import os
import random
import socket

#: All that DDS has ports for on every system; 0 is everybody's.
_DOMAINS = range(1, 102)


@contextlib.contextmanager
def own_domain() -> Iterator[int]:
    """
    Have a ROS domain that nobody else who asks here has at the time.

    It is not the one that is set: that is where the user's own robots are.

    :raises RuntimeError: there is none left.
    """
    users = os.environ.get('ROS_DOMAIN_ID', '')
    for number in random.sample(_DOMAINS, len(_DOMAINS)):
        if str(number) == users:
            continue
        with socket.socket(socket.AF_UNIX) as claim:
            # a name that only one on this machine can have, and that goes with its process
            try:
                claim.bind(f'\0nfo_sinus_driver/domain/{number}')
            except OSError:
                continue
            yield number
            return
    raise RuntimeError('no ROS domain is free')
