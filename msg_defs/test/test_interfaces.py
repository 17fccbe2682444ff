# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the files define is generated, and goes over the wire and back."""

import importlib
from pathlib import Path

import pytest
from rclpy.serialization import deserialize_message, serialize_message

KINDS = ('msg', 'srv', 'action')
FILES = [
    path
    for kind in KINDS
    for path in sorted((Path(__file__).resolve().parents[1] / kind).glob(f'*.{kind}'))
]


def test_there_are_files_of_each_kind():
    assert {path.parent.name for path in FILES} == set(KINDS)


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.stem)
def test_each_file_is_generated(path):
    assert hasattr(importlib.import_module(f'nfo_sinus_msgs.{path.parent.name}'), path.stem)


@pytest.mark.parametrize(
    'name', [path.stem for path in FILES if path.parent.name == 'msg'], ids=str
)
def test_a_message_comes_back_as_it_was_sent(name):
    type_ = getattr(importlib.import_module('nfo_sinus_msgs.msg'), name)
    sent = serialize_message(type_())
    assert serialize_message(deserialize_message(sent, type_)) == sent
