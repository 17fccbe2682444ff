# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Misspelt names: of parameters, of nodes, and of the files that have them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import itertools
from pathlib import Path

from rclpy.node import Node
import yaml

from nfo_sinus_driver.node.ros.rclpy_internals import overrides_of

_PARAMS_FILE = '--params-file'
_PARAMETERS = 'ros__parameters'


def unknown_parameters(nodes: Iterable[Node]) -> Iterator[str]:
    """Return a warning for each parameter that was given to a node that does not have it."""
    nodes = list(nodes)
    given = {node.get_name(): overrides_of(node).keys() for node in nodes}
    known = {node.get_name(): declared_names(node) for node in nodes}
    # given to all of them, it reaches the right one, too
    reaches = set.intersection(*map(set, given.values())) & set().union(*known.values())
    unknown: dict[str, list[str]] = {}
    for node, names in given.items():
        for name in names - known[node] - reaches:
            unknown.setdefault(name, []).append(node)
    for name, nodes_of in sorted(unknown.items()):
        owners = [node for node, names in known.items() if name in names]
        of_these = {declared for node in nodes_of for declared in known[node]}
        meant = f'; {owners[0]} has it' if owners else did_you_mean(name, of_these)
        yield (
            f'parameter {name} was given to {", ".join(sorted(nodes_of))}, but there is none of '
            f'that name{meant}'
        )


def declared_names(node: Node) -> set[str]:
    """Return the parameters that a node has, or will have once its drive is connected."""
    # those of a drive are declared when it is connected
    later: Iterable[str] = getattr(node, 'later_parameters', ())
    return set(node.get_parameters_by_prefix('')) | set(later)


def require_parameter(node: Node, name: str, hint: str = '') -> None:
    """
    Make sure that a node has a parameter.

    :param hint: added to the message about one that is missing.
    :raises ValueError: it does not; rclpy refuses it too, but suggests no other name.
    """
    if not node.has_parameter(name):
        known = declared_names(node)
        near = '' if name in known else did_you_mean(name, known)
        raise ValueError(f'{name}: there is no such parameter{hint}{near}')


def require_files(arguments: list[str]) -> None:
    """
    Make sure that each parameter file is there.

    :raises ValueError: one is not; what ROS says of it names a line of its own source.
    """
    for path in _files(arguments):
        if not Path(path).exists():
            raise ValueError(f'--params-file {path}: there is no such file')
        if Path(path).is_dir():
            raise ValueError(f'--params-file {path}: it is a folder, name a file in it')


def unknown_nodes(arguments: list[str], names: Iterable[str]) -> Iterator[str]:
    """Return a warning for each section of a parameter file that is of no node here."""
    names = set(names)
    for path in _files(arguments):
        for section in _sections(_load(path)):
            name = section.rsplit('/', 1)[-1]
            if '*' not in name and name not in names:
                yield (
                    f'{path} has parameters for {section}, but the nodes here are '
                    f'{", ".join(sorted(names))}{did_you_mean(name, names)}'
                )


def _files(arguments: list[str]) -> Iterator[str]:
    return (path for flag, path in itertools.pairwise(arguments) if flag == _PARAMS_FILE)


def _load(path: str) -> yaml.Node | None:
    try:
        # bytes: YAML may be UTF-16, and ROS reads that, too; not the values: what is a text to
        # ROS, such as 2000-13-45, may be a date to PyYAML that there is not
        return yaml.compose(Path(path).read_bytes(), Loader=yaml.SafeLoader)
    except Exception:
        # ROS has reported it by now, or reads what PyYAML does not
        return None


def _sections(tree: yaml.Node | None, prefix: str = '') -> Iterator[str]:
    """Return the names of the nodes in a parameter file."""
    for key, value in tree.value if isinstance(tree, yaml.MappingNode) else ():
        name = f'{prefix}/{key.value}'.replace('//', '/') if prefix else str(key.value)
        below = value.value if isinstance(value, yaml.MappingNode) else ()
        if any(entry.value == _PARAMETERS for entry, _ in below):
            yield name
        else:
            yield from _sections(value, name)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the end of a sentence about an unknown name: the closest known ones."""
    # loaded only when needed: it takes 0.1 MB
    import difflib

    close = difflib.get_close_matches(name, list(known), n=2)
    return f'; did you mean {" or ".join(close)}?' if close else ''
