# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Both ends of every setting on Classic, as the manuals print them."""

from __future__ import annotations

import pytest
from support.addresses import packed
from support.ends import of_g2
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

    for ends in filter(lambda ends: has(ends.name), of_g2('classic', dialect).values()):
        for value in ends.counts:
            if there_and_back(ends.name, value) != packed(*ends.words(value)):
                wrong.append((ends.name, value))
        for value in ends.beyond:
            if there_and_back(ends.name, value) is not None:
                wrong.append((ends.name, value))
        if ends.step is not None:
            limits = registers.limits(ends.name)
            if limits != (ends.low, ends.high, pytest.approx(ends.step)):
                wrong.append((ends.name, limits))
    assert not wrong
