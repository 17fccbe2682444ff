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

"""What can go wrong on a line, and whether the request may have been carried out all the same."""

from __future__ import annotations


class LinkError(Exception):
    """
    A transaction failed.

    :ivar maybe_done: the drive may have carried the request out. False only where it cannot have.
    """

    maybe_done = False
    #: The unit answered a question before, for the sake of this one: it is there.
    heard = False


class PortError(LinkError):
    """The port cannot be opened or was lost; the message says what to do."""


class NoAnswer(LinkError):
    """Nobody answered in time."""

    maybe_done = True


class GatewaySilent(NoAnswer):
    """The gateway itself said nothing in time, not even that the drive is silent."""


class NoPath(LinkError):
    """A gateway does not know where the drive is; the message says what to do."""


class DamagedAnswer(LinkError):
    """Something came, but no answer to this request: noise, a collision or wrong line settings."""

    maybe_done = True


class NeverSilent(DamagedAnswer):
    """Somebody talks all the time, so nothing was sent."""

    maybe_done = False


class Refused(LinkError):
    """
    The drive answered that it will not.

    :ivar code: the Modbus exception code, or on other protocols the one that means the same.
    """

    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_FAILURE = 4
    BUSY = 6
    NO_PATH = 10
    NO_ANSWER = 11

    def __init__(self, code: int, reason: str = '') -> None:
        self.code = code
        #: What a person may look up, to stand behind a sentence.
        self.behind = f': {reason}' if reason else f' (exception {code})'
        text = _REFUSALS.get(code, 'the drive refused')
        super().__init__(reason or f'{text} (exception {code})')


_REFUSALS = {
    Refused.ILLEGAL_FUNCTION: 'the drive does not know this function',
    Refused.ILLEGAL_ADDRESS: 'the drive has no such parameter',
    Refused.ILLEGAL_VALUE: 'the drive does not accept this value',
    Refused.DEVICE_FAILURE: 'the drive cannot do this in its present state',
    5: 'the drive needs more time',
    Refused.BUSY: 'the drive is busy',
    8: 'the drive found a memory error',
    Refused.NO_PATH: 'the gateway has no path to the drive',
    Refused.NO_ANSWER: 'the gateway got no answer from the drive',
}


class NotReady(LinkError):
    """
    This unit must be left alone for a while, lest a late answer be taken for the right one.

    Nothing was sent.

    :ivar until: when it may be asked again, in seconds of ``time.monotonic``.
    """

    def __init__(self, until: float) -> None:
        self.until = until
        super().__init__('answers to earlier requests may still be on their way')
