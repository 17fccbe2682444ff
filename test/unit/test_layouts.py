# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Layouts and groups in config/: of the form that their readers take; names are tested with ROS."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from support.aggregator import ERROR, OK, WARN, Aggregator
import yaml

CONFIG = Path(__file__).resolve().parents[2] / 'config'
FOXGLOVE = CONFIG / 'foxglove.json'
PLOTJUGGLER = CONFIG / 'plotjuggler.xml'

#: What each panel of the Foxglove layout has to say, by its type.
PANELS = {
    'Plot': {'paths'},
    'StateTransitions': {'paths'},
    'Indicator': {'path', 'rules', 'fallbackColor', 'fallbackLabel', 'style'},
    'CallService': {'serviceName', 'requestPayload', 'editingMode', 'timeoutSeconds'},
    'DiagnosticSummary': {'topicToRender'},
}


def leaves(layout: object) -> Iterator[str]:
    """The panels of a layout, by their places."""
    if isinstance(layout, str):
        yield layout
        return
    assert isinstance(layout, dict)
    assert layout['direction'] in ('row', 'column')
    assert 0 < layout['splitPercentage'] < 100
    for half in ('first', 'second'):
        yield from leaves(layout[half])


def test_foxglove_layout_has_a_place_for_each_panel_which_says_what_its_type_needs() -> None:
    layout = json.loads(FOXGLOVE.read_text())
    assert {'configById', 'globalVariables', 'userNodes', 'playbackConfig', 'layout'} == set(layout)
    panels = layout['configById']
    assert sorted(leaves(layout['layout'])) == sorted(panels)
    assert {name.partition('!')[0] for name in panels} == set(PANELS)
    for name, panel in panels.items():
        assert PANELS[name.partition('!')[0]] <= set(panel), name
        if name.startswith('CallService!'):
            # only so its answer is seen, which may be that the stop is not confirmed
            assert panel['editingMode'] is True, name
            json.loads(panel['requestPayload'])


def test_plotjuggler_layout_is_whole() -> None:
    root = ElementTree.parse(PLOTJUGGLER).getroot()
    assert root.tag == 'root'
    (window,) = root.findall('tabbed_widget')
    assert window.attrib == {'name': 'Main Window', 'parent': 'main_window'}
    for splitter in root.iter('DockSplitter'):
        sizes = [float(size) for size in splitter.attrib['sizes'].split(';')]
        assert len(splitter) == len(sizes) == int(splitter.attrib['count'])
        assert sum(sizes) == pytest.approx(1.0)
    for area in root.iter('DockArea'):
        assert [plot.tag for plot in area] == ['plot']
    (streamer,) = root.findall('previouslyLoaded_Streamer')
    plugins = [plugin.attrib['ID'] for plugin in root.iter('plugin')]
    assert streamer.attrib['name'] in plugins
    # what it subscribes to is what it draws
    (selected,) = root.iter('selected_topics')
    drawn = [curve.attrib['name'] for curve in root.iter('curve')]
    assert len(drawn) == len(set(drawn))
    topics = {name.rpartition('/')[0] for name in drawn}
    assert topics == set(selected.attrib['value'].split(';'))


def test_top_level_of_the_diagnostics_is_ok_while_all_is_well() -> None:
    aggregator = Aggregator(CONFIG / 'diagnostic_aggregator.yaml')
    assert not aggregator.refused()
    # the statuses are those of conveyor.yaml, as test/ros/test_config_names.py finds
    well = dict.fromkeys(aggregator.expected(), OK)
    assert len(well) == 4
    assert aggregator.level(well) == OK
    for name in well:
        assert aggregator.level({**well, name: WARN}) == WARN
        assert aggregator.level({other: OK for other in well if other != name}) == ERROR, name


def test_the_lifecycle_manager_waits_longer_than_a_configure_lasts() -> None:
    file = yaml.safe_load((CONFIG / 'nav2' / 'lifecycle_manager.yaml').read_text())
    parameters = file['/**/lifecycle_manager_drives']['ros__parameters']
    # the longest was 28 s, at a slow rate; without it, nav2 gives up after 5 s
    assert parameters['service_timeout'] > 28.0
