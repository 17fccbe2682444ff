# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The black box: a stop that was not asked for leaves a bag that says why, with no recording."""

from __future__ import annotations

from pathlib import Path
import sys
import time

from bench import Bench, wait_until
import pytest

from nfo_sinus_driver.demo.record import plot
from nfo_sinus_driver.node.bags import bags

_ON = ('-p', 'black_box:=20.0')


def bags_of(bench: Bench) -> list[Path]:
    """Return the whole bags that are there, oldest first."""
    return sorted(path.parent for path in (bench.folder / 'state').rglob('metadata.yaml'))


def explained(bag: Path, capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    assert plot([str(bag), '--explain']) == 0
    return capsys.readouterr().out


def test_a_fault_leaves_a_bag_that_says_why(
    bench: Bench, capsys: pytest.CaptureFixture[str]
) -> None:
    simulator = bench.simulator(*bench.drives.ramps(1))
    bench.driver(*_ON)
    client = bench.client().connected()
    with client.run_at(20.0):
        time.sleep(1.0)
        simulator.inject('fault', bench.drives.overload.code)
        wait_until(lambda: not simulator.state()['driven'], 'it has stopped')
    wait_until(lambda: bags_of(bench), 'a bag')
    (bag,) = bags_of(bench)
    why = bags.metadata(bag)['custom_data']['why']
    assert why.startswith('nfo_sinus: ') and 'Overload' in why
    told = explained(bag, capsys)
    assert why in told and 'STOPPED, fault: ' in told and 'connected, ' in told, told
    topics = dict(bags.topics(bag))
    wanted = ('status', 'setpoint', 'inv_st', 'actual_speed', 'telemetry')
    assert {f'/nfo_sinus/{name}' for name in wanted} <= topics.keys()
    given = [message.data for topic, _, message in bags.read(bag, lambda name: 'setpoint' in name)]
    assert given and set(given) == {20.0}
    stamps = [stamp for _, stamp, _ in bags.read(bag, lambda _: True)]
    assert stamps == sorted(stamps) and abs(stamps[-1] / 1e9 - time.time()) < 60.0


def test_a_stop_that_was_asked_for_leaves_none(bench: Bench) -> None:
    simulator = bench.simulator(*bench.drives.ramps(1))
    bench.driver(*_ON)
    client = bench.client().connected()
    with client.run_at(20.0):
        time.sleep(0.5)
    assert client.call('stop').success
    wait_until(lambda: not simulator.state()['driven'], 'it has stopped')
    time.sleep(3.0)
    assert not bags_of(bench)


def test_without_a_library_for_bags_it_is_off_and_says_so_once(bench: Bench) -> None:
    simulator = bench.simulator(*bench.drives.ramps(1))
    through = sys.executable, str(Path(__file__).with_name('driver_without_bags.py'))
    driver = bench.driver(*_ON, through=through)
    client = bench.client().connected()
    with client.run_at(20.0):
        simulator.inject('fault', bench.drives.overload.code)
        wait_until(lambda: not simulator.state()['driven'], 'it has stopped')
    assert client.call('fault_ack').success
    off = 'the black box is off: neither rosbag2_py nor rosbags is installed (apt install ros-'
    assert driver.text.count(off) == 1
    time.sleep(2.0)
    assert not bags_of(bench) and 'cannot write' not in driver.text


def test_a_folder_that_cannot_be_written_is_one_warning(bench: Bench) -> None:
    (bench.folder / 'state').mkdir(exist_ok=True)
    (bench.folder / 'state' / 'nfo_sinus_driver').write_text('no folder')
    simulator = bench.simulator(*bench.drives.ramps(1))
    driver = bench.driver(*_ON, '-p', 'drive_timeout:=0.0')
    client = bench.client().connected()
    with client.run_at(20.0):
        simulator.inject('fault', bench.drives.overload.code)
        wait_until(lambda: not simulator.state()['driven'], 'it has stopped')
    wait_until(lambda: 'the black box cannot write a bag' in driver.text, 'the warning')
    assert client.call('fault_ack').success
