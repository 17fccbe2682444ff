# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The drive of one managed node: its settings, and the :class:`Drive` that has them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import dataclasses

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Drive, DriveSettings, Listener, Report
from nfo_sinus_driver.drive.change.memory import Memory
from nfo_sinus_driver.drive.detect import detect_model
from nfo_sinus_driver.drive.known.settings import AUTO
from nfo_sinus_driver.node.drive.lifecycle import Lifecycle
from nfo_sinus_driver.node.messages.scale import Scale
from nfo_sinus_driver.node.messages.wording import NodeError, Wording
from nfo_sinus_driver.setting import UNCONFIGURED, settings_of

#: What identifies a drive, or decides how it is commanded, cannot change while it is configured.
ONLY_UNCONFIGURED = tuple(
    name for name, setting in settings_of(DriveSettings).items() if setting.change == UNCONFIGURED
)


class ManagedDrive:
    """
    The drive of one node, as long as the node lives.

    A :class:`Drive` never changes what identifies it: where the settings do, :meth:`connect` makes
    another one.

    :param name: the node's.
    :param listener: called with every poll and event, on the worker of the bus.
    :param on_stop: called on it when the motor is stopped, with the reason.
    :ivar wording: the sentences of its reports, as its node logs them.
    :ivar scale: the unit of its set-points.
    """

    def __init__(
        self,
        name: str,
        wording: Wording,
        scale: Scale,
        bus: Bus,
        memory: Memory,
        settings: DriveSettings,
        listener: Listener,
        lifecycle: Lifecycle,
        on_stop: Callable[[Report], None],
    ) -> None:
        self.name = name
        self.wording = wording
        self.scale = scale
        self._bus = bus
        self._memory = memory
        self._settings = settings
        self._listener = listener
        self._lifecycle = lifecycle
        self._on_stop = on_stop
        #: What ``model: auto`` stands for, as far as it is known.
        self._found_model = DriveSettings().model
        self._drive = self._make_drive()
        #: It is that of the node until :meth:`disconnect`.
        self._kept = False

    @property
    def line_check(self) -> str:
        """What to check while the drive has never answered."""
        known = self._settings.model != AUTO
        return self._drive.line_check if known else self._bus.protocol.check

    @property
    def drive(self) -> Drive:
        """The present one."""
        return self._drive

    @property
    def settings(self) -> DriveSettings:
        """The wanted settings; the drive has them once it is connected."""
        return self._settings

    def require_possible(self, settings: DriveSettings) -> None:
        """Make sure that the drive can have these settings, or raise a ValueError."""
        if not self.may_be_another:
            self._of_found(settings)

    def change_settings(self, settings: DriveSettings) -> None:
        """Change the wanted settings; a drive that is connected takes them at once."""
        self._settings = settings
        if not self.may_be_another:
            self._drive.settings = self._concrete

    @property
    def state(self) -> str:
        """The label of its node's lifecycle state, such as ``active``."""
        return self._lifecycle.state

    @property
    def active(self) -> bool:
        """It takes commands and set-points."""
        return self.state == 'active'

    @property
    def may_be_another(self) -> bool:
        """No drive belongs to the node yet; one that is still looked for does not count."""
        return self.state in ('unconfigured', 'configuring') and not self._kept

    @property
    def is_silent(self) -> bool:
        """It does not respond, although its node is configured, or is to be."""
        return self._lifecycle.wanted and not self._drive.snapshot.connected

    @property
    def why_silent(self) -> str:
        """Why it was not connected to so far, and what to check."""
        return self._lifecycle.complaint

    def require_active(self) -> Drive:
        """Return the drive for a command that may turn the motor, or a NodeError why not."""
        if not self.active:
            raise NodeError(self._lifecycle.why_not('activate'))
        return self._drive

    def require_kept(self) -> Drive:
        """Return the drive for what only reads it, or a NodeError why it is left alone."""
        if not self._kept:
            raise NodeError(self._lifecycle.why_not('configure'))
        return self._drive

    def connect(self, *, retry: bool) -> None:
        """
        Connect to the drive of the settings, and poll it from then on.

        :param retry: repeat the first request when there is no response.
        :raises DriveError: it does not respond, or may not be taken over.
        :raises NodeError: the one before has not stopped yet.
        :raises ValueError: the model that was found does not have all that is set.
        """
        before = self._drive.settings
        if self._drive.stop_unconfirmed and not self._is_wanted:
            raise NodeError(f'the stop of the drive at {before.address} is not confirmed yet')
        if self._settings.model == AUTO:
            self._found_model = detect_model(self._bus, self._settings.address).result()
        if before != self._concrete:
            if before.address == self._settings.address and (
                before.method != self._concrete.method
            ):
                self._drive.require_standing().result()
            self._drive = self._make_drive()
        self._drive.connect(retry=retry, parameters=True).result()

    def keep(self) -> bool:
        """
        Keep the drive that was connected; false if the settings mean another one by now.

        From then on they cannot, and each change is for this drive. No client may change them
        meanwhile.
        """
        self._kept = self._is_wanted
        if self._kept:
            self._drive.settings = self._concrete
        return self._kept

    def disconnect(self, why: Report) -> Future[Report]:
        """Stop the motor, release control and disconnect."""
        self._kept = False
        return self._drive.disconnect(self._settings.shutdown_timeout, why)

    def _make_drive(self) -> Drive:
        drive = Drive(self._bus, self._concrete, self._listener, self._memory)
        drive.on_stop(self._on_stop)
        return drive

    @property
    def _concrete(self) -> DriveSettings:
        """The settings with a concrete model; a ValueError if it does not have all that is set."""
        return self._of_found(self._settings)

    def _of_found(self, settings: DriveSettings) -> DriveSettings:
        if settings.model != AUTO:
            return settings
        return dataclasses.replace(settings, model=self._found_model)

    @property
    def _is_wanted(self) -> bool:
        """The present drive is still the one of the settings."""
        try:
            wanted = self._concrete
        except ValueError:
            # no such drive can be: the next try says why
            return False
        return all(
            getattr(self._drive.settings, name) == getattr(wanted, name)
            for name in ONLY_UNCONFIGURED
        )
