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
