# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Who else has a port open."""

from __future__ import annotations

import os
from pathlib import Path


def holders(path: str) -> list[str]:
    """
    Return the other processes that have a device open, as ``name (pid 123)``.

    Those of other users can only be seen by root; what cannot be seen is left out.
    """
    try:
        device = os.stat(path).st_rdev
    except OSError:
        return []
    found = []
    for process in Path('/proc').iterdir():
        other = process.name.isdigit() and int(process.name) != os.getpid()
        if other and _has_open(process, device):
            found.append(f'{_name(process)} (pid {process.name})')
    return sorted(found)


def _has_open(process: Path, device: int) -> bool:
    try:
        descriptors = list((process / 'fd').iterdir())
    except OSError:
        # ended meanwhile, or not ours to look into
        return False
    return any(_device(descriptor) == device for descriptor in descriptors)


def _device(descriptor: Path) -> int | None:
    try:
        return descriptor.stat().st_rdev or None
    except OSError:
        return None


def _name(process: Path) -> str:
    """Return the command without its folder; of a script, the script and not its interpreter."""
    try:
        words = (process / 'cmdline').read_bytes().split(b'\0')
    except OSError:
        return 'a process'
    names = [os.path.basename(word.decode(errors='replace')) for word in words if word]
    if len(names) > 1 and names[0].startswith('python') and not names[1].startswith('-'):
        return names[1]
    return names[0] if names else 'a process'
