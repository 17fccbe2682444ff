# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Both ends of every setting on Classic, against a copy of the manuals made by hand."""

from __future__ import annotations

import pytest
from support.addresses import packed
from support.classic_ends import OTHER_ON_CLASSIC, on_classic
from support.parameter_ends import ENDS
from support.rig import Rig

from nfo_sinus_driver.catalog import Value


@pytest.mark.parametrize(('connection', 'dialect'), [('classic', '2.03'), ('classic v5.0', '5.0')])
def test_the_ends_of_every_setting_go_there_and_back_and_nothing_beyond(
    connection: str, dialect: str
) -> None:
    with Rig(connection) as rig:
        registers = rig.connect().drive.params
        has = rig.drive.state.nameplate.has
    wrong: list[tuple[str, object]] = []

    def there_and_back(key: str, value: Value) -> bytes | None:
        try:
            data = registers.encode(key, value)
        except ValueError as error:
            assert str(error).startswith(f'{key}: ')
            return None
        back = registers.value(key, data)
        return data if back == value and type(back) is type(value) else b''

    for ends in (on_classic(ends, dialect) for ends in ENDS if has(ends.name)):
        for value, words in ((ends.low, ends.low_words), (ends.high, ends.high_words)):
            if there_and_back(ends.name, value) != packed(*words):
                wrong.append((ends.name, value))
        for value in (ends.below, ends.above, ends.between):
            if value is not None and there_and_back(ends.name, value) is not None:
                wrong.append((ends.name, value))
        for value in ends.neighbours or ():
            if not there_and_back(ends.name, value):
                wrong.append((ends.name, value))
        if ends.name in OTHER_ON_CLASSIC:
            low, high, step = registers.limits(ends.name)
            steps = ends.neighbours or (0, step)
            if (low, high) != (ends.low, ends.high) or steps[1] - steps[0] != pytest.approx(step):
                wrong.append((ends.name, (low, high, step)))
    assert not wrong
