# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The settings of a drive as ROS parameters: which there are, of which type, and how described."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from bench import Bench, Client
from connections import needs
from parameter_bench import QUIET, Wire, ends_of, says_once, settings, values
import pytest
from rcl_interfaces.srv import DescribeParameters
from setting_names import SETTINGS
from support.ends import Ends

pytestmark = needs('parameters')

ROWS = [line.split(',') for line in SETTINGS.splitlines() if line]
#: The name in the manual, by the name of the ROS parameter.
MANUAL = {ros: name for _, name, ros, _ in ROWS}
#: The type of the ROS parameter.
TYPES = {
    ros: {'bool': bool, 'integer': int, 'double': float, 'string': str}[type_]
    for _, _, ros, type_ in ROWS
}
GROUPS = {name.partition('.')[0] for name in MANUAL}

#: What belongs to the drive's own time-out: the line is not lost by it.
OF_TIMEOUT = {'serial.sio_tot', 'serial.auto_stop'}

#: Some in full, copied from the manual [M0 table 2].
IN_FULL = {
    'motor.p_nom': 'P-Nom: Nominal motor output (RMS) [kW]',
    'control.accel': 'Accel: Acceleration time from 0 to f-Nom [s]',
    'control.st_mode': 'StMode: Stop mode',
    'freque.f_fix1': 'F-fix1: Fixed frequency 1 [Hz]',
    'error.overload_s_temp': 'OverLoad/S-Temp: Power monitor / Surround temperature [°C]',
    'serial.sio_tot': 'SioTot: Serial interface timeout [s]',
}


def _listed(client: Client) -> set[str]:
    """Return the names of the drive's parameters among those of its node."""
    names = client.parameter_names()
    return {name for name in names if name.partition('.')[0] in GROUPS and '.' in name}


def test_every_setting_that_can_be_reached_is_there_and_described(bench: Bench) -> None:
    bench.simulator()
    bench.driver(*QUIET)
    client = bench.client().connected()
    wire = Wire(bench)
    assert len(MANUAL) == 120
    reached = settings(bench.connection)
    assert _listed(client) == set(reached) == set(MANUAL) - bench.connection.beyond
    wrong = {name: value for name, value in values(client, *reached).items()
             if type(value) is not TYPES[name]}
    assert wrong == {}
    described = client.call('describe_parameters', DescribeParameters, names=reached)
    assert wire.writes() == [], 'listing them is no reason to write'
    complaints = [
        f'{ends.name}: {complaint}'
        for shown, ends in zip(
            described.descriptors, ends_of(bench.connection).values(), strict=True
        )
        for complaint in _complaints(shown, ends)
    ]
    assert complaints == []


@needs('modbus')
def test_any_bus_has_no_register_and_is_not_there(bench: Bench) -> None:
    bench.simulator()
    driver = bench.driver(*QUIET, '-p', 'control.any_bus:=PPO3')
    client = bench.client().connected()
    assert 'control.any_bus' not in _listed(client)
    says_once(driver, 'this drive has no control.any_bus: not applied')
    assert Wire(bench).writes() == []


def _complaints(shown: Any, ends: Ends) -> Iterator[str]:
    """Return what is wrong with a descriptor."""
    text = shown.description
    if shown.name != ends.name:
        yield f'named {shown.name}'
    if not text.startswith(f'{MANUAL[ends.name]}: ') or text.endswith(': '):
        yield f'not the name of the manual and a description: {text}'
    if text != IN_FULL.get(ends.name, text):
        yield f'not as in the manual: {text}'
    unit = ends.unit.removesuffix('Unit*')
    if ('[' in text or unit) and not text.endswith(f' [{unit}]'):
        yield f'the unit is not {unit!r}: {text}'
    if ends.unit != unit and 'pi_reg.unit' not in text:
        yield f'does not say whose unit it has: {text}'
    constraints = shown.additional_constraints
    of_line = ends.name.startswith('serial.')
    # by the manual, or because the drive may be lost by it, and with it the stop
    stopped = ends.stopped or (of_line and ends.name not in OF_TIMEOUT)
    if ('the motor must be stopped' in constraints) != stopped:
        yield f'when it can be set: {constraints}'
    if ('allow_communication_changes' in constraints) != of_line:
        yield f'what it needs: {constraints}'
    labels = ', '.join(map(str, ends.counts))
    if type(ends.low) is str and not constraints.startswith(f'one of {labels}'):
        yield f'the labels are not {labels}: {constraints}'
    if shown.read_only or shown.dynamic_typing:
        yield 'the type is fixed, the value is not'
    yield from _wrong_range(shown, ends)


def _wrong_range(shown: Any, ends: Ends) -> Iterator[str]:
    numbers = type(ends.low) in (int, float)
    spans = [*shown.integer_range, *shown.floating_point_range]
    if len(spans) != numbers or bool(shown.integer_range) != (type(ends.low) is int):
        yield f'a range of the wrong kind: {spans}'
        return
    for span in spans:
        if (span.from_value, span.to_value) != (ends.low, ends.high):
            yield f'the range is not {ends.low} to {ends.high}: {span}'
        # RegAmp is one of two numbers [C46]
        step = ends.high - ends.low if ends.step is None else ends.step
        if span.step != pytest.approx(step, rel=1e-6):
            yield f'the step is not {step:g}: {span.step}'
