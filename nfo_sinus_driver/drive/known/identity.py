# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The identity of a drive, and what its firmware has."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
import functools
import math

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import OlderDialect, Product, Role
from nfo_sinus_driver.drive.known.events import Cause, Report, Severity
from nfo_sinus_driver.drive.known.parameter_access import ParameterAccess
from nfo_sinus_driver.drive.known.scales import Scales
from nfo_sinus_driver.drive.known.settings import DriveSettings
from nfo_sinus_driver.link import LinkError, PortError, Refused


@dataclass(frozen=True)
class Identity:
    """
    The identity of a drive; ``''``: unknown.

    :ivar firmware: SWVer, such as 4.38 [M0 §8.1]; NaN: unknown.
    :ivar motor_firmware: NFOVer, such as 4018.
    :ivar vendor: its maker.
    :ivar model: its product name and size, such as ``NFO Sinus 1.50/400`` [M0 §6.2.4].
    :ivar serial: its serial number.
    :ivar software: the part number of its software, of one that has no SWVer.
    """

    firmware: float = math.nan
    motor_firmware: int = 0
    vendor: str = ''
    model: str = ''
    serial: str = ''
    software: str = ''

    @functools.cached_property
    def version(self) -> Fraction | None:
        """The firmware as a number that can be compared exactly; ``None``: unknown."""
        return None if math.isnan(self.firmware) else Fraction(self.firmware)

    @property
    def versions(self) -> str:
        """Both firmwares, such as ``4.38 / 4018``, or the part number of the software."""
        if math.isnan(self.firmware):
            return self.software
        return f'{self.firmware:.2f} / {self.motor_firmware}'

    @property
    def own_serial(self) -> str:
        """The serial number where it tells the drive from all others; zeros are none."""
        serial = self.serial.strip()
        return serial if serial.strip('0') else ''

    def __str__(self) -> str:
        known = {'': self.model, 'firmware ': self.versions, 'serial ': self.serial}
        return ', '.join(f'{name}{value}' for name, value in known.items() if value)


class Nameplate:
    """
    The identity of one drive, and what it has by that: parameters, texts, scales; for the bus.

    :param report: reports what is found.
    :ivar identity: that of the drive; ``None`` before the first answer.
    :ivar is_older: its firmware lacks some parameters, or may do so; such firmware takes settings
        only while the bus has control [C100].
    """

    def __init__(
        self,
        params: ParameterAccess,
        settings: DriveSettings,
        report: Callable[[Severity, Report], None],
    ) -> None:
        self._params = params
        self._model = params.model
        self._settings = settings
        self._report = report
        self.identity: Identity | None = None
        self.is_older = False
        #: Why no parameters are reached behind a PLC, as reported; ``''``: they are.
        self._mailbox_trouble = ''
        self.scales = Scales(params, self.has, settings.scales, settings.method_class.unused_scales)

    async def identify(self, priority: Priority = Priority.SERVICE) -> Identity:
        """
        Find out whether a drive answers, and with which firmware.

        :param priority: of the first request; it is repeated for a service alone, for a silent
            drive costs the others time-outs.
        """
        # any parameter will do that every drive has, in either dialect
        retry = priority is Priority.SERVICE
        await self._params.read(self._model.key_of_status, priority, retry=retry)
        if self._params.in_block:
            # the block has its layout, and the data of a drive that the PLC is set for
            self._params.contact.recognised()
        await self._params.find_lacking()
        await self._find_mailbox()
        dialect = self._dialect
        before, was_older = self.identity, self.is_older
        self._be_older(dialect is not None and self._settings.classic_dialect == dialect.name)
        firmware_key = self._model.key(Role.FIRMWARE)
        if self.is_older or not self._params.reaches(firmware_key):
            return self._note_versions()
        if dialect is not None and not await self._may_ask_firmware(dialect):
            if before is None:
                # the newer firmware has all that the older one has
                self._note_versions()
                self.is_older = True
                report = Report(
                    Cause.FIRMWARE_NOT_ASKED, before=dialect.before, dialect=dialect.name
                )
                self._report(Severity.WARNING, report)
            else:
                self._be_older(was_older)
            return self.identity or Identity()
        try:
            firmware = await self._params.read_number(firmware_key, Priority.SERVICE)
            motor_key = self._model.key(Role.MOTOR_FIRMWARE)
            motor = await self._params.read_number(motor_key, Priority.SERVICE)
        except Refused:
            if dialect is None or self._settings.classic_dialect:
                raise
            self._be_older(True)
            return self._note_versions()
        self._be_older(dialect is not None and firmware < dialect.before)
        return self._note_versions(firmware, int(motor))

    def _note_versions(self, firmware: float = math.nan, motor: int = 0) -> Identity:
        """Take the versions that were read; the rest is read less often."""
        known = self.identity or Identity()
        self.identity = replace(known, firmware=firmware, motor_firmware=motor)
        return self.identity

    async def _find_mailbox(self) -> None:
        """Find out whether parameters are reached behind a PLC; the driver can do without."""
        key = self._model.key(Role.TELEGRAM)
        if not key or self._settings.method == 'monitor':
            # monitor writes nothing, not even a request to the mailbox
            return
        trouble = ''
        try:
            await self._params.read(key, Priority.SERVICE, retry=False)
        except PortError:
            raise
        except LinkError as error:
            trouble = str(error)
            if trouble != self._mailbox_trouble:
                absent = isinstance(error, Refused) and error.code == Refused.ILLEGAL_ADDRESS
                severity = Severity.INFO if absent else Severity.WARNING
                self._report(severity, Report(Cause.NO_MAILBOX, why=trouble))
        self._mailbox_trouble = trouble
        self._params.use_mailbox(not trouble)

    def _be_older(self, older: bool) -> None:
        """Take the firmware for one of the older dialect, or not."""
        self.is_older = older
        dialect = self._dialect
        self.scales.use_dialect(dialect.factors if older and dialect is not None else {})

    @property
    def _dialect(self) -> OlderDialect | None:
        dialect = self._model.profile.older
        here = dialect is not None and dialect.protocol == self._params.protocol
        return dialect if here else None

    async def _may_ask_firmware(self, dialect: OlderDialect) -> bool:
        """
        Return whether the firmware can be read without harm: an older one does not know it.

        A control method that only newer firmware has rules the older out.
        """
        method = self._model.profile.methods.get(self._settings.method)
        if self._settings.classic_dialect or (method is not None and not method.older):
            return True
        key = self._model.key(Role.CONTROL_SOURCE)
        source = await self._params.read(key, Priority.SERVICE)
        return self._model.profile.holders.get(source) in dialect.harmless

    async def read_scales(self) -> None:
        """Read the scale of speeds, and report one that is not the one before."""
        if await self.scales.read():
            self._report(Severity.INFO, Report(Cause.SPEED_SCALE, scale=str(self.scales.speed)))

    async def read_more(self) -> Identity:
        """Read vendor, product and serial number; nothing needs them, many lack them [C57]."""
        assert self.identity is not None
        if self._params.in_block:
            # a PLC would answer for itself [C118]
            return self.identity
        found = await self._params.identify(Priority.SERVICE)
        model = f'{found.product} {found.model}'.strip()
        self.identity = replace(
            self.identity, vendor=found.vendor, model=model, serial=found.serial
        )
        return self.identity

    def take_product(self, product: Product) -> Identity:
        """Take the identity that the drive gives; warn of a model that its manual does not list."""
        assert self.identity is not None
        self.identity = replace(
            self.identity, vendor=product.vendor, model=product.model, software=product.software
        )
        if not product.listed:
            title = self._model.profile.title
            report = Report(Cause.UNLISTED_MODEL, model=product.model, title=title)
            self._report(Severity.WARNING, report)
        return self.identity

    def text_of(self, code: int) -> str:
        """Return what the display of this firmware says for a code."""
        firmware = self.identity.version if self.identity else None
        if self.is_older and firmware is None:
            firmware = Fraction(0)
        return self._model.status_code(code).shown(firmware)

    def has(self, key: str) -> bool:
        """Return whether the drive has a parameter, by its model, this line and its firmware."""
        if not self._params.reaches(key) or (self.is_older and not self._model[key].older):
            return False
        since = self._model[key].since
        firmware = self.identity.firmware if self.identity else math.nan
        return since is None or not firmware < float(since) - 0.001
