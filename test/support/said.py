# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the driver reports, as sentences that tests may look into and with all their causes."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from typing import Any

import pytest

from nfo_sinus_driver.drive import Cause, DriveError, Event, Report, Tuned
from nfo_sinus_driver.drive.known.events import Calls, sentence

CALLS = Calls(
    acknowledge='call ~/fault_ack',
    enable='call ~/enable',
    quick_stop='call ~/quick_stop',
    program='driver',
    drive_timeout='drive_timeout',
    set_drive_timeout='set drive_timeout',
    set_setpoint_max='set setpoint_max',
    set_control_mode='expected_control_mode in the driver',
    set_model='set model to auto or to what it is',
    set_method='set control_method to another one',
)


class Said(str):
    """
    A sentence, and the reports that it was made of.

    :ivar causes: what it says, and why.
    """

    causes: frozenset[Cause] = frozenset()


def said(what: Any) -> Said:
    """What a report, a result or an error says; whatever else it is, as it shows itself."""
    if isinstance(what, (DriveError, Event, Tuned)):
        what = what.report
    if not isinstance(what, Report):
        return Said(what)
    text = Said(sentence(what, CALLS))
    text.causes = frozenset(_causes(what))
    return text


def _causes(report: Report) -> Iterator[Cause]:
    yield report.cause
    for value in report.values.values():
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Report):
                yield from _causes(part)


@contextlib.contextmanager
def raises(cause: Cause) -> Iterator[pytest.ExceptionInfo[DriveError]]:
    """Have a command fail, and for this."""
    with pytest.raises(DriveError) as error:
        yield error
    assert cause in said(error.value).causes


def says(text: Said, what: str | Cause) -> bool:
    """Whether a sentence has this part, or this cause."""
    return what in text.causes if isinstance(what, Cause) else what in text
