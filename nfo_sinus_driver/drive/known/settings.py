# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The settings of one drive."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
import functools
import math

from nfo_sinus_driver.catalog import (
    CatalogError,
    ControlMethod,
    Profile,
    Role,
    families,
    is_family,
    load_family,
    load_parameter,
    load_profile,
    usual_family,
)
from nfo_sinus_driver.catalog.finding import find
from nfo_sinus_driver.catalog.status import QUANTITIES, SPEED
from nfo_sinus_driver.link import ADDRESSES, PROTOCOLS, LineProtocol
from nfo_sinus_driver.setting import UNCONFIGURED, setting, settings_of

#: The model is detected at the first configure.
AUTO = 'auto'
CLASSIC_DIALECTS = ('v2.03', 'v5.0')
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
    return tuple(dict.fromkeys(name for method in methods for name in method.references))


def _control_modes(model: str, method: str = '') -> tuple[str, ...]:
    """Return the control modes of a model, as far as a control method knows them."""
    profiles = _profiles(model) if model == AUTO else [load_profile(model, method)]
    modes = dict.fromkeys(mode for profile in profiles for mode in profile.setpoints)
    return (*modes, SPEED.mode) if _has_speed_mode(model, method) else tuple(modes)


def _has_speed_mode(model: str, method: str) -> bool:
    """Return whether Speed mode of a model is known from the settings alone."""
    return model != AUTO and load_profile(model, method).speed_mode is not None


def _telegram_words(model: str, method: str) -> tuple[str, ...]:
    """Return the sets of words that a PLC may map for a model; any while that is not known."""
    names = families() if model == AUTO else (model,)
    found = (words for name in names for words in load_profile(name, method).words)
    return ('', *dict.fromkeys(found))


def _drive_timeouts(model: str) -> Sequence[tuple[Fraction, Fraction]]:
    """Return the longest communication time-out of a model, and its step, s; of all if unknown."""
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
LONGEST_DRIVE_TIMEOUT = float(max(longest for longest, _ in _drive_timeouts(AUTO)))

#: How many registers a PLC shows for one drive, and where the last of them can begin.
BLOCK_SIZE = 11
LAST_BLOCK = 0x10000 - BLOCK_SIZE
#: How much longer than ``lost_after`` the drive's own time-out is, s: else it would stop the motor
#: in noise that the driver waits out.
DRIVE_TIMEOUT_MARGIN = 0.5
#: ``drive_timeout`` where none is given: the usual one, if the drive has one.
AS_THE_DRIVE_CAN = -1.0
_USUAL_DRIVE_TIMEOUT = 2.0


@dataclass(frozen=True)
class DriveSettings:
    """
    The settings of one drive; the fields are parameters of its node.

    :raises ValueError: a field that makes no sense; the message says what would.
    """

    address: int = setting(
        1,
        'the address of the drive on its line; no two drives on a line share one',
        0, 255, also=ADDRESSES, change=UNCONFIGURED,
    )
    block_address: int = setting(
        0,
        'with control_method telegram1: the first of the registers that the PLC shows for this '
        'drive; the blocks of two drives do not overlap',
        0, LAST_BLOCK, change=UNCONFIGURED,
    )
    drive_addresses: Sequence[str] = setting(
        ('',),
        'behind a PLC with a mailbox, where a model has such: its parameters by their '
        'communication addresses, each group.name=ADDRESS:FACTOR:UNIT:rw, such as '
        'drv.acc_time=1103h:0.1:s:rw',
        zero='none', change=UNCONFIGURED,
    )
    telegram_words: str = setting(
        '',
        'with control_method telegram1: the words that the PLC maps, where the model has several',
        choices=TELEGRAM_WORDS, zero=TELEGRAM_WORDS[0], change=UNCONFIGURED,
    )
    model: str = setting(
        usual_family(),
        'the drive family; a drive that contradicts it is reported',
        choices=(*families(), AUTO), also='auto: ask the drive at configure',
        change=UNCONFIGURED,
    )
    family: str = setting(
        '',
        'the drive family in place of model: a shipped name, the path of a file NAME.vfd.yaml that '
        'describes the drive, or package://name/path',
        zero='model says it', change=UNCONFIGURED,
    )
    control_method: str = setting(
        '',
        'how the drive is commanded',
        choices=CONTROL_METHODS, also='monitor: not one write to the drive',
        zero='the usual method of the model', change=UNCONFIGURED,
    )
    reference: str = setting(
        'fieldbus',
        'where a running drive takes its reference from; with any but fieldbus it follows no '
        'set-points',
        choices=REFERENCES, also='as far as model and control_method have it',
        change=UNCONFIGURED,
    )
    poll_rate: float = setting(
        50.0,
        'status and actual values; while the drive is enabled or a stop is not confirmed, the '
        'status is read at least five times a second, as far as the line carries that, and '
        'published when it changes',
        0, 1000, unit='Hz', zero='as fast as the bus allows',
    )
    idle_poll_rate: float = setting(
        0.0,
        'as poll_rate, but while the motor stands still and is not enabled',
        0, 1000, unit='Hz', zero='as poll_rate',
    )
    telemetry_rate: float = setting(2.0, 'measured values', 0, 100, unit='Hz', zero='off')
    measured: Sequence[str] = setting(
        ('',),
        'what ~/measured has, at telemetry_rate: measured values by the names of their parameters',
        zero='those that matter of the model beside ~/telemetry',
    )
    lost_after: float = setting(
        1.0,
        'a drive that is asked and sends no valid frame for this long is lost and stopped; any '
        'valid answer, a refusal too, begins it again',
        0.2, 60, unit='s',
    )
    setpoint_timeout: float = setting(
        2.5,
        'no fresh set-point for this long: ramp to a stop and warn',
        0, 3600, unit='s', zero='off',
    )
    setpoint_max: float = setting(
        0.0,
        'set-points beyond it are clamped, in both directions, in the unit of the control mode',
        0, 32767,
        zero="what is nominal for the motor, or the drive's own limit where that is not known",
    )
    expected_control_mode: str = setting(
        '',
        'enable is refused when the drive is in another control mode',
        choices=CONTROL_MODES, zero='any',
    )
    nominal_speed: float = setting(
        0.0,
        'with control_method telegram1 and expected_control_mode Speed: the nominal speed of the '
        'motor, which the telegram does not have',
        0, 30000, unit='rpm', zero='not given', change=UNCONFIGURED,
    )
    drive_timeout: float = setting(
        AS_THE_DRIVE_CAN,
        "the drive's own time-out: it stops the motor when this driver dies; -1: 2 s, or "
        'lost_after + 0.5 if that is more, where the drive has one that may stop the motor',
        AS_THE_DRIVE_CAN, LONGEST_DRIVE_TIMEOUT, unit='s', zero='leave it as it is',
        also='-1, 0 or at least lost_after + 0.5; the most and the step are those of the drive',
    )
    stop_with: Sequence[str] = setting(
        ('',),
        'names of drives that stop when this one is stopped, whatever the reason; those of another '
        'line by their full names, such as /line2/right; a set-point time-out is no stop: it stays '
        'enabled',
        zero='none',
    )
    jam_current: float = setting(
        0.0,
        'a motor that takes more than this and turns slower than jam_speed for jam_time, although '
        'its set-point is at least twice its speed, is jammed; one that becomes faster is not; '
        'measured at telemetry_rate',
        0, 10000, unit='A', zero='off',
    )
    jam_speed: float = setting(
        0.0,
        'with jam_current: in the unit of actual in ~/status, Hz or rpm; no set-point of this size '
        'or less counts',
        0, 32767, zero='not given',
    )
    jam_time: float = setting(
        2.0,
        'with jam_current: for how long without a break; after a start or a turn at least 5 s, for '
        'a slow ramp shows no sooner',
        0.1, 600, unit='s', also='at least two periods of telemetry_rate and of poll_rate',
    )
    on_jam: str = setting(
        'warn',
        'what the driver does when the motor is jammed: warn, or stop, until the next enable',
        choices=('warn', 'stop'),
    )
    shutdown_timeout: float = setting(
        4.0,
        'how long an exit or a cleanup waits for the drive to confirm that it stops',
        0, 600, unit='s',
    )
    frequency_scale: float = setting(
        0.1,
        'what one count of a frequency is, where the drive has a scale that cannot be read [C16]; '
        'one that is not that of the drive makes every frequency wrong',
        1e-6, 1e6, unit='Hz', change=UNCONFIGURED,
    )
    torque_scale: float = setting(
        1.0,
        'the same of a torque, % of the nominal one',
        1e-6, 1e6, unit='%', change=UNCONFIGURED,
    )
    process_scale: float = setting(
        0.1,
        'the same of a process value, in its unit',
        1e-6, 1e6, change=UNCONFIGURED,
    )
    allow_communication_changes: bool = setting(
        False,
        'allow changes of settings of the line (serial.*): the driver may lose the drive by that',
    )
    classic_dialect: str = setting(
        '',
        'which manual of the Classic protocol the drive follows: v2.03, or v5.0 for firmware '
        'before 4.28',
        choices=CLASSIC_DIALECTS, zero='ask the drive, while the bus does not control it',
        change=UNCONFIGURED,
    )
    #: How often a request without a response is repeated; a setting of the line.
    retries: int = 2

    @property
    def scales(self) -> Mapping[Role, float]:
        """The scales that cannot be read, by the role of what is measured in them."""
        return {
            Role.ACTUAL_FREQUENCY: self.frequency_scale,
            Role.ACTUAL_TORQUE: self.torque_scale,
            Role.ACTUAL_PROCESS_VALUE: self.process_scale,
        }

    @functools.cached_property
    def telegram_speed(self) -> float:
        """The nominal speed, rpm, where a telegram has speeds for frequencies; else 0."""
        in_speed = self.expected_control_mode == SPEED.mode
        return self.nominal_speed if in_speed and _has_speed_mode(self.model, self.method) else 0.0

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
        """Its control method; the one it would have, where it is only monitored."""
        methods = load_profile(self.model).methods
        return methods.get(self.method) or next(iter(methods.values()))

    def other_methods(self, protocol: LineProtocol) -> tuple[str, ...]:
        """Return the other control methods that a line carries."""
        return tuple(
            name
            for name, method in load_profile(self.model).methods.items()
            if name != self.method and protocol.reaches_by(method.addressing)
        )

    def goes_through_plc(self, protocol: LineProtocol) -> bool:
        """Return whether a PLC is between the line and the drive."""
        return self.model != AUTO and self.method_class.addressing in protocol.carries

    def end_unconfirmed(self, protocol: LineProtocol) -> str:
        """Return what is said where the driver ends, and no stop was confirmed."""
        if self.goes_through_plc(protocol):
            return (
                'ending WITHOUT a stop that the PLC has confirmed: the program of this driver in '
                'the PLC stops the motor 1 s after the last request, if the PLC runs and reaches '
                'the drive; else use the enable input or the emergency stop'
            )
        return (
            'ending WITHOUT a confirmed stop, the motor may still run: use the enable input or '
            'the emergency stop'
        )

    def _require_no_broadcast(self, protocol: LineProtocol) -> None:
        """Make sure that no write to one drive reaches all that are behind a gateway."""
        if protocol is not PROTOCOLS['modbus_tcp'] or self.address:
            return
        if self.goes_through_plc(protocol):
            return
        if self.model != AUTO and load_profile(self.model).line.get('protocol') == protocol.name:
            return
        raise ValueError(
            'address 0: behind a gateway that is all drives of its line; set address to that of '
            'the drive (0 is for a drive that is at the network itself: line: {protocol: '
            'modbus_tcp} in the file that describes it; and for a PLC)'
        )

    def require_line(self, protocol: LineProtocol) -> None:
        """
        Make sure that the drive can be reached over a line.

        :raises ValueError: it cannot; the message says what to set.
        """
        protocol.require_unit(self.address)
        self._require_no_broadcast(protocol)
        if self.model == AUTO:
            return
        needed = self.method_class.addressing
        if not protocol.reaches_by(needed):
            able = _or(line.name for line in PROTOCOLS.values() if line.reaches_by(needed))
            raise ValueError(
                f'control_method {self.method} of {self.model} needs another line: '
                f'set protocol to {able} (it is {protocol.name})'
            )
        family = load_family(self.model)
        places = family[family.key_of_status].addresses
        if not needed and protocol.addressing not in places:
            able = _or(line.name for line in PROTOCOLS.values() if line.addressing in places)
            raise ValueError(
                f'no {self.model} is on a line of {protocol.name}: set protocol to {able}, or '
                'another model'
            )
        if self.block_address and needed not in protocol.carries:
            raise ValueError(
                f'block_address {self.block_address}: it is for control_method telegram1 alone'
            )

    def __post_init__(self) -> None:
        settings = settings_of(DriveSettings)
        if self.family:
            object.__setattr__(self, 'model', self._model_of_family())
        elif not is_family(self.model):
            _one_of('model', self.model, (*families(), AUTO))
        if self.control_method:
            _one_of('control_method', self.control_method, _control_methods(self.model))
        settings['reference'].check(self.reference)
        kind = f'{self.method} on {self.model}'
        allowed = _references(self.model, self.method)
        if self.reference not in allowed:
            raise ValueError(
                f'reference {self.reference!r}: with {kind} it must be {" or ".join(allowed)}'
            )
        settings['classic_dialect'].check(self.classic_dialect)
        self._require_known_method()
        if self.telegram_words:
            _one_of('telegram_words', self.telegram_words, _telegram_words(self.model, self.method))
        modes = _control_modes(self.model, self.method)
        _one_of('expected_control_mode', self.expected_control_mode, ('', *modes))
        self._require_measured()
        self._require_own_addresses()
        settings['on_jam'].check(self.on_jam)
        if self.expected_control_mode == SPEED.mode and not self.nominal_speed:
            self._require_no_speed_mode()
        self._check_drive_timeout()
        for name, declared in settings.items():
            # what a family decides was checked above
            if declared.low is not None:
                declared.check(getattr(self, name))
        if self.jam_current:
            self._require_jam_possible()

    def _require_no_speed_mode(self) -> None:
        if _has_speed_mode(self.model, self.method):
            raise ValueError(
                f'expected_control_mode Speed with control_method {self.method}: set '
                'nominal_speed first, in rpm, such as 1500 of a four-pole motor; the telegram '
                'does not have it'
            )

    def _model_of_family(self) -> str:
        """Return the model that :attr:`family` means; it is loaded to check it."""
        found = find(self.family)
        if self.model not in (usual_family(), found):
            raise ValueError(
                f'family is {self.family} and model is {self.model}: omit one of them'
            )
        try:
            load_family(found)
        except CatalogError as error:
            raise ValueError(f'family {self.family} cannot be used: {error}') from error
        return found

    @functools.cached_property
    def wanted_drive_timeout(self) -> float:
        """What the communication time-out of the drive is to be, s; 0: it is left as it is."""
        if self.drive_timeout != AS_THE_DRIVE_CAN:
            return self.drive_timeout
        for longest, step in _drive_timeouts(self.model):
            seconds = self._least_drive_timeout(step, _USUAL_DRIVE_TIMEOUT)
            return seconds if seconds <= longest else 0.0
        return 0.0

    def _least_drive_timeout(self, step: Fraction, usual: float = 0.0) -> float:
        """Return the least time-out that noise does not reach, at least ``usual``, s."""
        least = max(usual, self.lost_after + DRIVE_TIMEOUT_MARGIN)
        return float(math.ceil((least - 1e-7) / step) * step)

    def _check_drive_timeout(self) -> None:
        if self.drive_timeout == AS_THE_DRIVE_CAN:
            # the table of the drive is read now, and not when the motor is to run
            assert self.wanted_drive_timeout >= 0
            return
        # a drive that has none refuses any, with the reason
        own = _drive_timeouts(self.model) or _drive_timeouts(AUTO)
        longest, step = max(most for most, _ in own), min(least for _, least in own)
        whose = f' with {self.model}' if len(own) == 1 else ''
        declared = settings_of(DriveSettings)['drive_timeout']
        declared = replace(declared, low=0, high=float(longest), unit=f's{whose}')
        declared.check(self.drive_timeout)
        if 0 < self.drive_timeout < self.lost_after + DRIVE_TIMEOUT_MARGIN - 1e-9:
            raise ValueError(
                f'drive_timeout {self.drive_timeout:g} s: at least '
                f'{self._least_drive_timeout(step):g} s, half a second more than '
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

    def _require_measured(self) -> None:
        names = tuple(filter(None, self.measured))
        if not names or self.model == AUTO:
            return
        family = load_family(self.model, self.method, self.telegram_words)
        known = tuple(parameter.key for parameter in family.measured)
        for name in names:
            if name not in known:
                raise ValueError(
                    f'measured: {self.model} measures no {name!r}: choose of {", ".join(known)}'
                )

    def _require_jam_possible(self) -> None:
        """Make sure that a jam can be told from what is measured."""
        if not self.jam_speed > 0:
            raise ValueError(
                'jam_current needs jam_speed: set it too, in the unit of actual in ~/status, such '
                'as a tenth of the usual set-point'
            )
        self._require_jam_measured_often()
        if self.method == MONITOR:
            raise ValueError(
                'jam_current with control_method monitor: the driver does not run this motor and '
                'knows no set-point of it; set jam_current to 0'
            )
        if not self.follows_setpoints:
            raise ValueError(
                f'jam_current with reference {self.reference}: the driver does not know how fast '
                'the motor is to turn; set reference to fieldbus, or jam_current to 0'
            )
        if self.model != AUTO:
            self._require_jam_measured()

    def _require_jam_measured_often(self) -> None:
        if not self.telemetry_rate:
            raise ValueError(
                'jam_current needs telemetry_rate, at which the current is measured: set it to 2, '
                'or jam_current to 0'
            )
        least = 2 / min(self.telemetry_rate, self.poll_rate or math.inf)
        if self.jam_time < least - 1e-9:
            raise ValueError(
                f'jam_time {self.jam_time:g} s: with this telemetry_rate and poll_rate at least '
                f'{least:g} s, so that current and speed are measured three times'
            )

    def _require_jam_measured(self) -> None:
        family = load_family(self.model, self.method, self.telegram_words, self.telegram_speed)
        modes = (self.expected_control_mode,) if self.expected_control_mode else QUANTITIES
        speeds = [QUANTITIES[mode].role for mode in modes if QUANTITIES[mode].hertz]
        if not speeds:
            raise ValueError(
                f'jam_current with expected_control_mode {self.expected_control_mode}: no speed '
                'is controlled, so a slow motor says nothing; set jam_current to 0'
            )
        lacking = 'current' if Role.OUTPUT_CURRENT not in family.roles else ''
        if family.roles.keys().isdisjoint(speeds):
            lacking = ' and '.join(filter(None, (lacking, 'speed')))
        if lacking:
            raise ValueError(
                f'jam_current: {self.model} with control_method {self.method} measures no '
                f'{lacking}; set jam_current to 0'
            )

    @property
    def own_parameters(self) -> tuple[str, ...]:
        """The parameters that the user names."""
        return tuple(filter(None, self.drive_addresses))

    def _require_own_addresses(self) -> None:
        if self.own_parameters and self.model != AUTO:
            try:
                load_family(self.model, self.method, self.telegram_words, own=self.own_parameters)
            except ValueError as error:
                raise ValueError(f'drive_addresses: {error}') from None

    def _require_known_method(self) -> None:
        for profile in _profiles(self.model):
            method = profile.methods.get(self.method)
            dialect = profile.older.name if profile.older is not None else ''
            if dialect and dialect == self.classic_dialect and method and not method.older:
                others = _or(name for name, old in profile.methods.items() if old.older)
                raise ValueError(f'classic_dialect {dialect} has no {method.means}: use {others}')


def _or(names: Iterable[str]) -> str:
    return ' or '.join(names)


def _one_of(name: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        shown = ', '.join(repr(choice) for choice in allowed)
        raise ValueError(f'{name} {value!r}: choose one of {shown}')
