# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How one drive is to be treated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
import functools
import math

from nfo_sinus_driver.catalog import (
    ControlMethod,
    Profile,
    Role,
    families,
    load_parameter,
    load_profile,
    usual_family,
)
from nfo_sinus_driver.link import PROTOCOLS, LineProtocol

#: The model that is found out at the first configure.
AUTO = 'auto'
CLASSIC_DIALECTS = ('', 'v2.03', 'v5.0')
MONITOR = 'monitor'


def _profiles(model: str) -> Sequence[Profile]:
    """Return the profile of a model; of all while it is not known."""
    return [load_profile(name) for name in (families() if model == AUTO else (model,))]


def _control_methods(model: str) -> tuple[str, ...]:
    found = dict.fromkeys(name for profile in _profiles(model) for name in profile.methods)
    return (*found, MONITOR)


def _references(model: str, control_method: str) -> tuple[str, ...]:
    """Return the references of a control method; any will do of a model not known, or only read."""
    any_will_do = model == AUTO or control_method == MONITOR
    methods = [
        method
        for profile in _profiles(AUTO if any_will_do else model)
        for name, method in profile.methods.items()
        if any_will_do or name == control_method
    ]
    return tuple(dict.fromkeys(one for method in methods for one in method.references))


def _control_modes(model: str, method: str = '') -> tuple[str, ...]:
    """Return the control modes of a model, as far as a control method knows them."""
    profiles = _profiles(model) if model == AUTO else [load_profile(model, method)]
    return tuple(dict.fromkeys(mode for profile in profiles for mode in profile.setpoints))


def _telegram_words(model: str, method: str) -> tuple[str, ...]:
    """Return the sets of words that a PLC may map for a model; any while that is not known."""
    names = families() if model == AUTO else (model,)
    found = (words for name in names for words in load_profile(name, method).words)
    return ('', *dict.fromkeys(found))


def _own_timeouts(model: str) -> Sequence[tuple[Fraction, Fraction]]:
    """Return the longest time-out of a model's own, and its step, s; of all while not known."""
    found = []
    for name in families() if model == AUTO else (model,):
        parameter = load_parameter(name, Role.COMMUNICATION_TIMEOUT)
        if parameter is not None:
            protocol = next(iter(parameter.addresses))
            found.append((parameter.span(protocol)[1], parameter.step(protocol)))
    return found


#: Those of all models together.
CONTROL_METHODS = _control_methods(AUTO)
#: The sets of words that a PLC may map, where a model has several.
TELEGRAM_WORDS = _telegram_words(AUTO, 'telegram1')[1:]
#: Where a running drive takes its reference from.
REFERENCES = _references(AUTO, MONITOR)
#: The control modes by the names that ``expected_control_mode`` takes.
CONTROL_MODES = _control_modes(AUTO)
#: The longest of the time-outs that drives have themselves, s.
LONGEST_DRIVE_TIMEOUT = float(max(longest for longest, _ in _own_timeouts(AUTO)))

#: How many registers a PLC shows for one drive, and where the last of them can begin.
BLOCK_SIZE = 11
LAST_BLOCK = 0x10000 - BLOCK_SIZE
#: How much longer than ``lost_after`` the drive's own time-out is, s: else it would stop the motor
#: in noise that the driver waits out.
DRIVE_TIMEOUT_MARGIN = 0.5


@dataclass(frozen=True)
class DriveSettings:
    """
    How one drive is to be treated; the fields are the parameters of its node.

    :ivar address: one that the protocol of the line has.
    :ivar block_address: the first register of the block that a PLC shows, with ``telegram1``.
    :ivar telegram_words: which words a PLC maps for a drive that may have several, by name; '': the
        usual ones of the model.
    :ivar model: one of the catalog's, or ``auto``; only a node can do with that.
    :ivar control_method: as it was chosen; ``''`` stands for the usual one of the model.
    :ivar reference: where a running drive takes its reference from; set-points are only followed
        with ``fieldbus``.
    :ivar poll_rate: Hz; 0 is as fast as the bus allows.
    :ivar idle_poll_rate: Hz, while the motor stands and nobody has enabled it; 0 is as
        ``poll_rate``.
    :ivar telemetry_rate: Hz; 0 turns telemetry off.
    :ivar lost_after: s; after so long without a valid frame a drive that is asked is lost.
    :ivar setpoint_timeout: s; 0 turns it off.
    :ivar setpoint_max: in the unit of the control mode; 0 is the nominal value of what it is
        about, where the drive tells it, else the drive's own limit.
    :ivar drive_timeout: s; the drive's own time-out, within its limits and on a step of it; 0
        leaves it as it is. At least :data:`DRIVE_TIMEOUT_MARGIN` more than ``lost_after``.
    :ivar frequency_scale: Hz for one count of the bus, as FrqScl in the drive says, which no bus
        tells [C16]; only where the family has such a scale, like the following.
    :ivar torque_scale: % of the nominal torque for one count, as TrqScl says.
    :ivar process_scale: of the process unit for one count, as RegScl says.
    :ivar classic_dialect: which manual of the Classic protocol the drive follows, ``v2.03`` or the
        older ``v5.0``; '' asks it for its firmware, while the bus has no control.
    :ivar allow_communication_changes: the parameters ``serial.…`` may be changed.
    :raises ValueError: a field that makes no sense; the message says what would.
    """

    address: int = 1
    block_address: int = 0
    telegram_words: str = ''
    model: str = usual_family()
    control_method: str = ''
    reference: str = 'fieldbus'
    poll_rate: float = 50.0
    idle_poll_rate: float = 0.0
    telemetry_rate: float = 2.0
    lost_after: float = 1.0
    setpoint_timeout: float = 2.5
    setpoint_max: float = 0.0
    expected_control_mode: str = ''
    drive_timeout: float = 0.0
    shutdown_timeout: float = 4.0
    frequency_scale: float = 0.1
    torque_scale: float = 1.0
    process_scale: float = 0.1
    allow_communication_changes: bool = False
    classic_dialect: str = ''
    retries: int = 2

    @property
    def scales(self) -> Mapping[Role, float]:
        """The scales that no bus tells, by the role of what is measured in them."""
        return {
            Role.ACTUAL_FREQUENCY: self.frequency_scale,
            Role.ACTUAL_TORQUE: self.torque_scale,
            Role.ACTUAL_PROCESS_VALUE: self.process_scale,
        }

    @property
    def follows_setpoints(self) -> bool:
        """The motor follows set-points from the bus, and no reference of the drive's own."""
        return self.reference == 'fieldbus'

    @functools.cached_property
    def method(self) -> str:
        """The control method, the usual one where none was chosen; ``''`` with ``auto`` then."""
        if self.control_method or self.model == AUTO:
            return self.control_method
        return next(iter(load_profile(self.model).methods))

    @property
    def method_class(self) -> type[ControlMethod]:
        """How it is commanded; how it would be, where it is only watched."""
        methods = load_profile(self.model).methods
        return methods.get(self.method) or next(iter(methods.values()))

    def require_line(self, protocol: LineProtocol) -> None:
        """
        Make sure that the drive can be reached over a line.

        :raises ValueError: it cannot; the message says what to set.
        """
        protocol.require_unit(self.address)
        if self.model == AUTO:
            return
        needed = self.method_class.addressing
        if needed and needed not in protocol.carries:
            able = ' or '.join(one.name for one in PROTOCOLS.values() if needed in one.carries)
            raise ValueError(
                f'control_method {needed} of {self.model} goes through a PLC: '
                f'set protocol to {able} (it is {protocol.name})'
            )
        if self.block_address and not needed:
            raise ValueError(
                f'block_address {self.block_address}: it is for control_method telegram1 alone'
            )

    def __post_init__(self) -> None:
        _one_of('model', self.model, (*families(), AUTO))
        if self.control_method:
            _one_of('control_method', self.control_method, _control_methods(self.model))
        _one_of('reference', self.reference, REFERENCES)
        kind = f'{self.method} on {self.model}'
        allowed = _references(self.model, self.method)
        if self.reference not in allowed:
            raise ValueError(
                f'reference {self.reference!r}: with {kind} it must be {" or ".join(allowed)}'
            )
        _one_of('classic_dialect', self.classic_dialect, CLASSIC_DIALECTS)
        self._require_known_method()
        if self.telegram_words:
            _one_of('telegram_words', self.telegram_words, _telegram_words(self.model, self.method))
        modes = _control_modes(self.model, self.method)
        _one_of('expected_control_mode', self.expected_control_mode, ('', *modes))
        if not any(self.address in protocol.units for protocol in PROTOCOLS.values()):
            raise ValueError(f'address {self.address}: allowed are 0 to 247')
        _between('block_address', self.block_address, 0, LAST_BLOCK, '(a register)')
        _between('poll_rate', self.poll_rate, 0, 1000, 'Hz (0: as fast as the bus allows)')
        _between('idle_poll_rate', self.idle_poll_rate, 0, 1000, 'Hz (0: as poll_rate)')
        _between('telemetry_rate', self.telemetry_rate, 0, 100, 'Hz (0: off)')
        _between('lost_after', self.lost_after, 0.2, 60, 's')
        _between('setpoint_timeout', self.setpoint_timeout, 0, 3600, 's (0: off)')
        _between('setpoint_max', self.setpoint_max, 0, 32767, '(0: what the motor is made for)')
        for name in ('frequency_scale', 'torque_scale', 'process_scale'):
            _between(name, getattr(self, name), 1e-6, 1e6, '(the value of one count)')
        _between('shutdown_timeout', self.shutdown_timeout, 0, 600, 's')
        self._check_drive_timeout()

    def _check_drive_timeout(self) -> None:
        # a drive that has none refuses any, with the reason
        own = _own_timeouts(self.model) or _own_timeouts(AUTO)
        longest, step = max(most for most, _ in own), min(least for _, least in own)
        whose = f' with {self.model}' if len(own) == 1 else ''
        _between('drive_timeout', self.drive_timeout, 0, float(longest), f's{whose} (0: as it is)')
        least = self.lost_after + DRIVE_TIMEOUT_MARGIN
        if 0 < self.drive_timeout < least - 1e-9:
            raise ValueError(
                f'drive_timeout {self.drive_timeout:g} s: at least '
                f'{float(math.ceil((least - 1e-7) / step) * step):g} s, half a second more than '
                f'lost_after ({self.lost_after:g} s), so that noise which the driver waits out '
                'does not stop the motor'
            )
        steps = self.drive_timeout / step
        if abs(steps - round(steps)) > 1e-3:
            below, above = (float(whole(steps) * step) for whole in (math.floor, math.ceil))
            raise ValueError(
                f'drive_timeout {self.drive_timeout:g} s lies between two steps of the drive, '
                f'{below:g} and {above:g}'
            )

    def _require_known_method(self) -> None:
        for profile in _profiles(self.model):
            method = profile.methods.get(self.method)
            dialect = profile.older.name if profile.older is not None else ''
            if dialect and dialect == self.classic_dialect and method and not method.older:
                others = ' or '.join(name for name, one in profile.methods.items() if one.older)
                raise ValueError(f'classic_dialect {dialect} has no {method.means}: use {others}')


def _one_of(name: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        shown = ', '.join(repr(choice) for choice in allowed)
        raise ValueError(f'{name} {value!r}: choose one of {shown}')


def _between(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:
        raise ValueError(f'{name} {value:g}: allowed are {low:g} to {high:g} {unit}')
