# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Settings through ROS: both ends of one of each kind, beyond and between; what arrives there."""

from __future__ import annotations

from collections.abc import Iterator

from bench import Bench, Client
from connections import Connection, needs
from parameter_bench import (
    ANY_BUS,
    COUNTED,
    Value,
    Wire,
    ends_of,
    refused,
    set_one,
    values,
    written,
)
import pytest

from nfo_sinus_driver.demo.bench import own_domain

pytestmark = needs('parameters')

#: One of each kind; test/unit/drive/settings/test_ends_on_classic.py has both ends of all,
#: test_parameters_listed.py what is shown of all.
_ONE_OF_EACH = (
    'freque.f_fix1', 'control.accel', 'control.st_mode', 'serial.si_prot', 'serial.address',
    ANY_BUS,
)


class Rig:
    """One drive and its driver for all tests here: every test leaves the drive as it was."""

    def __init__(self, bench: Bench) -> None:
        self.connection = bench.connection
        self.drive = bench.simulator()
        bench.driver(*COUNTED, '-p', 'allow_communication_changes:=true')
        self.client: Client = bench.client().connected()
        self.wire = Wire(bench)
        self.wire.writes()

    def has(self, name: str, value: Value) -> None:
        """See that ROS and the drive have the same value, of the right type."""
        shown = values(self.client, name)[name]
        assert shown == value
        assert type(shown) is type(value)
        assert self.drive.state()['parameters'][name] == value


@pytest.fixture(scope='module')
def rig(tmp_path_factory: pytest.TempPathFactory, connection: Connection) -> Iterator[Rig]:
    with (
        own_domain() as domain,
        Bench(domain, tmp_path_factory.mktemp('ends'), connection) as bench,
    ):
        yield Rig(bench)


def test_both_ends_and_labels_arrive_and_nothing_beyond_them(rig: Rig) -> None:
    classic = rig.connection.protocol == 'classic'
    there = ends_of(rig.connection)
    # on older firmware these count at once, and the line is gone [C7]
    guarded = () if 'later' in rig.connection.features else ('serial.address',)
    for ends in (there[name] for name in _ONE_OF_EACH if name in there and name not in guarded):
        name = ends.name
        factory = present = values(rig.client, name)[name]
        for value in ends.beyond:
            refused(set_one(rig.client, name, value), name)
        assert rig.wire.writes() == [], name
        # the low end twice, for one of both may be the factory's
        for value in (ends.low, ends.high, ends.low, *ends.counts):
            result = set_one(rig.client, name, value)
            assert result.successful, result.reason
            request = written(name, ends.words(value), classic=classic)
            assert rig.wire.writes() == ([] if value == present else [request]), (name, value)
            rig.has(name, value)
            present = value
        assert set_one(rig.client, name, factory).successful
        rig.wire.writes()
