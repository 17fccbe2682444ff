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

"""The verb ``set``: change parameters, all of them or none."""

from __future__ import annotations

import argparse
from collections import Counter

from nfo_sinus_driver.cli.console import CliError
from nfo_sinus_driver.cli.console import UsageError
from nfo_sinus_driver.cli.console import listed
from nfo_sinus_driver.cli.console import put
from nfo_sinus_driver.cli.console import say
from nfo_sinus_driver.cli.read import as_json
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.cli.values import BARRED
from nfo_sinus_driver.cli.values import is_barred
from nfo_sinus_driver.cli.values import parse_value
from nfo_sinus_driver.cli.values import require_names
from nfo_sinus_driver.cli.values import same
from nfo_sinus_driver.cli.values import shown
from nfo_sinus_driver.drive.parameter_writer import ParameterError


def set_(options: argparse.Namespace) -> int:
    """Change parameters, all of them or none."""
    times = Counter(name for name, _ in options.changes)
    twice = [name for name, count in times.items() if count > 1]
    if twice:
        raise UsageError(f'{", ".join(twice)} is given twice')
    with Session(options, writes=True) as session:
        drive = session.drive()
        settings = {parameter.key: parameter for parameter in drive.model.settings}
        require_names(times, settings, drive.model.name, ', nothing was written')
        wanted, wrong = {}, []
        for name, text in options.changes:
            try:
                wanted[name] = parse_value(settings[name], text)
            except ValueError as error:
                wrong.append(str(error))
        if not wrong:
            drive.identify(thoroughly=False)
            values = drive.read(wanted)
            require_names(wanted, values, str(drive), ', nothing was written')
            for name, value in wanted.items():
                try:
                    exact = drive.parameters.exact(name, value)
                    barred = is_barred(name, drive.model, options)
                    if barred and not same(exact, values.get(name)):
                        wrong.append(f'{name}: {BARRED}')
                    else:
                        drive.parameters.admit(name, value)
                except ParameterError as error:
                    wrong.append(say(error))
        if wrong:
            raise CliError(listed('nothing was written:', wrong))
        changes = drive.parameters.change(wanted).result()
        values = drive.parameters.values
    if options.json:
        put(as_json({name: settings[name] for name in wanted}, values))
        return 0
    changed = {change.key: change for change in changes}
    for name in wanted:
        as_it_was = f'{name}: {shown(values[name], settings[name].unit)}, as it was'
        put(str(changed.get(name, as_it_was)))
    return 0
