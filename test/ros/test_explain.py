# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``plot --explain``: a bag alone says when a motor stopped, why, and who wanted that."""

from __future__ import annotations

from collections.abc import Iterator
import math
from pathlib import Path
import re
from typing import Any

from builtin_interfaces.msg import Time
from nfo_sinus_msgs.msg import DriveStatus
import pytest
from rcl_interfaces.msg import Log
from rclpy.serialization import serialize_message
from std_msgs.msg import Float32, Header
from std_srvs.srv import SetBool

from nfo_sinus_driver.demo.record import plot
from nfo_sinus_driver.demo.recorded import read
from nfo_sinus_driver.node.bags import bags
from nfo_sinus_driver.node.ros.qos import RELIABLE

_DRIVE = '/line1/infeed'
_BEGAN = 1_700_000_000
#: Why it stopped, one reason after the other, and in words.
_STOPS = {
    'STOP': 'a stop was requested: /line1/infeed/stop called by /panel',
    'DISABLE': 'a disable was requested: /line1/infeed/enable (false) called by /panel',
    'QUICK_STOP': 'a quick stop was requested: /line1/infeed/quick_stop called by /panel',
    'STOP_ALL': 'a stop of all drives was requested: /line1/nfo_sinus_bus/stop_all called by /plc',
    'LIFECYCLE': 'a transition was requested: /infeed/change_state (deactivated) called by /x',
    'DRIVER_ENDS': 'this driver ends: SIGTERM',
    'SETPOINT_TIMEOUT': 'no set-point for 2.5 s',
    'FAULT': 'fault 5 Overload',
    'RUN_INPUT': 'the RUN input of the drive was lost',
    'CONTROL_TAKEN': 'the keypad has control now',
    'DRIVE_LOST': 'lost: no answer',
}


def stamp(seconds: float) -> Time:
    return Time(sec=_BEGAN + int(seconds), nanosec=int(seconds % 1 * 1e9))


def status(at: float, reason: int = 0, text: str = '', *, enabled: bool = False) -> DriveStatus:
    state = DriveStatus.OPERATION_ENABLED if enabled else DriveStatus.SWITCHED_ON
    return DriveStatus(
        header=Header(stamp=stamp(at)), connected=True, enabled=enabled, state=state, unit='Hz',
        stop_reason=reason, stop_text=text,
    )


def statuses() -> Iterator[tuple[float, DriveStatus]]:
    """Yield what the drive reports: it is enabled every ten seconds, and stopped four later."""
    yield 0.0, status(0.0)
    for number, (name, text) in enumerate(_STOPS.items()):
        enabled_at = 10.0 * number + 1.0
        yield enabled_at, status(enabled_at, enabled=True)
        reason = getattr(DriveStatus, f'REASON_{name}')
        # who requested it may be reported a moment later
        yield enabled_at + 4.0, status(enabled_at + 4.0, reason, 'a client')
        yield enabled_at + 5.0, status(enabled_at + 5.0, reason, text)


def write(bag: Path, messages: list[tuple[str, float, Any]]) -> None:
    """Write messages: topic, when (s) and what."""
    writer = bags.create(bag, {})
    messages.sort(key=lambda message: message[1])
    for topic, type_ in {topic: type(message) for topic, _, message in messages}.items():
        writer.add_topic(topic, type_, RELIABLE)
    for topic, at, message in messages:
        writer.write(topic, int((_BEGAN + at) * 1e9), serialize_message(message))
    writer.close()


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """A bag of two drives on two lines; one was enabled by a call."""
    folder = tmp_path / 'run'
    event = SetBool.Event(request=[SetBool.Request(data=True)])
    event.info.stamp, event.info.event_type = stamp(0.9), event.info.REQUEST_RECEIVED
    answer = SetBool.Event(response=[SetBool.Response(success=True, message='enabled')])
    answer.info.stamp, answer.info.event_type = stamp(1.0), answer.info.RESPONSE_SENT
    call = f'{_DRIVE}/enable/_service_event'
    write(folder, [
        *((f'{_DRIVE}/status', at, status) for at, status in statuses()),
        (call, 0.9, event), (call, 1.0, answer), ('/line2/outfeed/status', 0.5, status(0.5)),
    ])
    return folder


def test_the_bag_alone_explains_each_stop(
    bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert plot([str(bag), '--drive', _DRIVE, '--explain']) == 0
    text = capsys.readouterr().out
    assert re.search(r'^ +0\.90  enable: enabled$', text, re.MULTILINE), text
    stops = re.findall(r'^ +([\d.]+)  (?:STOPPED|SET TO 0), ([\w ]+): (.*)$', text, re.MULTILINE)
    assert stops == [
        (f'{10 * number + 5}.00', name.lower().replace('_', ' '), text)
        for number, (name, text) in enumerate(_STOPS.items())
    ]


def test_each_line_has_a_picture_with_its_stops(bag: Path) -> None:
    assert plot([str(bag)]) == 0
    assert {path.name for path in bag.parent.glob('*.png')} == {
        'run_line1.png', 'run_line2.png'
    }
    first, second = read(bag, [_DRIVE, '/line2/outfeed'])
    assert len(first.stops) == len(_STOPS) and not second.stops
    # beside each other they count from the same moment
    assert first.began == second.began


def test_a_picture_is_where_it_is_said_to_be(
    bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for output in ('infeed', 'infeed.png', str(bag)):
        assert plot([str(bag), '--drive', _DRIVE, '--output', str(bag.parent / output)]) == 0
        said = capsys.readouterr().out.removeprefix('plot: the picture is ').strip()
        assert Path(said).is_file(), said


def test_a_name_that_is_not_in_the_bag_is_answered_by_those_that_are(
    bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for how in ('--explain', f'--output={bag.parent / "a.png"}'):
        assert plot([str(bag), '--drive', '/line1/Infeed', how]) == 1
        said = capsys.readouterr().err
        assert f'no drive /line1/Infeed in it, only {_DRIVE}, /line2/outfeed' in said


def test_what_cannot_be_written_was_read_all_the_same(
    bag: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # its end flushes once more, unless what is left was given up
    with open('/dev/full', 'w', encoding='utf-8') as full:
        monkeypatch.setattr('sys.stdout', full)
        assert plot([str(bag), '--explain']) == 1
    said = capsys.readouterr().err
    assert 'output cannot be written' in said and 'cannot read' not in said


def test_a_drive_that_never_answered_has_nothing_to_explain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / 'run', [(f'{_DRIVE}/status', 0.0, lost(0.0))])
    # such as of a name that was misspelt when it was recorded
    write(tmp_path / 'others', [('/setpoint', 0.0, Float32())])
    for bag in ('run', 'others'):
        assert plot([str(tmp_path / bag), '--drive', _DRIVE, '--explain']) == 1
        assert f'{_DRIVE} was never connected' in capsys.readouterr().err


def test_a_bag_that_begins_after_a_stop_explains_none(tmp_path: Path) -> None:
    messages = [
        (f'{_DRIVE}/status', at, status(at, DriveStatus.REASON_FAULT, 'fault 5'))
        for at in (0.0, 1.0)
    ]
    write(tmp_path / 'run', messages)
    [run] = read(tmp_path / 'run', [_DRIVE])
    assert run.stops == []


def test_a_better_reason_for_the_same_stop_is_no_other_stop(tmp_path: Path) -> None:
    reasons = (
        DriveStatus.REASON_NONE, DriveStatus.REASON_DRIVE_LOST, DriveStatus.REASON_POWER_CYCLE
    )
    messages = [
        (f'{_DRIVE}/status', at, status(at, reason, 'why'))
        for at, reason in enumerate(reasons)
    ]
    write(tmp_path / 'run', messages)
    [run] = read(tmp_path / 'run', [_DRIVE])
    assert [(stop.time, stop.reason) for stop in run.stops] == [(1.0, 'power cycle')]


def lost(at: float) -> DriveStatus:
    return DriveStatus(
        header=Header(stamp=stamp(at)), stop_reason=DriveStatus.REASON_DRIVE_LOST,
        stop_text='lost: no answer',
    )


def runs(at: float, value: float) -> DriveStatus:
    message = status(at, enabled=True)
    message.actual = message.setpoint = value
    return message


def test_where_a_drive_is_lost_no_curve_has_a_line_and_set_points_of_any_topic_are_drawn(
    tmp_path: Path,
) -> None:
    messages: list[tuple[str, float, Any]] = [
        (f'{_DRIVE}/status', 0.0, runs(0.0, 25.0)), (f'{_DRIVE}/status', 1.0, runs(1.0, 25.0)),
        (f'{_DRIVE}/status', 3.0, lost(3.0)), (f'{_DRIVE}/status', 8.0, status(8.0)),
        *((f'{_DRIVE}/actual_speed', at, Float32(data=value))
          for at, value in ((0.5, 740.0), (1.0, 750.0), (8.0, 0.0))),
    ]
    write(tmp_path / 'run', messages)
    [run] = read(tmp_path / 'run', [_DRIVE])
    for curve in (run.actual, run.speed):
        assert [time for time, value in zip(curve.times, curve.values, strict=True)
                if math.isnan(value)] == [3.0]
        assert curve.times == sorted(curve.times)
    assert run.setpoint.values == [25.0, 25.0]


def test_each_event_is_told_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = [
        (0.9, 'enable (true) called by /panel', 'enabled'),
        (3.0, f'{_DRIVE}/stop called by /panel', 'stopped (24 Stop)'),
    ]
    name = _DRIVE.strip('/').replace('/', '.')
    write(tmp_path / 'run', [
        (f'{_DRIVE}/status', 0.0, status(0.0)),
        (f'{_DRIVE}/status', 1.0, status(1.0, enabled=True)),
        (f'{_DRIVE}/status', 3.0, status(3.0, DriveStatus.REASON_STOP, _STOPS['STOP'])),
        (f'{_DRIVE}/status', 6.0, status(6.0, enabled=True)),
        (f'{_DRIVE}/status', 9.0, lost(9.0)),
        (f'{_DRIVE}/status', 10.0, lost(10.0)),
        *(('/rosout', at, Log(stamp=stamp(at), name=name, msg=f'{called}: {answer}'))
          for at, called, answer in log),
    ])
    assert plot([str(tmp_path / 'run'), '--drive', _DRIVE, '--explain']) == 0
    _, *lines = filter(None, capsys.readouterr().out.splitlines())
    assert [line.split(maxsplit=1)[1] for line in lines] == [
        'connected',
        'enable (true) called by /panel: enabled',
        f'STOPPED, stop: {_STOPS["STOP"]}',
        'enabled',
        'STOPPED, drive lost: lost: no answer',
        'the end of the recording',
    ]


def test_what_is_no_bag_is_refused(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert plot([str(bag / 'none'), '--explain']) == 1
    assert 'it is no bag' in capsys.readouterr().err
