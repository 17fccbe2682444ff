# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""
Make the CMake files of the ROS wheels name this machine's Python.

They carry the include and package folders of the Python that the wheels were built with, and
colcon would look for headers there.
"""

from pathlib import Path
import re
import sys
import sysconfig

FOREIGN = r'/opt/python/cp\d+-cp\d+'
OURS = {
    rf'{FOREIGN}/include/python3\.\d+': sysconfig.get_path('include'),
    rf'{FOREIGN}/lib/python3\.\d+/site-packages': sysconfig.get_path('purelib'),
}

for path in Path(sys.prefix, 'share').glob('**/cmake/*.cmake'):
    text = path.read_text()
    mended = text
    for foreign, ours in OURS.items():
        mended = re.sub(foreign, lambda _, ours=ours: ours, mended)
    if mended != text:
        path.write_text(mended)
