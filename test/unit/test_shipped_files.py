# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Files that Docker, systemd, GitHub, SROS 2 and viewers read: what none of these would complain of.

What a file names of the driver's topics and services is tested with ROS.
"""

from __future__ import annotations

from collections.abc import Iterator
import inspect
import json
import re
import shutil
import signal
import subprocess
from typing import Any
from xml.etree import ElementTree

import pytest
from support.aggregator import ERROR, OK, WARN, Aggregator
from support.places import ROOT
from support.sros2_policy import allowed
import yaml

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.signals import ENDING

CONFIG = ROOT / 'config'
CI = '.github/workflows/ci.yaml'
SERVICE = 'config/nfo-sinus.service'
#: The time that the driver has between the signal and SIGKILL, s.
GRACE = {
    SERVICE: r'\nTimeoutStopSec=(\d+)\n',
    'docs/compose.yaml': r'stop_grace_period: (\d+)s\n',
    'docs/container.md': r'--stop-timeout (\d+)',
}
#: The main process of a service or a container: the driver itself, which alone gets the signal.
STARTED = {
    SERVICE: r'exec "[^"]*/lib/nfo_sinus_driver/([\w-]+)"',
    'docs/compose.yaml': r'command: >-\s+/workspace/install/\w+/lib/nfo_sinus_driver/(\S+)',
    'docs/container.md': r'nfo_sinus_driver \\\s+/workspace/install/\w+/lib/nfo_sinus_driver/(\S+)',
}


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding='utf-8')


def longest_end(shutdown_timeout: float) -> float:
    """How long the driver may take from the signal to its end, s."""
    main = read('nfo_sinus_driver/node/process/main.py')
    waits = dict(re.findall(r'^(_LAST_\w+) = ([\d.]+)', main, re.MULTILINE))
    closing = inspect.signature(Bus.close).parameters['timeout'].default
    # the stop, then the release; then the bus, the queue, the set-points, the callbacks and the
    # executors they belong to, the lifecycle
    stopping = 2 * (shutdown_timeout + float(waits['_LAST_ANSWER']))
    return stopping + float(closing) + 5 * float(waits['_LAST_CALLBACK'])


def test_a_driver_that_is_ended_has_time_to_stop_every_motor() -> None:
    default = DriveSettings(address=1).shutdown_timeout
    # as all three say: twice the longest, plus 20 s
    assert all(longest_end(seconds) <= 2 * seconds + 20 for seconds in (default, 100.0))
    for name, pattern in GRACE.items():
        times = [float(found) for found in re.findall(pattern, read(name))]
        assert times and min(times) >= 2 * default + 20, name
    # launch must not kill the driver before the container does
    page = read('docs/container.md')
    (times,) = re.findall(r'--stop-timeout (\d+) .*\n.*exit_timeout:=(\d+)', page)
    assert 0 <= float(times[0]) - float(times[1]) <= 5


def test_what_is_to_end_the_driver_reaches_it_and_stops_the_motors() -> None:
    for name, pattern in STARTED.items():
        (executable,) = re.findall(pattern, read(name))
        assert f"f'{executable} = " in read('setup.py'), name
    for name, setting in ((SERVICE, 'KillSignal='), ('Dockerfile', 'STOPSIGNAL ')):
        (found,) = re.findall(rf'\n{setting}(\w+)\n', read(name))
        assert signal.Signals[found] in ENDING, name
    in_the_image = re.findall(r'`([^`]+)` \(set in the image\)', read('docs/container.md'))
    assert in_the_image and all(f'{line}\n' in read('Dockerfile') for line in in_the_image)


def test_systemd_takes_the_service() -> None:
    analyze = shutil.which('systemd-analyze')
    if analyze is None:
        pytest.skip('systemd-analyze is not installed')
    done = subprocess.run(
        [analyze, 'verify', str(ROOT / SERVICE)], capture_output=True, text=True, check=False
    )
    # it speaks of other units of the machine, too
    assert [line for line in done.stderr.splitlines() if 'nfo-sinus' in line] == []


def test_container_and_ci_make_a_workspace_as_the_readme_says() -> None:
    begin = 'ln -s|rosdep install|colcon build'
    commands = re.findall(rf'^    ((?:{begin}).*)$', read('README.md'), re.MULTILINE)
    assert len(commands) == 3
    for name in ('Dockerfile', CI):
        assert [command for command in commands if command not in read(name)] == [], name


def test_an_edited_file_costs_the_image_no_new_download() -> None:
    before, after = read('Dockerfile').split('\nCOPY . ')
    # all that rosdep reads is there before, and nothing else
    copied = re.findall(r'^COPY (\S+) ', before, re.MULTILINE)
    assert copied == ['package.xml', 'msg_defs/package.xml']
    for download in ('apt-get install', 'rosdep install'):
        assert download in before and download not in after


def test_udev_gives_an_adapter_that_is_plugged_in_what_the_rules_say() -> None:
    text = read('config/99-nfo-sinus-serial.rules')
    (command,) = re.findall(r'^#\s+(udevadm trigger.*)$', text, re.MULTILINE)
    # its own default is `change`, to which a rule for `add` does not apply
    for action in set(re.findall(r'^ACTION=="(\w+)"', text, re.MULTILINE)):
        assert f'--action={action} ' in f'{command} '
    for subsystem in set(re.findall(r'SUBSYSTEM=="([\w-]+)"', text)):
        assert f'--subsystem-match={subsystem} ' in f'{command} '


def test_what_is_typed_into_a_container_goes_through_its_entry_point() -> None:
    (patched,) = re.findall(r'sed .* (/\w+\.sh)\n', read('Dockerfile'))
    for name in ('README.md', 'Dockerfile', 'docs/container.md'):
        typed = re.findall(r'docker exec -it \S+ (\S+) ros2 ', read(name))
        assert typed and set(typed) == {patched}, name


def test_what_the_ci_runs_is_there_and_is_shell() -> None:
    jobs: dict[str, Any] = yaml.safe_load(read(CI))['jobs']
    scripts = [step['run'] for job in jobs.values() for step in job['steps'] if 'run' in step]
    for script in (*scripts, read('.ci/run'), read('.ci/ros2')):
        subprocess.run(['bash', '-n'], input=script, text=True, check=True)
    text = '\n'.join(scripts)
    paths = re.findall(r'(?<![\w/])(?:src/nfo_sinus_driver/)?((?:\.ci|tools|examples)/\S+)', text)
    assert paths and all((ROOT / path).exists() for path in paths)
    parts = re.findall(r'^check_(\w+)\(\)', read('.ci/ros2'), re.MULTILINE)
    assert sorted(re.findall(r'\.ci/ros2 (\w+)', text)) == sorted(parts)


def test_the_hooks_before_a_commit_check_what_make_checks() -> None:
    (local,) = yaml.safe_load(read('.pre-commit-config.yaml'))['repos']
    assert local['repo'] == 'local'
    # whatever files are in a commit, and with the tools that were set up
    assert all(hook['language'] == 'system' for hook in local['hooks'])
    assert not any(hook['pass_filenames'] for hook in local['hooks'])
    hooks = {hook['entry'] for hook in local['hooks']}
    rules = re.findall(r'^(?:lint|types):.*\n((?:\t.*\n)+)', read('Makefile'), re.MULTILINE)
    checks = re.findall(r'^\t@(\.venv/bin/[^\n>]+?)(?: >.*)?$', ''.join(rules), re.MULTILINE)
    assert len(rules) == 2 and hooks == set(checks)


def test_sros2_takes_the_policy() -> None:
    path = CONFIG / 'sros2_policy.xml'
    assert allowed(path)
    sros2 = pytest.importorskip('sros2.policy', reason='sros2 is not installed')
    try:
        sros2.load_policy(path)
    except RuntimeError:
        raise
    except Exception as error:
        # its schema refers to another one on the network
        pytest.skip(f'sros2 cannot read its own schema here: {error}')


def leaves(layout: Any) -> Iterator[str]:
    """The panels of a Foxglove layout, by their places."""
    if isinstance(layout, str):
        yield layout
    else:
        yield from (*leaves(layout['first']), *leaves(layout['second']))


def test_foxglove_shows_every_panel_and_the_answer_to_a_stop() -> None:
    layout = json.loads(read('config/foxglove.json'))
    panels = layout['configById']
    assert sorted(leaves(layout['layout'])) == sorted(panels)
    # only so its answer is shown, which may be that the stop is not confirmed
    assert all(panel['editingMode'] for name, panel in panels.items() if 'CallService!' in name)


def test_plotjuggler_subscribes_to_what_it_draws() -> None:
    root = ElementTree.parse(CONFIG / 'plotjuggler.xml').getroot()
    (selected,) = root.iter('selected_topics')
    drawn = {curve.attrib['name'].rpartition('/')[0] for curve in root.iter('curve')}
    assert drawn == set(selected.attrib['value'].split(';'))


def test_top_level_of_the_diagnostics_is_ok_while_all_is_well() -> None:
    aggregator = Aggregator(CONFIG / 'diagnostic_aggregator.yaml')
    # the statuses are those of conveyor.yaml, as test/ros/test_config_names.py finds
    well = dict.fromkeys(aggregator.expected(), OK)
    assert aggregator.level(well) == OK
    for name in well:
        assert aggregator.level({**well, name: WARN}) == WARN
        assert aggregator.level({other: OK for other in well if other != name}) == ERROR, name
