# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How Sphinx makes a site of README.md and docs/: for `make docs`, and for the build farm by rosdoc2.

rosdoc2 copies docs/ and some of the pages beside it, has an index of its own, and executes this
file in a configuration that has `rosdoc2_settings`.
"""

from pathlib import Path
import re

_BY_ROSDOC2 = 'rosdoc2_settings' in globals()

project = 'nfo_sinus_driver'
copyright = 'the nfo_sinus_driver authors, Apache License 2.0'
# what a link may point to inside a page: every heading that there is
myst_heading_anchors = 6
if not _BY_ROSDOC2:
    extensions = ['myst_parser']
    include_patterns = [
        *('*.md', 'CHANGELOG.rst', 'docs/*.md', 'docs/drives/*.md', 'benchmark/results.md')
    ]
    root_doc = 'docs/README'
    html_theme = 'furo'
    html_title = 'nfo_sinus_driver'
    # what a web server shows of the folder itself; it leads to the first page
    html_extra_path = ['index.html']


def _prepare(app, name, source):
    """Give the index a table of contents for each group of it; links to folders become text."""
    folder = (Path(app.srcdir) / name).parent

    def without_folder(link):
        text, target = link.groups()
        path = folder / target
        # rosdoc2 leaves out some of what is beside docs/; else Sphinx refuses what is not there
        left_out = _BY_ROSDOC2 and '://' not in target and not path.exists()
        return text if path.is_dir() or left_out else link[0]

    source[0] = re.sub(r'(?<!!)\[([^]]+)\]\(([^)#\s]+)\)', without_folder, source[0])
    if name != 'docs/README':
        return
    # the title of each group, and the rows of its table
    for title, rows in re.findall(r'^## (.+)\n\n((?:\|.*\n)+)', source[0], re.MULTILINE):
        pages = re.findall(r'^\| \[[^]]+\]\(([\w./]+)\.md\)', rows, re.MULTILINE)
        pages += ['../CONTRIBUTING', '../CHANGELOG'] if title == 'Internals' else []
        entries = '\n'.join(pages)
        source[0] += f'\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n{entries}\n```\n'


def setup(app):
    """Have Sphinx call it."""
    app.connect('source-read', _prepare)
