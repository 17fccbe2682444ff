# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

import os
from pathlib import Path
import shlex
import sys

from setuptools import find_packages, setup

NAME = 'nfo_sinus_driver'


def share(*folders):
    """Return what the folders hold, at any depth, as data files of the package's share folder."""
    found = {}
    for folder in folders:
        for path in sorted(Path(folder).rglob('*')):
            if path.is_file() and '__pycache__' not in path.parts:
                found.setdefault(f'share/{NAME}/{path.parent}', []).append(str(path))
    return list(found.items())


def require_messages():
    """
    End a colcon build that has left nfo_sinus_msgs out: only at run time would it be missed.

    On main it is a folder inside this package, where colcon does not look without a link. Where it
    has been found it is built first, so that it is installed by now. What else builds this
    package (pip without ROS, the build farm) needs no messages for that.
    """
    builds = {'develop', 'install'} & set(sys.argv) and '--help' not in sys.argv
    if 'COLCON' not in os.environ or not builds:
        return
    marker = 'share/ament_index/resource_index/packages/nfo_sinus_msgs'
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    # for --symlink-install this file is a link
    here = Path(__file__).resolve().parent
    built = any((Path(prefix) / marker).exists() for prefix in prefixes)
    if built or not (here / 'msg_defs').is_dir():
        return
    # in the workspace: a clone may be a link in it; in PWD colcon has a folder below it
    below = Path(os.environ.get('PWD', os.sep)).resolve()
    sources = [folder / 'src' for folder in (below, *below.parents) if (folder / 'src').is_dir()]
    inside = not sources or sources[0].parent in here.parents
    beside = here.parent if inside else sources[0]
    messages = os.path.relpath(here / 'msg_defs', beside.resolve())
    raise SystemExit(
        f'{NAME} needs the package nfo_sinus_msgs, which is neither installed nor in this '
        'workspace. colcon does not look for a package inside another one. Link it, then build '
        f'again:\nln -s {shlex.quote(messages)} {shlex.quote(str(beside / "nfo_sinus_msgs"))}'
    )


require_messages()
setup(
    name=NAME,
    version='0.9.0',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: [
            'catalog/declared/*.json',
            'cli/check/*.csv',
            'families/*/*.csv',
            'families/*/*.vfd.yaml',
            'families/*/*/*.csv',
            'simulator/*.st',
        ]
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        *share('config', 'examples', 'launch'),
    ],
    python_requires='>=3.10',
    install_requires=['setuptools'],
    # What it needs at run time stands in package.xml, under the names that rosdep knows. The extras
    # are for `pip install` without ROS, which nfo-sinus, families and simulator do not need.
    extras_require={
        'cli': ['argcomplete', 'pyserial>=3.5', 'PyYAML', 'tqdm'],
        'simulator': ['pymodbus>=3.6.9,!=3.7.*', 'PyYAML'],
        'test': ['hypothesis', 'pytest'],
    },
    zip_safe=False,
    description='Driver for variable-frequency drives (VFDs): NFO Sinus and others',
    keywords=['ROS', 'VFD', 'variable-frequency drive', 'frequency inverter', 'Modbus', 'CANopen'],
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            f'driver = {NAME}.commands:driver',
            f'families = {NAME}.commands:families',
            f'monitor = {NAME}.commands:monitor',
            f'nfo-sinus = {NAME}.commands:nfo_sinus',
            f'plot = {NAME}.commands:plot',
            f'record = {NAME}.commands:record',
            f'simulator = {NAME}.commands:simulator',
        ],
    },
)
