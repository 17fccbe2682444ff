# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Where families are found: those that are shipped, and those of other packages and workspaces.

A package declares its families by a resource of the ament index, of the type
``nfo_sinus_driver.families``: a line for each file, as its path below the package's share folder;
or, for those that need code, by an entry point of that group, a Python package whose folder is a
family.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import functools
import importlib
import importlib.metadata
import importlib.util
import logging
import os
from pathlib import Path
import shlex

from nfo_sinus_driver.catalog.family import DESCRIBED, folders, is_described, load_profile
from nfo_sinus_driver.catalog.table import CatalogError

_log = logging.getLogger(__name__)

#: The type of the resource, and the group of the entry points.
GROUP = 'nfo_sinus_driver.families'
PACKAGE = 'package://'


@dataclass(frozen=True)
class Found:
    """
    A family that was found.

    :ivar name: by which it is chosen.
    :ivar model: what :func:`~nfo_sinus_driver.catalog.load_family` is given.
    :ivar place: where it stands; :ivar of: who declares it.
    """

    name: str
    model: str
    place: str
    of: str

    @property
    def title(self) -> str:
        """What its maker calls it, or what is wrong with it."""
        try:
            return load_profile(_usable(self.model)).title
        except (CatalogError, ImportError, ValueError) as error:
            return f'cannot be used: {error}'.replace('\n', '; ')


def find(text: str) -> str:
    """
    Return the family that a name, a path or a ``package://name/path`` means, as it is loaded.

    :raises ValueError: there is none; the message says where was looked.
    """
    if text.startswith(PACKAGE):
        return _file(_in_package(text), text)
    if is_described(text) or os.sep in text:
        return _file(Path(text).expanduser().absolute(), text)
    found: dict[str, list[Found]] = {}
    for candidate in every():
        found.setdefault(candidate.name, []).append(candidate)
    if text not in found:
        path = Path(text).absolute()
        if path.is_file():
            return _file(path, text)
        raise ValueError(
            f'there is no family {text!r}: choose one of {", ".join(sorted(found))}, the path of a '
            f'file NAME{DESCRIBED}, or package://PACKAGE/PATH'
        )
    taken, *others = found[text]
    for other in others:
        # of one package the file in the first workspace hides the others: that is meant so
        if other.of != taken.of:
            _report_hidden(text, taken.place, other.place)
    return _usable(taken.model)


@functools.cache
def _report_hidden(name: str, taken: str, hidden: str) -> None:
    """Warn, once, of a family that is not found by its name."""
    _log.warning(
        f'two packages have a family {name}: {taken} is taken, not {hidden}; to have that one, '
        'give its path as family'
    )


def every() -> Iterator[Found]:
    """Yield all families that are found by name; of two with one name the first counts."""
    _take_entry_points()
    root = Path(next(iter(importlib.import_module(GROUP).__path__)))
    for name, folder in sorted(folders().items()):
        yield Found(name, name, str(folder), 'shipped' if root in folder.parents else 'entry point')
    for path in sorted((root / '_declared').glob(f'*{DESCRIBED}')):
        yield Found(_name(path), str(path), str(path), 'shipped')
    for package, path in _declared_by_packages():
        yield Found(_name(path), str(path), str(path), f'package {package}')


def _name(path: Path) -> str:
    return path.name.removesuffix(DESCRIBED)


def _usable(model: str) -> str:
    return _file(Path(model), model) if os.sep in model else model


def _file(path: Path, text: str) -> str:
    if not is_described(path.name):
        rename = _rename(path)
        raise ValueError(
            f'{text}: the name of a file that describes a drive ends with {DESCRIBED}{rename}'
        )
    if not path.is_file():
        raise ValueError(f'{text}: there is no such file ({path})')
    return str(path)


def _rename(path: Path) -> str:
    """Return how a file is renamed that is there under another name."""
    if not path.is_file():
        return ''
    name = path.name
    for ending in ('.yml', '.yaml', '.vfd'):
        name = name.removesuffix(ending)
    return f'; rename it: {shlex.join(("mv", str(path), str(path.with_name(name + DESCRIBED))))}'


def _prefixes() -> Iterator[Path]:
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if prefix:
            yield Path(prefix)


def _in_package(text: str) -> Path:
    package, _, rest = text.removeprefix(PACKAGE).partition('/')
    for prefix in _prefixes():
        if (prefix / 'share' / 'ament_index' / 'resource_index' / 'packages' / package).exists():
            return prefix / 'share' / package / rest
    raise ValueError(
        f'{text}: there is no package {package}: build it, and source its workspace '
        f'(AMENT_PREFIX_PATH is {os.environ.get("AMENT_PREFIX_PATH", "") or "empty"})'
    )


def _declared_by_packages() -> Iterator[tuple[str, Path]]:
    for prefix in _prefixes():
        index = prefix / 'share' / 'ament_index' / 'resource_index' / GROUP
        for resource in sorted(index.glob('*')):
            share = prefix / 'share' / resource.name
            try:
                text = resource.read_text(encoding='utf-8', errors='replace')
            except OSError as error:
                _report_unreadable(str(resource), error.strerror or str(error))
                continue
            for line in text.split('\n'):
                if line.strip():
                    yield resource.name, share / line.strip()


@functools.cache
def _report_unreadable(resource: str, why: str) -> None:
    """Warn, once, of a package whose families are not found."""
    _log.warning(f'{resource} cannot be read ({why}): the families of this package are not found')


def _take_entry_points() -> None:
    """Have the families of entry points among those that are loaded by the name of a folder."""
    paths = importlib.import_module(GROUP).__path__
    for point in importlib.metadata.entry_points(group=GROUP):
        try:
            spec = importlib.util.find_spec(point.value)
        except ImportError:
            continue
        for place in (spec.submodule_search_locations or ()) if spec is not None else ():
            root = str(Path(place).parent)
            if root not in paths:
                paths.append(root)
