# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the black box keeps, for how long, and how much room its bags take; without a node."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
from pathlib import Path
import struct
import time
from typing import Any

from bench import wait_until
import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import Float32

from nfo_sinus_driver.node.bags import bags, black_box
from nfo_sinus_driver.node.bags.black_box import BlackBox
from nfo_sinus_driver.node.ros.qos import LATCHED, RELIABLE


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have what follows a stop be short."""
    monkeypatch.setattr(black_box, '_AFTER', 0.1)
    monkeypatch.setattr(black_box, '_LEAST_APART', 0.5)


def made(_: float, value: float) -> bytes:
    return bytes(serialize_message(Float32(data=value)))


@contextlib.contextmanager
def box_in(folder: Path, seconds: float = 10.0) -> Iterator[tuple[BlackBox, list[str]]]:
    warnings: list[str] = []
    box = BlackBox(seconds, lambda: folder, warnings.append)
    box.start()
    try:
        yield box, warnings
    finally:
        box.close()


def found(folder: Path) -> list[Path]:
    return sorted(path.parent for path in folder.glob('*/metadata.yaml'))


def values_in(bag: Path, topic: str) -> list[float]:
    return [message.data for _, _, message in bags.read(bag, lambda name: name == topic)]


def keep_some(keep: Callable[[float, Any], None], now: float, *ages: float) -> None:
    for age in ages:
        keep(now - age, age)


def test_what_is_old_is_gone_but_for_what_holds(tmp_path: Path) -> None:
    with box_in(tmp_path) as (box, _):
        speed = box.stream('/speed', Float32, RELIABLE, made)
        state = box.stream('/state', Float32, LATCHED, made, holds=True)
        now = time.monotonic()
        keep_some(state, now, 40.0, 30.0)
        keep_some(speed, now, 25.0, 11.0, 9.0, 1.0, 0.0)
        box.testify('a reason')
        wait_until(lambda: found(tmp_path), 'a bag')
    (bag,) = found(tmp_path)
    assert values_in(bag, '/speed') == [9.0, 1.0, 0.0]
    assert values_in(bag, '/state') == [30.0]
    times = [stamp for _, stamp, _ in bags.read(bag, lambda _: True)]
    assert times == sorted(times)


def test_reasons_that_come_together_are_in_one_bag_and_later_ones_in_another(
    tmp_path: Path
) -> None:
    with box_in(tmp_path) as (box, _):
        keep = box.stream('/speed', Float32, RELIABLE, made)
        keep(time.monotonic(), 1.0)
        box.testify('one')
        box.testify('two')
        box.testify('one')
        wait_until(lambda: found(tmp_path), 'a bag')
        box.testify('three')
        box.testify('four')
        wait_until(lambda: len(found(tmp_path)) > 1, 'another one')
    told = [bags.metadata(bag)['custom_data']['why'] for bag in found(tmp_path)]
    assert sorted(told) == ['one; two', 'three; four']


def test_the_oldest_bags_go_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = tmp_path / 'of the owner'
    other.mkdir()
    (other / 'metadata.yaml').write_text('his')
    for day in range(1, 5):
        bag = tmp_path / f'2026-01-0{day}_00-00-00'
        bag.mkdir()
        (bag / 'metadata.yaml').write_text('x' * 400)
    monkeypatch.setattr(black_box, '_MOST_BYTES', 1000)
    with box_in(tmp_path) as (box, _):
        box.stream('/speed', Float32, RELIABLE, made)(time.monotonic(), 1.0)
        box.testify('a reason')
        wait_until(lambda: len(found(tmp_path)) == 4, 'a bag, and room for it')
    names = [path.name for path in found(tmp_path)]
    assert names[:2] == ['2026-01-03_00-00-00', '2026-01-04_00-00-00']
    assert 'of the owner' in names


def test_a_bag_that_is_due_is_written_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(black_box, '_AFTER', 60.0)
    with box_in(tmp_path) as (box, _):
        box.stream('/speed', Float32, RELIABLE, made)(time.monotonic(), 1.0)
        box.testify('a reason')
    assert len(found(tmp_path)) == 1


def test_no_room_is_one_warning_and_then_bags_are_written_again(tmp_path: Path) -> None:
    folder = tmp_path / 'box'
    folder.write_text('a file')
    with box_in(folder) as (box, warnings):
        box.stream('/speed', Float32, RELIABLE, made)(time.monotonic(), 1.0)
        for _ in range(3):
            box.testify('a reason')
            time.sleep(0.3)
        wait_until(lambda: warnings, 'a warning')
        folder.unlink()
        box.testify('another')
        wait_until(lambda: found(folder), 'a bag')
    assert len(warnings) == 1 and 'cannot write a bag' in warnings[0]


def test_off_it_keeps_nothing(tmp_path: Path) -> None:
    with box_in(tmp_path, 0.0) as (box, _):
        keep = box.stream('/speed', Float32, RELIABLE, made)
        keep(time.monotonic(), 1.0)
        box.testify('a reason')
        assert not box.is_on and not box._kept and not box._thread.is_alive()
    assert not found(tmp_path)


def test_what_cannot_be_published_is_left_out(tmp_path: Path) -> None:
    with box_in(tmp_path) as (box, _):
        keep = box.stream('/speed', Float32, RELIABLE, failing)
        for value in (1.0, -1.0, -2.0, 2.0):
            keep(time.monotonic(), value)
        box.testify('a reason')
        wait_until(lambda: found(tmp_path), 'a bag')
    assert values_in(found(tmp_path)[0], '/speed') == [1.0, 2.0]


def failing(at: float, value: float) -> bytes:
    if value < 0:
        raise OverflowError if value > -2 else struct.error
    return made(at, value)
