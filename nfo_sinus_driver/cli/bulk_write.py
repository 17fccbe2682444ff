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

"""Write many parameters one after the other, and say exactly how far it came when it fails."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
import contextlib
import signal
import sys
import threading

from nfo_sinus_driver.cli.errors import CliError
from nfo_sinus_driver.cli.errors import Interrupted
from nfo_sinus_driver.cli.errors import listed
from nfo_sinus_driver.cli.options import command_line
from nfo_sinus_driver.cli.progress import progress
from nfo_sinus_driver.cli.progress import remark
from nfo_sinus_driver.cli.session import Remote
from nfo_sinus_driver.cli.values import shown
from nfo_sinus_driver.cli.wording import say
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive.parameter_writer import Change
from nfo_sinus_driver.drive.parameter_writer import ParameterError

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Loading:
    """
    Writes into one drive, in an order that the drive takes.

    :param data: what differs from what the drive has, as it shall stand there.
    :param options: ``put_back`` and ``keep`` say what happens when it fails half-way.
    """

    def __init__(
        self, drive: Remote, data: Mapping[str, bytes], options: argparse.Namespace
    ) -> None:
        self._drive = drive
        self._data = data
        self._options = options
        #: What the drive had, to be put back.
        self._before = {key: drive.parameters.data[key] for key in data}
        self._written: dict[str, Change] = {}

    def run(self) -> None:
        """
        Write all of it.

        :raises CliError: it failed; what was written, what not and why has been said, and it was
            put back if that was wanted.
        """
        try:
            self._write('writing', self._data, self._written)
        except (DriveError, Interrupted) as error:
            doubtful = error.left if isinstance(error, ParameterError) else ()
            self._tell_how_far(error)
            stained = list(dict.fromkeys((*self._written, *doubtful)))
            raise CliError(self._clean_up(stained)) from error

    def _write(
        self, what: str, data: Mapping[str, bytes], written: dict[str, Change]
    ) -> None:
        """
        Write, and keep account of it.

        :raises DriveError: something was not taken.
        :raises Interrupted: a signal came; the parameter that was on its way was finished.
        """
        with _signals_noted() as came, progress(f'{what} {self._drive}', len(data)) as step:

            def wrote(change: Change) -> None:
                written[change.key] = change
                step()
                if came() and len(written) < len(data):
                    raise Interrupted

            self._drive.parameters.write_each(data, wrote).result()

    def _tell_how_far(self, error: Exception) -> None:
        """Say what was written and what was not."""
        left = [key for key in self._data if key not in self._written]
        refused = error.key if isinstance(error, ParameterError) else ''
        failed = [key for key in left if key == refused]
        left = [key for key in left if key != refused]
        remark(say(error))
        if self._written:
            remark(listed('written:', map(str, self._written.values())))
        if failed:
            remark(listed('tried in vain:', failed))
        if left:
            remark(listed('not written:', left))

    def _clean_up(self, stained: list[str]) -> str:
        """Put back what was written, if that is wanted; return what the drive has then."""
        if not stained:
            return 'not loaded: the drive is as it was'
        if not self._options.put_back and not self._wants_it_back():
            if self._written:
                remark(f'to put it back:\n  {self._how_to_put_back()}')
            return f'not loaded: {len(self._written)} of {len(self._data)} were written'
        back: dict[str, Change] = {}
        try:
            self._write('putting back', {key: self._before[key] for key in stained}, back)
        except (DriveError, Interrupted) as error:
            if back:
                remark(listed('put back:', map(str, back.values())))
            lost = (key for key in stained if key not in back)
            head = f'NOT all put back, {say(error)}; not as it was:'
            return listed(head, map(self._state, lost))
        return f'not loaded: all that was written is put back ({len(back)}), the drive is as it was'

    def _wants_it_back(self) -> bool:
        if self._options.keep or not (sys.stdin.isatty() and sys.stderr.isatty()):
            return False
        print('Put back what was written? [Y/n] ', end='', file=sys.stderr, flush=True)
        try:
            answer = sys.stdin.readline()
        except KeyboardInterrupt:
            answer = ''
        # the end of the input is no answer
        return answer.endswith('\n') and answer.strip().lower() in ('', 'y', 'yes')

    def _state(self, key: str) -> str:
        """Return what is known of a parameter that could not be put back."""
        change = self._written.get(key)
        if change is None:
            return f'{key}, of which nothing is known'
        return f'{key}: {shown(change.new, change.unit)}, was {shown(change.old, change.unit)}'

    def _how_to_put_back(self) -> str:
        words = [f'{key}={shown(change.old, "")}' for key, change in self._written.items()]
        if not self._drive.model.communication.isdisjoint(self._written):
            words.insert(0, '--allow-communication-changes')
        return command_line(self._options, 'set', *words)


@contextlib.contextmanager
def _signals_noted() -> Iterator[Callable[[], bool]]:
    """Let signals that end the program wait; what it yields tells whether one came."""
    came = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield came.is_set
        return
    before = {number: signal.signal(number, lambda *_: came.set()) for number in _SIGNALS}
    try:
        yield came.is_set
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
