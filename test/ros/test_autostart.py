# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive is looked for until it has started, by a thread that is gone then."""

from __future__ import annotations

from collections.abc import Iterator
import threading

import pytest
import rclpy
from rclpy.lifecycle import LifecycleNode
from rclpy.signals import SignalHandlerOptions

from nfo_sinus_driver.node.drive import lifecycle
from nfo_sinus_driver.node.drive.lifecycle import Lifecycle

#: Far longer than anything here takes, s.
PATIENCE = 20.0


class Drive(LifecycleNode):
    """A node that cannot be configured, for so many tries."""

    def __init__(self) -> None:
        super().__init__('tried')
        self.declare_parameter('autostart', True)
        self.failures = 0
        self.error: Exception | None = None
        self.by_operator: list[bool] = []
        self.tried = threading.Event()
        self.lifecycle = Lifecycle(self)

    def trigger_configure(self) -> object:
        self.by_operator.append(self.lifecycle.by_operator)
        self.tried.set()
        self.failures -= 1
        if self.failures < 0:
            return super().trigger_configure()
        if self.error is not None:
            raise self.error
        return None


@pytest.fixture
def drive(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Drive]:
    monkeypatch.setattr(lifecycle, '_REST', 0.001)
    rclpy.init(domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = Drive()
    yield node
    assert not any(thread.name == 'autostart of tried' for thread in threading.enumerate())
    node.destroy_node()
    rclpy.shutdown()


@pytest.mark.parametrize('error', [None, ValueError('oops')], ids=['fails', 'raises'])
def test_it_tries_until_it_works_and_then_no_more(drive: Drive, error: Exception | None) -> None:
    drive.failures, drive.error = 3, error
    drive.lifecycle.start()
    drive.lifecycle.join(PATIENCE)
    assert drive.lifecycle.state == 'active'
    # another client is the operator
    assert drive.by_operator == [False] * 4
    assert drive.lifecycle.by_operator


def test_it_gives_up_at_once_though_it_rests(
    drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lifecycle, '_REST', 3600.0)
    monkeypatch.setattr(lifecycle, '_LONGEST_REST', 3600.0)
    drive.failures = 1
    drive.lifecycle.start()
    assert drive.tried.wait(PATIENCE)
    assert drive.lifecycle.wanted
    drive.lifecycle.end()
    drive.lifecycle.join(PATIENCE)
    assert not drive.lifecycle.wanted


def test_one_that_was_never_started_can_be_joined(drive: Drive) -> None:
    drive.lifecycle.end()
    drive.lifecycle.join(PATIENCE)
    assert drive.by_operator == []
