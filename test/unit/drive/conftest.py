# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""The rig of the drive's tests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import contextlib
from pathlib import Path
from typing import Any

from drive_rig import MODEST, MakeRig, Rig, patient
import pytest
from virtual_rig import MakeVirtual, VirtualRig

from nfo_sinus_driver.bus import worker as bus_module
from nfo_sinus_driver.drive import DriveSettings, drive_state, poller as watch_module, sequences


@pytest.fixture
def unhurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let what a drive is to confirm take longer: the clock goes on while the machine stands."""
    monkeypatch.setattr(drive_state, 'TIMEOUT', 10.0)


@pytest.fixture
def make_rig(tmp_path: Path, unhurried: None) -> Iterator[MakeRig]:
    """Makes a rig, started; at the end the laws are judged by what was on the line."""
    with contextlib.ExitStack() as stack:

        def make(
            *,
            parameters: dict[str, Any] | None = None,
            response_timeout: float = 2.0,
            run_input: bool = True,
            boot_time: float = 0.2,
            link: str | None = None,
            **settings: Any,
        ) -> Rig:
            settings.setdefault('lost_after', patient(settings.get('drive_timeout', 0.0)))
            settings.setdefault('poll_rate', MODEST)
            rig = Rig(
                tmp_path / 'trace',
                DriveSettings(**settings),
                parameters or {},
                response_timeout,
                run_input=run_input,
                boot_time=boot_time,
                link=link,
            )
            rig.start()
            stack.callback(rig.stop)
            return rig

        yield make


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the driver try again soon, where it is not tested how long it waits."""
    monkeypatch.setattr(bus_module, 'REOPEN_PERIOD', 0.05)
    monkeypatch.setattr(watch_module, '_RECONNECT_PERIOD', 0.1)
    monkeypatch.setattr(sequences, '_LOST_RETRY_PERIOD', 0.1)


@pytest.fixture
def rig(make_rig: MakeRig) -> Rig:
    """A rig as most tests need it."""
    return make_rig()


@pytest.fixture
def make_virtual() -> Iterator[MakeVirtual]:
    """Makes a rig in virtual time, as often as it is asked for; the one before ends."""
    rigs: list[VirtualRig] = []

    def end() -> None:
        while rigs:
            rigs.pop().close()

    def make(
        parameters: dict[str, Any] | None = None,
        variant: Mapping[str, str] | None = None,
        **settings: Any,
    ) -> VirtualRig:
        end()
        rigs.append(VirtualRig(parameters, variant, **settings))
        return rigs[-1]

    yield make
    end()
