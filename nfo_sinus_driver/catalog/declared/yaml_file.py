# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Reads a YAML file into nodes that know their line, and collects what is wrong in it.

Numbers are exact (:class:`~fractions.Fraction`, or ``int`` in decimal, ``0x`` or ``0b``); only
``true`` and ``false`` are on or off, so that a text such as ``On`` stays one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
import contextlib
from dataclasses import dataclass, field, replace
from fractions import Fraction
import math
from pathlib import Path
import re

import yaml

from nfo_sinus_driver.catalog.table import CatalogError

#: What a scalar may be.
Scalar = bool | int | Fraction | str | None
#: Deeper than this no description is: a file whose anchors lead back to themselves.
_DEEPEST = 20
#: More than this no description has: one whose anchors multiply.
_MOST_NODES = 50_000
# what is longer is no number that a drive has, and may be more than Python converts
_INTEGER = re.compile(r'[+-]?(0|[1-9][0-9]{0,18}|0x[0-9a-fA-F]{1,16}|0b[01]{1,64})')
_ZEROS = re.compile(r'[+-]?0[0-9]+')
_NUMBER = re.compile(r'[+-]?([0-9]{0,18}\.[0-9]{1,99}([eE][+-]?[0-9]{1,2})?|[0-9]{1,18}\.)')
_WORDS = {'true': True, 'false': False, 'null': None, '~': None, '': None}


class DescriptionError(CatalogError):
    """
    A file is no description of a drive.

    :ivar problems: what is wrong, a sentence with file and line each.
    """

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__('\n'.join(problems))
        self.problems = tuple(problems)


@dataclass
class Problems:
    """What is wrong in a file, in the order in which it was found."""

    path: Path
    found: dict[str, None] = field(default_factory=dict)

    def add(self, line: int, text: str) -> None:
        """Record a sentence about a line."""
        self.found[f'{self.path}, line {line}: {text}'] = None

    @contextlib.contextmanager
    def of(self, path: Path | None) -> Iterator[None]:
        """Have what is added meanwhile be about another file, if one is given."""
        before, self.path = self.path, path or self.path
        try:
            yield
        finally:
            self.path = before

    def require_none(self) -> None:
        """Raise :class:`DescriptionError` if there is any."""
        if self.found:
            raise DescriptionError(tuple(self.found))


@dataclass(frozen=True)
class Node:
    """
    A mapping, a list or a scalar, with its place in the file.

    :ivar content: nodes by key, nodes in order, or the scalar.
    :ivar line: the first one is 1.
    :ivar name: the key or the number under which it stands, for messages.
    :ivar path: the file where it stands, if that is another one than that of what is around it.
    :ivar written: a scalar as the file has it.
    """

    content: Mapping[str, Node] | Sequence[Node] | Scalar
    line: int
    name: str = ''
    path: Path | None = None
    written: str = ''

    @property
    def mapping(self) -> Mapping[str, Node]:
        """The nodes of a mapping by key; empty where it is none."""
        return self.content if isinstance(self.content, Mapping) else {}

    @property
    def items(self) -> Sequence[Node]:
        """The nodes of a list; empty where it is none."""
        found = self.content
        return found if isinstance(found, Sequence) and not isinstance(found, str) else ()

    @property
    def scalar(self) -> Scalar:
        """The scalar; ``None`` where it is none."""
        found = self.content
        if isinstance(found, str):
            return found
        return None if isinstance(found, (Mapping, Sequence)) else found

    @property
    def json_type(self) -> str:
        """What it is, as a JSON schema calls it."""
        content = self.content
        if isinstance(content, Mapping):
            return 'object'
        if isinstance(content, bool):
            return 'boolean'
        if isinstance(content, int):
            return 'integer'
        if isinstance(content, Fraction):
            return 'number'
        if content is None:
            return 'null'
        return 'string' if isinstance(content, str) else 'array'

    def __contains__(self, key: str) -> bool:
        return key in self.mapping

    def __getitem__(self, key: str) -> Node:
        return self.mapping[key]

    def get(self, key: str) -> Node:
        """Return what stands under a key; an empty node where nothing does."""
        return self.mapping.get(key) or Node(None, self.line, key)

    def text(self, key: str, default: str = '') -> str:
        """Return a text."""
        found = self.get(key).scalar
        return default if found is None else str(found)

    def integer(self, key: str, default: int = 0) -> int:
        """Return a whole number."""
        found = self.get(key).scalar
        return found if isinstance(found, int) else default

    def number(self, key: str) -> Fraction | None:
        """Return a number; ``None`` where none stands."""
        found = self.get(key).scalar
        if isinstance(found, (int, Fraction)) and not isinstance(found, bool):
            return Fraction(found)
        return None

    def flag(self, key: str, default: bool = False) -> bool:
        """Return true or false."""
        found = self.get(key).scalar
        return found if isinstance(found, bool) else default


def number_of(text: str) -> int:
    """Return the whole number that a key is (ValueError: it is none)."""
    if not _INTEGER.fullmatch(text):
        raise ValueError(f'{text!r} is no whole number')
    return int(text, 0)


def load(path: Path) -> tuple[Node, Problems]:
    """
    Read a file.

    :raises DescriptionError: it cannot be read, or is no YAML.
    """
    problems = Problems(path)
    try:
        text = path.read_text(encoding='utf-8')
        composed = yaml.compose(text, Loader=yaml.SafeLoader)
    except OSError as error:
        raise DescriptionError((f'{path}: {error.strerror or error}',)) from error
    except UnicodeError:
        raise DescriptionError((f'{path}: is no text in UTF-8: save it as such',)) from None
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        line = mark.line + 1 if mark is not None else 1
        said = getattr(error, 'problem', None) or str(error).replace('\n', ' ')
        problems.add(line, f'is no YAML: {said}')
        raise DescriptionError(tuple(problems.found)) from None
    except (ValueError, OverflowError) as error:
        # an escape that is no character, a version of too many digits
        raise DescriptionError((f'{path}: is no YAML: {error}',)) from None
    except RecursionError:
        raise DescriptionError((f'{path}: is nested too deeply',)) from None
    if composed is None:
        raise DescriptionError((f'{path}: is empty: see docs/your_own_drive.md',))
    root = _Converter(problems).node(composed, '', 0)
    problems.require_none()
    return root, problems


class _Converter:
    """Converts PyYAML nodes."""

    def __init__(self, problems: Problems) -> None:
        self._problems = problems
        self._left = _MOST_NODES

    def node(self, node: yaml.Node, name: str, depth: int) -> Node:
        """Return the node; what is wrong with it goes to the problems."""
        line = node.start_mark.line + 1
        self._left -= 1
        if depth > _DEEPEST or self._left < 0:
            self._problems.add(line, 'is nested too deeply, or an anchor (&) leads to itself')
            self._problems.require_none()
        if isinstance(node, yaml.MappingNode):
            return Node(dict(self._pairs(node, depth)), line, name)
        if isinstance(node, yaml.SequenceNode):
            items = [self.node(item, f'{name}', depth + 1) for item in node.value]
            return Node(items, line, name)
        return Node(self._scalar(node, line), line, name, written=str(node.value))

    def _pairs(self, node: yaml.MappingNode, depth: int) -> Iterator[tuple[str, Node]]:
        seen: dict[str, int] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                self._problems.add(line, 'a key is a word or a number, and no list')
                continue
            name = str(key.value)
            if name in seen:
                self._problems.add(
                    line, f'{name!r} stands in line {seen[name]} already: remove one of both'
                )
            seen[name] = line
            made = self.node(value, name, depth + 1)
            yield name, replace(made, line=line if made.json_type != 'object' else made.line)

    def _scalar(self, node: yaml.Node, line: int) -> Scalar:
        text = str(node.value)
        if getattr(node, 'style', None) is not None:
            return text
        return scalar_of(text, line, self._problems)


def scalar_of(text: str, line: int, problems: Problems) -> Scalar:
    """Return what a text without quotes means; a number that is none goes to the problems."""
    if text.lower() in _WORDS and text in (text.lower(), text.capitalize()):
        return _WORDS[text.lower()]
    if _INTEGER.fullmatch(text):
        return int(text, 0)
    if _ZEROS.fullmatch(text):
        problems.add(
            line, f'{text} begins with 0: write it without, or with 0x if it is hexadecimal'
        )
    elif _NUMBER.fullmatch(text):
        return Fraction(text)
    elif text.lower() in ('.nan', '.inf', '-.inf', '+.inf'):
        problems.add(line, f'{text} is no number that a drive has')
    return text


def shown(number: Fraction | float) -> str:
    """Return a number for a message."""
    value = float(number)
    return f'{value:.10g}' if math.isfinite(value) else str(value)
