# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Code, messages and pages are in plain English: these words have a better one."""

from __future__ import annotations

import itertools
from pathlib import Path
import re

from support.places import ROOT

#: What is not written, and what is written in its place.
BETTER = {
    r'[Ss]ee to it': 'ensure that, or: raise … unless',
    r'[Tt](ake|akes|aking|aken|ook) notes?\b': 'record',
    r'\b(?<!of the )[Dd]rive says': 'reports, identifies itself as; or: its status is',
    r'\b[Nn]othing looks|[Ll]ooks? at nothing': 'unconditionally',
    r'\b[Ii]t believes': 'accepts',
    r'\b([Nn]o|[Ss]ome|[Aa]ny|[Ee]very)body\b|\b[Ww]hoever\b': 'no client, another client, all',
    r'\bwho asks\b|\bwhom was here': 'the caller, an earlier session',
    r'\b[Ll]ets no one\b': 'cannot be',
    r'\b[Ll]est\b|\bon whose command\b': 'so that it does not',
    r'\b(leave|leaves|left|leaving)( \w+){0,4} away\b': 'omit',
    r'\b([Tt]ake|takes|taken|taking|took)( [\w-]+){0,3} back\b': 'remove, restore',
    r'\bstart(s|ed)? anew|\bopen(s|ed)? anew': 'restart, open again',
    r'\b(does|do) alike\b': 'share',
    r'\b[Tt]rying again for ever|\btried on and on': 'retrying, retried until confirmed',
    r'\blast look at': 'last status',
    r'\bdid not do \(|\bdoes not do \(': 'had no effect',
    r'\bwas given: not': 'the parameter file has',
    r'\bwhich cannot be: ': 'implausible',
}
NAMES = '|'.join(f'(?:{pattern})' for pattern in BETTER)
FOLDERS = ('nfo_sinus_driver', 'docs', 'config', 'examples', 'launch', 'msg_defs', 'benchmark')
TEXTS = {'.py', '.md', '.in', '.csv', '.json', '.yaml', '.st', '.xml', '.cpp', '.msg', '.srv'}


def files() -> list[Path]:
    below = itertools.chain.from_iterable(
        (ROOT / folder).rglob('*') for folder in (*FOLDERS, 'test', 'tools')
    )
    return [
        path for path in (*ROOT.glob('*.md'), *below)
        if path.suffix in TEXTS and path != Path(__file__)
    ]


def worded_badly(text: str) -> list[str]:
    """What a text has of these words, also over the end of a line."""
    joined = re.sub(r"""(?:\bf)?[\s'"#*|]+""", ' ', text)
    return [found[0] for found in re.finditer(NAMES, joined)]


def test_words_that_have_a_better_one() -> None:
    assert len(files()) > 400
    found = {path.relative_to(ROOT): worded_badly(path.read_text('utf-8')) for path in files()}
    assert {path: words for path, words in found.items() if words} == {}


def test_such_a_word_is_found() -> None:
    assert worded_badly("'nobody '\n    'answers; the run command is taken\n# back'") == [
        'nobody', 'taken back',
    ]
    assert worded_badly('Take the run command back. TO_NOBODY, Holder.NOBODY') == [
        'Take the run command back',
    ]
