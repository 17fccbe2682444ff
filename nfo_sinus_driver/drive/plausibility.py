# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Which values a drive cannot have, so that one that was spoiled on its way counts for nothing."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping

from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Parameter
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog import Value

_CODES: Mapping[Role | None, Callable[[Family, int], bool]] = {
    Role.STATUS_CODE: lambda model, code: code in model.status_codes,
    Role.CONTROL_SOURCE: lambda model, code: code in model.profile.holders,
    Role.STATUS_WORD: lambda model, word: _may_say(model, word),
}


def can_be(model: Family, key: str, value: Value) -> bool:
    """Tell whether a value of a drive is one that its manual knows, as far as the manual says."""
    parameter, role = model[key], model.role_of.get(key)
    if role in _CODES:
        return _CODES[role](model, int(value))
    if isinstance(value, str):
        return not parameter.labels or value in parameter.labels.values()
    most = abs(value) if role is None else model.profile.most.get(role, abs(value))
    return abs(value) <= most and _in_range(parameter, value)


def _may_say(model: Family, word: int) -> bool:
    status_word = model.profile.status_word
    told = status_word.code is None or status_word.code(word) in model.status_codes
    return told and status_word.may_say(word)


def _in_range(parameter: Parameter, value: float) -> bool:
    low, high = parameter.minimum, parameter.maximum
    return (low is None or value >= float(low)) and (high is None or value <= float(high))
