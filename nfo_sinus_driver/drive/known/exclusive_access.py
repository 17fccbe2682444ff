# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Exclusive access to one drive, for one procedure."""

from __future__ import annotations

from nfo_sinus_driver.drive.known.events import Cause, DriveError


class ExclusiveAccess:
    """Exclusive access for one procedure, such as a tuning, whose name is ``what``."""

    def __init__(self, what: str) -> None:
        self.what = what
        #: The procedure has to stop, or must not begin.
        self.aborted = False

    def abort(self) -> None:
        """Have the procedure stop."""
        self.aborted = True

    def require_wanted(self) -> None:
        """Raise a :class:`DriveError` if the procedure was stopped meanwhile."""
        if self.aborted:
            raise DriveError(Cause.PROCEDURE_NOT_BEGUN, what=self.what)
