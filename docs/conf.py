# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How `make docs` makes a site of README.md and docs/ with Sphinx."""

from pathlib import Path
import re

project = 'nfo_sinus_driver'
copyright = 'the nfo_sinus_driver authors, Apache License 2.0'
extensions = ['myst_parser', 'sphinxcontrib.mermaid']
include_patterns = [
    *('README.md', 'CONTRIBUTING.md', 'CHANGELOG.rst', 'docs/*.md', 'docs/drives/*.md'),
    'benchmark/results.md',
]
exclude_patterns = ['.*', 'build', 'install', 'log', 'site']
root_doc = 'docs/README'
html_theme = 'furo'
html_title = 'nfo_sinus_driver'
# what a web server shows of the folder itself; it leads to the first page
html_extra_path = ['index.html']
# what a link may point to inside a page: every heading that there is
myst_heading_anchors = 6
# as GitHub shows it
myst_fence_as_directive = ['mermaid']

_INDEX = 'docs/README'
_ROOT = Path(__file__).resolve().parents[1]


def _prepare(app, name, source):
    """Give the index a table of contents for each group of it; links to folders become text."""
    folder = (_ROOT / name).parent

    def without_folder(link):
        text, target = link.groups()
        return text if (folder / target).is_dir() else link[0]

    source[0] = re.sub(r'(?<!!)\[([^]]+)\]\(([^)#\s]+)\)', without_folder, source[0])
    if name != _INDEX:
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
