# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What ``config/sros2_policy.xml`` allows, read as SROS 2 reads it."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
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
    """Return what each enclave is allowed."""
    policy: Policy = {}
    for enclave in ElementTree.parse(path).getroot().iter('enclave'):
        rules = policy[enclave.attrib['path']] = defaultdict(set)
        for profile in enclave.iter('profile'):
            for rule in profile:
                for qualifier, what in rule.attrib.items():
                    assert what == 'ALLOW', f'{rule.tag} {qualifier}: {what}'
                    rules[qualifier] |= {
                        full_name(str(one.text), profile.attrib['ns'], profile.attrib['node'])
                        for one in rule
                    }
    return policy
