# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Parameter files: what is written is read again, and what is no parameter file is refused."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given, settings, strategies as st
import pytest
import yaml

from nfo_sinus_driver.catalog import Parameter, Value, load_family
from nfo_sinus_driver.cli.console import CliError
from nfo_sinus_driver.cli.parameter_file import HEADER, format_file, parse_file, write_file

G2 = load_family('sinus_g2')


def values_of(parameter: Parameter) -> st.SearchStrategy[Value]:
    """Whatever a drive may have for a parameter, sensible or not."""
    protocol = 'modbus' if 'modbus' in parameter.addresses else 'classic'
    codec = parameter.at(protocol).number
    if parameter.labels and parameter.kind is not str:
        raws = st.sampled_from(sorted(parameter.labels))
    else:
        raws = st.integers(codec.minimum, codec.maximum)
    return raws.map(lambda raw: parameter.decode(codec.encode(raw), protocol))


EVERYTHING = st.fixed_dictionaries(
    {parameter.key: values_of(parameter) for parameter in G2.settings}
)


def test_a_file_is_never_written_through_a_link_that_was_there(tmp_path: Path) -> None:
    other = tmp_path / 'other'
    other.write_text('mine')
    for name in ('drive.yaml', 'drive.yaml.part'):
        (tmp_path / name).symlink_to(other)
    write_file(str(tmp_path / 'drive.yaml'), 'new')
    assert other.read_text() == 'mine'
    assert (tmp_path / 'drive.yaml').read_text() == 'new'
    # and what cannot be written whole leaves nothing
    with pytest.raises(UnicodeEncodeError):
        write_file(str(tmp_path / 'drive.yaml'), '\ud800')
    assert (tmp_path / 'drive.yaml').read_text() == 'new'
    assert {path.name for path in tmp_path.iterdir()} == {'other', 'drive.yaml', 'drive.yaml.part'}


@settings(max_examples=40, deadline=None)
@given(EVERYTHING, st.dictionaries(st.sampled_from(HEADER), st.text()))
def test_what_is_written_is_read_again(values: dict[str, Value], header: dict[str, str]) -> None:
    file = parse_file(format_file(header, values, G2), 'x')
    assert file.values == values
    assert all(type(file.values[key]) is type(value) for key, value in values.items())
    assert file.skipped == ()
    printable = {
        name: ' '.join(''.join(c if c.isprintable() else ' ' for c in text).split())
        for name, text in header.items()
    }
    assert file.header == {name: text for name, text in printable.items() if text}


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_float_is_never_taken_for_anything_else(number: float) -> None:
    text = format_file({}, {'control.accel': number}, G2)
    scalar = text.split('accel: ')[1].split()[0]
    assert float(scalar) == number
    assert '.' in scalar and 'e' not in scalar


@given(st.text(st.characters(exclude_categories=['Cc', 'Cs', 'Cn', 'Zl', 'Zp', 'Cf', 'Co'])))
def test_a_text_is_never_taken_for_anything_else(label: str) -> None:
    assert parse_file(format_file({}, {'pi_reg.unit': label}, G2), 'x').values == {
        'pi_reg.unit': label
    }


def test_it_is_a_ros_parameter_file() -> None:
    values: dict[str, Value] = {
        'motor.p_nom': 1.5,
        'control.mode': 'Speed',
        'control.auto_start': False,
        'pi_reg.unit': '%',
        'pi_reg.t_min': -10,
    }
    text = format_file({'model': 'sinus_g2', 'date': '2026-01-02 03:04:05 +0000'}, values, G2)
    assert text == (
        '# Parameters of a drive; also a ROS parameter file.\n'
        '#\n'
        '# model: sinus_g2\n'
        '# date: 2026-01-02 03:04:05 +0000\n'
        '/**:\n'
        '  ros__parameters:\n'
        '    motor:\n'
        '      p_nom: 1.5  # kW\n'
        '    control:\n'
        "      mode: 'Speed'\n"
        '      auto_start: false\n'
        '    pi_reg:\n'
        "      unit: '%'\n"
        '      t_min: -10  # °C\n'
    )
    assert yaml.safe_load(text)['/**']['ros__parameters']['motor'] == {'p_nom': 1.5}


def test_what_ros2_param_dump_prints() -> None:
    file = parse_file(
        """\
/nfo_sinus:
  ros__parameters:
    address: 1
    control:
      accel: 5.0
      mode: Speed
    frame_id: ''
    qos_overrides:
      /parameter_events:
        publisher:
          depth: 1000
    start_type_description_service: true
    use_sim_time: false
""",
        'dump.yaml',
    )
    assert file.values == {'control.accel': 5.0, 'control.mode': 'Speed'}
    assert file.header == {}
    assert file.skipped == (
        'address',
        'frame_id',
        'qos_overrides./parameter_events.publisher.depth',
        'start_type_description_service',
        'use_sim_time',
    )


@pytest.mark.parametrize(
    'text',
    [
        '/cell:\n  left:\n    ros__parameters:\n      control.accel: 5',
        '/cell/left:\n  ros__parameters: {control: {accel: 5}}',
        'left: {ros__parameters: {control: {accel: 5}}}',
        '/**: {ros__parameters: {port: x}}\nleft: {ros__parameters: {control: {accel: 5}}}',
    ],
)
def test_sections_as_ros_takes_them(text: str) -> None:
    assert parse_file(text, 'x').values == {'control.accel': 5}


@pytest.mark.parametrize(
    ('text', 'says'),
    [
        ('', 'no parameters of a drive'),
        ('control: {accel: 5}', 'no parameters of a drive'),
        ('/**: {ros__parameters: {port: x}}', 'no parameters of a drive'),
        ('/**: {ros__parameters: [1]}', 'no parameters of a drive'),
        ('{', 'no parameter file'),
        ('a: b: c', 'no parameter file'),
        ('\x00', 'no parameter file'),
        ('? [a]\n: 1', 'no parameter file'),
        ('[' * 10_000, 'no parameter file'),
        ('&a {b: *a}', 'no parameter file'),
        ('/**: {ros__parameters: &a {b: *a}}', 'no parameter file'),
        ('!!python/object:os.system {}', 'no parameter file'),
        ('a: !!timestamp x', 'no parameter file'),
        ('a: !!int ""', 'no parameter file'),
        ('a: !!bool x', 'no parameter file'),
        ('a: 2000-13-45', 'no parameter file'),
        ('a: "\\UFFFFFFFF"', 'no parameter file'),
        ('/**: {ros__parameters: {a.b: 1, a.b: 2}}', 'a.b stands twice'),
        ('/**: {ros__parameters: {a.b: 1, a: {b: 2}}}', 'a.b stands twice'),
        ('/**: {ros__parameters: {a.b: [1], a.c: null, a.d: 1}}', 'a.b\n  a.c'),
        (
            'l: {ros__parameters: {a.b: 1}}\nr: {ros__parameters: {a.b: 1}}',
            'several drives (l, r)',
        ),
    ],
)
def test_what_is_no_parameter_file_is_said(text: str, says: str) -> None:
    with pytest.raises(CliError) as error:
        parse_file(text, 'cell.yaml')
    assert says in str(error.value)


def test_the_mark_in_front_that_an_editor_makes_hides_no_header() -> None:
    text = '\ufeff# model: sinus_g2\n# address: 9\n/**: {ros__parameters: {a.b: 1}}\n'
    assert parse_file(text, 'x').header == {'model': 'sinus_g2', 'address': '9'}


@pytest.mark.parametrize('name', ['', '.', '/', '..', 'x' * 300])
def test_a_name_that_no_file_can_have_is_said(name: str) -> None:
    with pytest.raises(CliError, match='cannot be written'):
        write_file(name, 'x')


def test_a_comment_below_the_header_is_none_of_it() -> None:
    text = '# model: sinus_g2\n\n/**: {ros__parameters: {a.b: 1}}\n# model: other\n'
    assert parse_file(text, 'x').header == {'model': 'sinus_g2'}
