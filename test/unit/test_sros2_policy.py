# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``config/sros2_policy.xml``: of the form that SROS 2 takes; its names are tested with ROS."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import re
from xml.etree import ElementTree

import pytest
from support.sros2_policy import RULES

POLICY = Path(__file__).resolve().parents[2] / 'config' / 'sros2_policy.xml'


def wrong_in_policy(root: ElementTree.Element) -> Iterator[str]:
    """What schema 0.2.0 of SROS 2 forbids."""
    if root.tag != 'policy' or root.attrib != {'version': '0.2.0'}:
        yield f'{root.tag} {root.attrib}'
    if [child.tag for child in root] != ['enclaves']:
        yield 'a policy has enclaves'
        return
    for enclave in root[0]:
        # sros2 takes a comment for an enclave without a name
        if enclave.tag != 'enclave':
            yield f'{enclave.tag} among the enclaves'
            continue
        if set(enclave.attrib) != {'path'} or [child.tag for child in enclave] != ['profiles']:
            yield f'enclave {enclave.attrib}'
        for profile in (one for profiles in enclave for one in profiles):
            if profile.tag != 'profile' or set(profile.attrib) != {'ns', 'node'}:
                yield f'{profile.tag} {profile.attrib}'
            yield from wrong_in_profile(profile)


def wrong_in_profile(profile: ElementTree.Element) -> Iterator[str]:
    for rule in profile:
        if rule.tag is ElementTree.Comment:
            continue
        child, qualifiers = RULES.get(str(rule.tag), ('', set()))
        known = child and rule.attrib and set(rule.attrib) <= qualifiers
        if not known or not set(rule.attrib.values()) <= {'ALLOW', 'DENY'}:
            yield f'{rule.tag} {rule.attrib}'
        if {one.tag for one in rule} != {child}:
            yield f'{rule.tag} of {[one.tag for one in rule]}'
        names = [one.text for one in rule]
        yield from (f'{name} stands twice' for name in names if names.count(name) > 1)
        yield from (f'no name: {name}' for name in names if not re.fullmatch(r'~?(/\w+)+', name))


def policy(text: str) -> ElementTree.Element:
    """The policy with its comments."""
    builder = ElementTree.TreeBuilder(insert_comments=True)
    return ElementTree.fromstring(text, ElementTree.XMLParser(target=builder))


def test_policy_is_one_for_sros2_and_a_wrong_one_is_noticed() -> None:
    text = POLICY.read_text()
    assert list(wrong_in_policy(policy(text))) == []
    for right, wrong in (
        ('version="0.2.0"', 'version="0.1.0"'),
        ('<enclave path="/">', '<!-- who looks --><enclave path="/">'),
        ('<enclave path="/">', '<enclave name="/">'),
        (' node="commander"', ''),
        ('actions call=', 'actions request='),
        ('publish="ALLOW"', 'publish="YES"'),
        ('<action>~/tune</action>', ''),
        ('<topic>~/status</topic>', '<topic>~status</topic>'),
        ('<topic>~/status</topic>', '<service>~/status</service>'),
        ('<topic>~/status</topic>', '<topic>~/inv_st</topic>'),
    ):
        assert right in text
        assert list(wrong_in_policy(policy(text.replace(right, wrong, 1)))) != [], wrong


def test_policy_is_valid_for_the_tools_of_sros2() -> None:
    sros2 = pytest.importorskip('sros2.policy', reason='sros2 is not installed')
    try:
        sros2.load_policy(POLICY)
    except RuntimeError:
        raise
    except Exception as error:
        # its schema refers to another one on the network
        pytest.skip(f'sros2 cannot read its own schema here: {error}')
