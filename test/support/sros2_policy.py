# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What ``config/sros2_policy.xml`` allows, read as SROS 2 reads it."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
import re
from xml.etree import ElementTree

#: What schema 0.2.0 lets an element of a profile say, and what its children are.
RULES = {
    'topics': ('topic', {'publish', 'subscribe'}),
    'services': ('service', {'reply', 'request'}),
    'actions': ('action', {'call', 'execute'}),
}

#: Enclave, then qualifier, then the full names that it is allowed for.
Policy = dict[str, dict[str, set[str]]]


def full_name(name: str, namespace: str, node: str) -> str:
    """Return a name as the nodes of ROS have it."""
    if name.startswith('/'):
        return name
    prefix = namespace.rstrip('/') + '/'
    return f'{prefix}{node}{name[1:]}' if name.startswith('~') else prefix + name


def allowed(path: Path) -> Policy:
    """Return what each enclave is allowed; what the schema forbids is an AssertionError."""
    policy: Policy = {}
    builder = ElementTree.TreeBuilder(insert_comments=True)
    root = ElementTree.parse(path, ElementTree.XMLParser(target=builder)).getroot()
    assert (root.tag, root.attrib) == ('policy', {'version': '0.2.0'})
    for enclave in root[0]:
        assert enclave.tag == 'enclave', 'sros2 takes a comment for an enclave without a name'
        rules = policy[enclave.attrib['path']] = defaultdict(set)
        for profile in enclave.iter('profile'):
            for rule in profile:
                if rule.tag is ElementTree.Comment:
                    continue
                child, qualifiers = RULES[str(rule.tag)]
                names = [str(element.text) for element in rule if element.tag == child]
                assert len(set(names)) == len(rule) and set(rule.attrib) <= qualifiers, rule.attrib
                assert all(re.fullmatch(r'~?(/\w+)+', name) for name in names), names
                for qualifier, what in rule.attrib.items():
                    assert what == 'ALLOW', f'{rule.tag} {qualifier}: {what}'
                    rules[qualifier] |= {
                        full_name(name, profile.attrib['ns'], profile.attrib['node'])
                        for name in names
                    }
    return policy
