# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A bag whose recorder was killed: MCAP files without an end, beside no metadata.yaml.

What is whole of them is read from the front, as the format intends for such files. The libraries
for bags need the index at the end, which is missing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
import struct
from typing import Any

_MAGIC = b'\x89MCAP0\r\n'
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x03, 0x04, 0x05, 0x06


def files(folder: Path) -> list[Path]:
    """Return the files of a bag that was cut off, the oldest first; none where it was not."""
    if (folder / 'metadata.yaml').exists():
        return []
    # NAME_2.mcap is older than NAME_10.mcap
    return sorted(folder.glob('*.mcap'), key=lambda path: (len(path.name), path.name))


def metadata(folder: Path) -> dict[str, Any]:
    """Return what metadata.yaml would say of topics and messages."""
    counts = Counter((topic, type_) for topic, type_, _, _ in messages(folder))
    return {
        'message_count': counts.total(),
        'topics_with_message_count': [
            {'topic_metadata': {'name': topic, 'type': type_}, 'message_count': count}
            for (topic, type_), count in counts.items()
        ],
    }


def messages(folder: Path) -> Iterator[tuple[str, str, int, bytes]]:
    """
    Yield topic, type, time of receipt (ns) and serialized message of all that is whole.

    :raises ValueError: a file is none of this format, or is compressed.
    """
    for path in files(folder):
        data = path.read_bytes()
        if data and not data.startswith(_MAGIC):
            raise ValueError(f'{path.name} is damaged: it does not begin as an MCAP file')
        types: dict[int, str] = {}
        channels: dict[int, tuple[str, str]] = {}
        for code, record in _records(data[len(_MAGIC):], path):
            if code == _SCHEMA:
                types[_uint16(record, 0)] = _text(record, 2)[0]
            elif code == _CHANNEL:
                channels[_uint16(record, 0)] = (_text(record, 4)[0], types[_uint16(record, 2)])
            elif code == _MESSAGE:
                (stamp,) = struct.unpack_from('<Q', record, 6)
                yield *channels[_uint16(record, 0)], stamp, bytes(record[22:])


def _records(data: bytes | memoryview, path: Path) -> Iterator[tuple[int, memoryview]]:
    """Yield kind and content of each record that is whole, those in chunks, too."""
    view, place = memoryview(data), 0
    while place + 9 <= len(view):
        code, size = struct.unpack_from('<BQ', view, place)
        record = view[place + 9 : place + 9 + size]
        place += 9 + size
        if code == _CHUNK and len(record) > 32:
            compression, end = _text(record, 28)
            if compression:
                raise ValueError(
                    f'it was cut off, and is compressed: mcap recover {path} -o NEW/0.mcap, then '
                    'ros2 bag reindex NEW -s mcap'
                )
            # of the last one as much as there is
            yield from _records(record[end + 8 :], path)
        elif len(record) == size:
            yield code, record


def _uint16(record: memoryview, place: int) -> int:
    number: int = struct.unpack_from('<H', record, place)[0]
    return number


def _text(record: memoryview, place: int) -> tuple[str, int]:
    """Return a text, and where it ends."""
    (size,) = struct.unpack_from('<I', record, place)
    end = place + 4 + size
    return str(bytes(record[place + 4 : end]), 'utf-8'), end
