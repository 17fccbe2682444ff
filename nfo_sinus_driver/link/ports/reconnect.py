# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A link that is opened again whenever it is lost, or open and mute."""

from __future__ import annotations

import logging

from nfo_sinus_driver.link.interface import Connecting, Link, PortError

_log = logging.getLogger(__name__)


class Reconnect:
    """
    Opens a link, and again when it was lost; catches every error of the link.

    :ivar is_open: the link is open.
    :ivar error: why it is not, or was closed last.
    :ivar is_at_same_place: it was opened last where it was before; what was behind it may be still.
    :ivar reopen_at: when it may be tried again, s on the steady clock.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self.is_open = False
        self.error = PortError('the port is not open yet')
        self.reopen_at = 0.0
        self.is_at_same_place = False
        self._place = ''

    def open(self, reopen_at: float) -> None:
        """Try to open the link, or one that is open and mute again; the next at ``reopen_at``."""
        try:
            self._link.open()
        except Connecting:
            # the next call goes on at once; the caller may do something else between
            return
        except PortError as error:
            self.mark_lost(error, reopen_at)
        except BaseException as error:
            _log.exception('error in the link')
            self.mark_lost(PortError(f'error in the link: {error!r}'), reopen_at)
        else:
            self.is_open = True
            before, self._place = self._place, self._link.place
            self.is_at_same_place = self._place != '' and self._place == before

    def mark_lost(self, error: PortError, reopen_at: float) -> None:
        """Close the link because of an error, until it may be tried again."""
        self.close()
        self.error = error
        self.reopen_at = reopen_at

    def close(self) -> None:
        """Close the link."""
        self.is_open = False
        try:
            self._link.close()
        except BaseException:
            # requests that wait for an answer get the error all the same
            _log.exception('error in the link')
