# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Any changes over any connection, whatever drive and line make of it: all, none, or named."""

from __future__ import annotations

import itertools

from hypothesis import given, settings, strategies as st
import pytest
from support.examples import examples
from support.rig import Rig
from support.said import said

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive.change.parameter_writer import ParameterError
from nfo_sinus_driver.link import Refused

#: What the drive has, what is wanted, and what it has where it keeps another value.
VALUES: dict[str, dict[str, tuple[Value, Value, Value]]] = {
    'sinus_g2': {
        'control.accel': (1.0, 7.0, 3.0),
        'control.retard': (1.0, 7.0, 3.0),
        'freque.f_fix1': (1.0, 7.0, 3.0),
        'control.st_mode': ('Brake', 'Release', 'Brake'),
        'control.energy_save': (False, True, False),
        'motor.u_nom': (400, 230, 333),
    },
    'movitrac31': {
        'ramp.t11_up': (1.0, 7.0, 3.0),
        'ramp.t11_down': (1.0, 7.0, 3.0),
        'ramp.t12_up_down': (1.0, 7.0, 3.0),
        'ramp.t11_s_pattern': (0, 2, 1),
    },
}
REFUSALS = {
    'no address': Refused.ILLEGAL_ADDRESS,
    'no value': Refused.ILLEGAL_VALUE,
    'not now': Refused.DEVICE_FAILURE,
}
#: What becomes of a request: ``lie``, it is done and refused; ``keep``, the drive has another value
#: and says nothing of it; else as ``Rig.meet`` has it.
FATES = ['obey', *REFUSALS, 'lie', 'ignored', 'keep', 'unheard', 'drop', 'damage', 'double']
#: Mostly it obeys, so that something is done before it does not; two times it does not.
TWO = st.lists(
    st.tuples(st.integers(0, 9), st.sampled_from(FATES[1:])).map(
        lambda pair: ['obey'] * pair[0] + [pair[1]]
    ),
    min_size=1,
    max_size=2,
).map(lambda lists: list(itertools.chain.from_iterable(lists)))
#: Sooner or later it hardly ever obeys any more.
MANY = st.tuples(
    st.integers(0, 12), st.lists(st.sampled_from(FATES + 3 * [*REFUSALS]), min_size=9, max_size=30)
).map(lambda pair: ['obey'] * pair[0] + pair[1])


class Moody:
    """Has requests for some settings meet their fates, one for each; then the drive obeys."""

    def __init__(self, rig: Rig) -> None:
        self.values = VALUES[rig.connection.model]
        self.fates: list[str] = []
        self._rig = rig
        rig.meet = self.meet

    def meet(self, key: str, data: bytes | None) -> str | None:
        if key not in self.values or not self.fates:
            return None
        fate = self.fates.pop(0)
        if fate in REFUSALS:
            raise Refused(REFUSALS[fate])
        if fate in ('lie', 'keep', 'ignored', 'obey'):
            if data is None or fate == 'obey':
                return None
            if fate != 'ignored':
                kept = self._rig.drive.params.value(key, data)
                kept = self.values[key][2] if fate == 'keep' else kept
                self._rig.far.set_from_keypad(key, kept)
            return 'refused' if fate == 'lie' else 'ignored'
        return fate

    def has(self) -> dict[str, Value]:
        """Return what the drive has."""
        return {key: self._rig.far.peek(key) for key in self.values}

    def reset(self) -> None:
        """Let the drive have what it had, and the driver know it."""
        self.fates = []
        for key, (before, *_) in self.values.items():
            self._rig.far.set_from_keypad(key, before)
        self._rig.result(self._rig.drive.parameters.read(self.values))


@pytest.mark.parametrize('moods', [TWO, MANY], ids=['two', 'many'])
@pytest.mark.parametrize(
    'connection', ['rtu', 'tcp', 'classic', 'classic v5.0', 'canopen', 'movitrac']
)
def test_all_new_or_all_old_or_named(connection: str, moods: st.SearchStrategy[list[str]]) -> None:
    ends = dict.fromkeys(('done', 'undone', 'left'), 0)
    with Rig(connection, poll_rate=5.0) as rig:
        rig.connect()
        moody, parameters = Moody(rig), rig.drive.parameters
        keys = list(moody.values)

        def change(new: dict[str, bool], fates: list[str]) -> None:
            old = moody.has()
            wanted = {key: moody.values[key][chosen] for key, chosen in new.items()}
            moody.fates = list(fates)
            left: tuple[str, ...] = ()
            expected = old
            try:
                changes = rig.result(parameters.change(wanted))
            except ParameterError as error:
                left = error.left
                text = said(error)
                assert all(f'{key} is NOT put back' in text for key in left)
                ends['left' if left else 'undone'] += 1
            else:
                expected = {**old, **wanted}
                changed = {key for key in wanted if wanted[key] != old[key]}
                assert {change.key for change in changes} == changed
                ends['done'] += 1
            moody.fates = []
            assert set(left) <= set(wanted)
            # a drive that refuses twice is put right all the same
            assert not left or moods is MANY
            has = moody.has()
            for key in set(keys) - set(left):
                assert has[key] == expected[key] == parameters.values[key], key
            if left:
                # what may be otherwise than before is not known until it is read
                moody.reset()

        chosen = st.dictionaries(st.sampled_from(keys), st.booleans(), min_size=1)

        @settings(max_examples=examples(60))
        @given(st.lists(st.tuples(chosen, moods), min_size=2, max_size=3))
        def run(sequence: list[tuple[dict[str, bool], list[str]]]) -> None:
            moody.reset()
            for new, fates in sequence:
                change(new, fates)

        run()
    assert ends['done'] and ends['undone'], ends
    assert bool(ends['left']) is (moods is MANY), ends
