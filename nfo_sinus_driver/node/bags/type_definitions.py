# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The definitions of types, as a bag carries them, from the files that their packages install."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
import re

from ament_index_python.packages import get_package_share_directory

_RULE = '=' * 80 + '\n'
#: The type of a field that is a message of some package, at the beginning of a line.
_NESTED = re.compile(r'^\s*([A-Za-z]\w*(?:/\w+)+|[A-Z]\w*)(?:\[[^\]]*\])?\s+\w', re.MULTILINE)
_INCLUDE = re.compile(r'^#include "(.*)\.idl"\n', re.MULTILINE)

#: What ROS makes of a service for its introspection; no package installs it as a file.
_EVENT_TYPE = """\
module {package} {{
  module srv {{
    struct {service}_Event {{
      service_msgs::msg::ServiceEventInfo info;
      sequence<{package}::srv::{service}_Request, 1> request;
      sequence<{package}::srv::{service}_Response, 1> response;
    }};
  }};
}};
"""


def name_of(type_: type) -> str:
    """Return the name of a message class, such as ``std_msgs/msg/Float32``."""
    return '/'.join([*type_.__module__.split('.')[:2], type_.__name__])


def definition_of(name: str) -> str:
    """Return the whole definition of a type, in the two ways that rosbag2 lays down."""
    if '/srv/' in name:
        return _event_definition(name)
    return _message_definition(name, {name})


def hash_of(name: str) -> str:
    """Return the hash of a type, ``RIHS01_…``."""
    described = json.loads(_file(name.removesuffix('_Event'), '.json').read_text())
    hashes = {entry['type_name']: entry['hash_string'] for entry in described['type_hashes']}
    return str(hashes[name])


def _message_definition(name: str, seen: set[str]) -> str:
    text = _file(name, '.msg').read_text()
    package = name.split('/')[0]
    parts = [text]
    for found in _NESTED.findall(text):
        nested = found if '/' in found else f'{package}/{found}'
        if nested.count('/') == 1:
            nested = nested.replace('/', '/msg/')
        if nested not in seen:
            seen.add(nested)
            parts.append(f'{_RULE}MSG: {nested}\n{_message_definition(nested, seen)}')
    return '\n'.join(parts)


def _event_definition(name: str) -> str:
    package, _, event = name.split('/')
    service = event.removesuffix('_Event')
    parts = {name: _EVENT_TYPE.format(package=package, service=service)}
    waiting = [f'{package}/srv/{service}', 'service_msgs/msg/ServiceEventInfo']
    while waiting:
        used = waiting.pop(0)
        text = _file(used, '.idl').read_text()
        # all that is included is here, and not every reader skips the line
        parts[used] = _INCLUDE.sub('', text)
        waiting += [included for included in _INCLUDE.findall(text) if included not in parts]
    return ''.join(f'{_RULE}IDL: {used}\n{text}\n' for used, text in parts.items())


def _file(name: str, suffix: str) -> Path:
    package, kind, type_ = name.split('/')
    return Path(get_package_share_directory(package)) / kind / f'{type_}{suffix}'


def class_of(name: str) -> type:
    """Return the class of a type, such as ``std_srvs/srv/SetBool_Event``."""
    package, kind, type_ = name.split('/')
    try:
        return getattr(importlib.import_module(f'{package}.{kind}'), type_)
    except (AttributeError, ImportError) as error:
        raise ValueError(f'its type {name} is not installed: {error}') from error
