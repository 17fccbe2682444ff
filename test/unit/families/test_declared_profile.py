# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The requests to a drive that a file describes, step by step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.steps import REFUSED, play
from support.variants import shipped
import yaml

from nfo_sinus_driver.catalog import (
    ControlMethod,
    Holder,
    NotPossible,
    Refusal,
    Removal,
    load_family,
)
from nfo_sinus_driver.catalog.profile import Read, Wait, Write

COMMAND, SETPOINT, STATUS = 'line.r000a', 'line.setpoint', 'line.status'
ZERO = (Write(SETPOINT, 0.0), None), (Read(SETPOINT), 0.0)
ZERO_ONCE = (Write(SETPOINT, 0.0, retry=False), None)
PLAIN: dict[str, Any] = {
    'vfd': 1, 'title': 'Played', 'source': 'made up',
    'control': {
        'run': [{'register': 10, 'value': 1}],
        'stop': [{'register': 10, 'value': 0}],
        'reset': [{'register': 10, 'value': 8}, {'wait': 0.1}, {'register': 10, 'value': 0}],
    },
    'setpoint': {
        'register': 11, 'type': 'int16', 'factor': 0.1, 'unit': 'Hz', 'most': 60, 'signed': True,
    },
    'status': {
        'register': 20, 'running': {'bit': 0}, 'fault': {'bit': 3}, 'remote': {'bit': 9},
    },
    'parameters': {
        'source.command': {'register': 30, 'choices': {0: 'Keypad', 1: 'Bus'}},
    },
}


def played(tmp_path: Path, **otherwise: Any) -> ControlMethod:
    """Return the control method of a drive."""
    # a file is read once
    path = tmp_path / f'played{len(list(tmp_path.iterdir()))}.vfd.yaml'
    document = {**PLAIN, **otherwise}
    document['control'] = {**PLAIN['control'], **otherwise.get('control', {})}
    path.write_text(yaml.safe_dump(document), encoding='utf-8')
    family = load_family(str(path))
    return family.profile.methods['custom']('fieldbus', family.__contains__)


def stop(value: int = 0, **more: bool) -> tuple[Write, None]:
    """The stop, taken by the drive."""
    return Write(COMMAND, value, **more), None


def test_who_has_control(tmp_path: Path) -> None:
    method = played(tmp_path)
    for word, holder in ((1 << 9, Holder.BUS), (0, Holder.LOCAL)):
        assert play(method.holder(), (Read(STATUS), word)) is holder
    unknown = {'status': {'register': 20, 'running': {'bit': 0}, 'fault': {'bit': 3}}}
    assert play(played(tmp_path, **unknown).holder()) is Holder.BUS
    known = {'control': {'holder': {'parameter': 'source.command', 'bus': ['Bus']}}, **unknown}
    for value, holder in (('Bus', Holder.BUS), ('Keypad', Holder.LOCAL)):
        method = played(tmp_path, **known)
        assert play(method.holder(), (Read('source.command'), value)) is holder


def test_a_run_command_that_was_left_is_taken_back_before_and_behind_the_control(
    tmp_path: Path,
) -> None:
    requires = [{'parameter': 'source.command', 'value': 'Bus', 'write': True}]
    method = played(tmp_path, control={'requires': requires})
    source = Read('source.command')
    written = (source, 'Keypad'), (Write('source.command', 'Bus', stored=True), None)
    play(method.take_control(), stop(), *written, stop(head=True))
    play(method.take_control(), stop(), (source, 'Bus'), stop(head=True))
    # without control a drive may refuse it
    play(method.take_control(), (Write(COMMAND, 0), REFUSED), *written, stop(head=True))
    with pytest.raises(Refusal):
        play(method.take_control(), stop(), *written, (Write(COMMAND, 0, head=True), REFUSED))
    # what prepares the same word leaves none
    method = played(tmp_path, control={'prepare': [{'register': 10, 'value': 6}]})
    play(method.take_control(), stop(), stop(6))
    method = played(tmp_path, control={'prepare': [{'register': 12, 'value': 6}]})
    play(method.take_control(), stop(), (Write('line.r000c', 6), None), stop(head=True))


def test_what_keeps_it_from_starting_is_reported_before_anything_is_written(tmp_path: Path) -> None:
    requires = [{'parameter': 'source.command', 'value': 'Bus', 'text': 'set P01 to 1'}]
    method = played(tmp_path, control={'requires': requires})
    remote, local_runs = (Read(STATUS), 1 << 9), (Read(STATUS), 1)
    play(method.require_startable(), remote, (Read('source.command'), 'Bus'))
    with pytest.raises(NotPossible, match=r'source.command is Keypad \(set P01 to 1\)'):
        play(method.require_startable(), remote, (Read('source.command'), 'Keypad'))
    with pytest.raises(NotPossible, match='keypad or terminals run the motor'):
        play(method.require_startable(), local_runs)


def test_each_step_of_a_stop_is_tried_by_itself(tmp_path: Path) -> None:
    edge = [{'coil': 3, 'on': True}, {'coil': 3, 'on': False}]
    method = played(tmp_path, control={'stop': edge, 'run': [
        {'coil': 2, 'on': True}, {'coil': 2, 'on': False},
    ]})
    on, off = (Write('line.coil_3', value, retry=False) for value in (1, 0))
    play(method.stop('Freque'), (on, None), (off, None), ZERO_ONCE)
    with pytest.raises(Refusal):
        play(method.stop('Freque'), (on, REFUSED), (off, None), (Read(STATUS), 1 << 9), ZERO_ONCE)
    # a drive that others control may refuse
    play(method.stop('Freque'), (on, REFUSED), (off, None), (Read(STATUS), 0))


def test_bits_are_kept_and_a_stop_needs_not_read_them(tmp_path: Path) -> None:
    method = played(tmp_path, control={
        'run': [{'register': 10, 'set': 1}], 'stop': [{'register': 10, 'clear': 1}],
    })
    read, written = Read(COMMAND, retry=False), lambda word: Write(COMMAND, word, retry=False)
    play(method.run(), (read, 0x50), (written(0x51), None))
    play(method.stop('Freque'), (read, 0x51), (written(0x50), None), ZERO_ONCE)
    play(method.stop('Freque'), (read, REFUSED), (written(0), None), ZERO_ONCE)
    with pytest.raises(Refusal):
        play(method.run(), (read, REFUSED))


def test_a_fault_is_reset_behind_the_stop(tmp_path: Path) -> None:
    method = played(tmp_path)
    reset = (Write(COMMAND, 8), None), (Wait(0.1), None), stop()
    shown = load_family(shipped('toshiba_vf_s11')).status_code(1)
    assert play(method.acknowledge(shown, 'Freque'), stop(), *ZERO, *reset) == ''
    with pytest.raises(NotPossible, match='refuses the stop'):
        play(method.acknowledge(shown, 'Freque'), (Write(COMMAND, 0), REFUSED), *ZERO)
    for command, zero, removed in (
        (None, ZERO, Removal.COMMAND),
        (REFUSED, ZERO, Removal.SETPOINT),
        (REFUSED, ((Write(SETPOINT, 0.0), REFUSED),), Removal.NOTHING),
    ):
        assert play(method.remove('Freque'), (Write(COMMAND, 0), command), *zero) is removed


def test_the_size_is_0_before_the_direction_changes() -> None:
    family = load_family(shipped('delta_vfd_el'))
    target = family.profile.setpoints['Freque']
    word = 'line.r2000'
    forward, back = Write(word, 0x12), Write(word, 0x22)
    for before, value, written in (
        (0.0, 20.0, [forward, Write(SETPOINT, 20.0)]),
        (20.0, 30.0, [forward, Write(SETPOINT, 30.0)]),
        (20.0, -5.0, [Write(SETPOINT, 0.0), back, Write(SETPOINT, 5.0)]),
        (-5.0, 0.0, [back, Write(SETPOINT, 0.0)]),
        (float('nan'), 20.0, [Write(SETPOINT, 0.0), forward, Write(SETPOINT, 20.0)]),
    ):
        assert list(target.writes(value, before)) == written, (before, value)
        values = {write.key: write.value for write in written}
        assert target.value(values) == value
