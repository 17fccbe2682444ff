# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A bag is the same whichever library writes it, and whichever reads it."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import importlib
import importlib.util
from pathlib import Path
import struct
import subprocess
import sys
from types import ModuleType
from typing import Any

from nfo_sinus_msgs.msg import DriveStatus, InvSt
import pytest
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import Float32
from std_srvs.srv import SetBool

from nfo_sinus_driver.demo.recorded import drives_in, read
from nfo_sinus_driver.node.bags import bags
from nfo_sinus_driver.node.ros.qos import LATCHED, NEWEST, RELIABLE

MODULES = ('by_rosbag2', 'by_rosbags')
STAND_INS = Path(__file__).with_name('stand_ins')
MESSAGES: list[tuple[str, Any, QoSProfile]] = [
    ('/nfo_sinus/status', DriveStatus(unit='Hz', connected=True, setpoint=12.5), RELIABLE),
    ('/nfo_sinus/setpoint', Float32(data=12.5), NEWEST),
    ('/nfo_sinus/inv_st', InvSt(text='Überlast', kind=InvSt.FAULT), LATCHED),
    ('/nfo_sinus/enable/_service_event', SetBool.Event(request=[SetBool.Request(data=True)]),
     RELIABLE),
]


@pytest.fixture(scope='module')
def modules() -> Iterator[dict[str, ModuleType]]:
    """Those whose library is here; rosbag2_py itself where it is installed."""
    folder = str(STAND_INS)
    missing = importlib.util.find_spec('rosbag2_py') is None
    if missing:
        sys.path.append(folder)
    found = {}
    for name in MODULES:
        with contextlib.suppress(ImportError):
            found[name] = importlib.import_module(f'nfo_sinus_driver.node.bags.{name}')
    yield found
    if missing:
        sys.path.remove(folder)
        for name in ('rosbag2_py', 'nfo_sinus_driver.node.bags.by_rosbag2'):
            sys.modules.pop(name, None)


def written(module: ModuleType, folder: Path) -> Path:
    """A bag with each message once, a second apart."""
    bag = module.Writer(folder, {'drive': 'simulated'})
    for topic, message, offered in MESSAGES:
        bag.add_topic(topic, type(message), offered)
    for number, (topic, message, _) in enumerate(MESSAGES):
        bag.write(topic, (number + 1) * 10**9, serialize_message(message))
    bag.close()
    return folder


@pytest.mark.parametrize('reader', MODULES)
@pytest.mark.parametrize('writer', MODULES)
def test_what_one_writes_the_other_reads(
    modules: dict[str, ModuleType], tmp_path: Path, writer: str, reader: str
) -> None:
    if missing := {writer, reader} - set(modules):
        pytest.skip(f'the library of {", ".join(missing)} is not installed')
    bag = written(modules[writer], tmp_path / 'bag')
    topics = {topic for topic, _, _ in MESSAGES}
    found = list(modules[reader].read(bag, topics))
    assert [(topic, stamp) for topic, stamp, _ in found] == [
        (topic, (number + 1) * 10**9) for number, (topic, _, _) in enumerate(MESSAGES)
    ]
    status, setpoint, text, event = (message for _, _, message in found)
    assert (status.unit, status.setpoint, setpoint.data) == ('Hz', 12.5, 12.5)
    assert text.text == 'Überlast' and text.kind == text.FAULT
    assert event.request[0].data
    # and nothing that was not asked for
    assert [topic for topic, _, _ in modules[reader].read(bag, {'/nfo_sinus/inv_st'})] == [
        '/nfo_sinus/inv_st'
    ]


def test_both_say_the_same_of_it(modules: dict[str, ModuleType], tmp_path: Path) -> None:
    found = []
    for name, module in modules.items():
        described = bags.metadata(written(module, tmp_path / name))
        assert dict(described['custom_data']) == {'drive': 'simulated'}
        found.append(
            {
                (topic['topic_metadata']['name'], topic['topic_metadata']['type'],
                 topic['topic_metadata']['type_description_hash'],
                 topic['topic_metadata']['offered_qos_profiles'][0]['durability'],
                 topic['topic_metadata']['offered_qos_profiles'][0]['reliability'],
                 topic['message_count'])
                for topic in described['topics_with_message_count']
            }
        )
    assert all(messages == found[0] for messages in found) and len(found[0]) == len(MESSAGES)


def test_what_cannot_be_written_is_an_error_of_the_system(
    modules: dict[str, ModuleType]
) -> None:
    for module in modules.values():
        with pytest.raises(OSError, match='/proc/none'):
            module.Writer(Path('/proc/none/bag'), {})


def test_a_bag_that_was_cut_off_anywhere_has_what_came_before(
    modules: dict[str, ModuleType], tmp_path: Path
) -> None:
    bag = modules['by_rosbags'].Writer(tmp_path / 'bag', {})
    for topic, message, offered in MESSAGES:
        bag.add_topic(topic, type(message), offered)
    (file,) = (tmp_path / 'bag').glob('*.mcap')
    sizes = []
    for number, (topic, message, _) in enumerate(MESSAGES):
        bag.write(topic, (number + 1) * 10**9, serialize_message(message))
        bag.flush()
        # and nothing more where nothing came
        sizes.append(file.stat().st_size)
        bag.flush()
        assert file.stat().st_size == sizes[-1]
        assert [topic for topic, _, _ in bags.read(tmp_path / 'bag', lambda _: True)] == [
            topic for topic, _, _ in MESSAGES[: number + 1]
        ]
    assert drives_in(tmp_path / 'bag') == ['/nfo_sinus']
    data = file.read_bytes()
    cut = tmp_path / 'cut'
    cut.mkdir()
    for length in range(0, len(data) + 1, 97):
        (cut / 'cut_0.mcap').write_bytes(data[:length])
        found = list(bags.read(cut, lambda _: True))
        assert len(found) >= sum(size <= length for size in sizes)
        assert [(topic, stamp) for topic, stamp, _ in found] == [
            (topic, (number + 1) * 10**9)
            for number, (topic, _, _) in enumerate(MESSAGES[: len(found)])
        ]
    bag.close()
    # whole files beside no metadata.yaml are read, too
    (cut / 'cut_0.mcap').write_bytes(file.read_bytes())
    assert len(list(bags.read(cut, lambda _: True))) == len(MESSAGES)
    assert bags.metadata(cut)['message_count'] == len(MESSAGES)


def test_of_a_compressed_bag_that_was_cut_off_the_commands_are_named_that_mend_it(
    tmp_path: Path,
) -> None:
    chunk = struct.pack('<QQQI', 0, 0, 100, 0) + struct.pack('<I', 4) + b'zstd' + bytes(20)
    (tmp_path / 'x_0.mcap').write_bytes(
        b'\x89MCAP0\r\n' + struct.pack('<BQ', 6, 1000) + chunk
    )
    with pytest.raises(ValueError, match=r'mcap recover .*x_0\.mcap .* ros2 bag reindex'):
        bags.topics(tmp_path)
    (tmp_path / 'x_0.mcap').write_bytes(b'SQLite format 3')
    with pytest.raises(ValueError, match=r'x_0\.mcap is damaged'):
        bags.topics(tmp_path)


@pytest.mark.parametrize('text', ['', 'a: 1', '[]'])
def test_what_is_no_bag_is_said_to_be_none(tmp_path: Path, text: str) -> None:
    (tmp_path / 'metadata.yaml').write_text(text)
    with pytest.raises(ValueError, match='it is no bag'):
        bags.topics(tmp_path)


def test_a_spoilt_bag_is_a_sentence(modules: dict[str, ModuleType], tmp_path: Path) -> None:
    name, module = next(iter(modules.items()))
    bag = written(module, tmp_path / name)
    (file,) = bag.glob('*.mcap')
    described, data = (bag / 'metadata.yaml').read_text(), file.read_bytes()
    spoilt = [
        '[' * 65536, 'a: !!timestamp x', 'a: "\\UFFFFFFFF"',
        described.replace('topics_with_message_count', 'topics'),
        described.replace('topic_metadata', 'other'),
        described.replace('message_count: 1', 'message_count: []'),
        described.replace('custom_data', 'custom_data: 1\n  other'),
        described.replace('  message_count', '  messages'),
        described.replace('version', 'versions'),
    ]
    for text in spoilt:
        (bag / 'metadata.yaml').write_text(text)
        with pytest.raises((OSError, ValueError)):
            read(bag, drives_in(bag))
    (bag / 'metadata.yaml').write_text(described)
    for number in range(0, len(data), max(1, len(data) // 20)):
        file.write_bytes(data[:number] + bytes([data[number] ^ 0xFF]) + data[number + 1:])
        with contextlib.suppress(OSError, ValueError):
            read(bag, drives_in(bag))
        file.write_bytes(data[:number])
        with contextlib.suppress(OSError, ValueError):
            read(bag, drives_in(bag))


def test_rosbag2_py_is_preferred() -> None:
    pytest.importorskip('rosbags', reason='the stand-in needs rosbags')
    program = (
        'from nfo_sinus_driver.node.bags import bags\n'
        'assert not bags.why_none()\n'
        'print(bags._module().__name__)'
    )
    path = f'import sys; sys.path.append({str(STAND_INS)!r})\n'
    for beginning, name in ((path, 'by_rosbag2'), ('', 'by_rosbags')):
        done = subprocess.run(
            [sys.executable, '-c', beginning + program],
            check=True, capture_output=True, text=True,
        )
        if beginning or importlib.util.find_spec('rosbag2_py') is None:
            assert done.stdout.strip().endswith(name)
