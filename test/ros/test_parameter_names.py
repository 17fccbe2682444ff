# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The names of ROS parameters, those of the nodes and of all families together."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from nfo_sinus_driver.catalog import families, load_family
from nfo_sinus_driver.node.parameters.parameter_names import did_you_mean
from nfo_sinus_driver.node.parameters.settings import BUS_SETTINGS, DRIVE_SETTINGS
from nfo_sinus_driver.setting import Setting

#: What rclpy declares for each node.
_OF_ROS = ('use_sim_time', 'start_type_description_service')


@pytest.mark.parametrize('family', sorted(families()))
@pytest.mark.parametrize('settings', [BUS_SETTINGS, DRIVE_SETTINGS], ids=['bus', 'drive'])
def test_no_parameter_name_is_the_prefix_of_another(
    family: str, settings: Mapping[str, Setting]
) -> None:
    # `ros2 param dump` makes a tree of them, in which a name is a value or a branch
    names = {*_OF_ROS, *settings, *load_family(family)}
    assert not [(name, other) for name in names for other in names if other.startswith(f'{name}.')]


def test_an_old_name_is_answered_with_what_it_is_called_now() -> None:
    names = list(load_family('movitrac31'))
    renamed = [name for name in names if name.startswith('reference_values.')]
    assert len(renamed) == 20
    for name in renamed:
        answer = did_you_mean(name.replace('reference_values.', 'reference.'), names)
        assert answer.startswith(f'; did you mean {name}')
