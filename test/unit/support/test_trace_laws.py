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

"""The judge of traces sees each kind of violation, and nothing in a good ride."""

from __future__ import annotations

import pytest
from support.trace_laws import violations

_GAP = 0.00175


def _request(text: str, gap: float = 0.002) -> dict:
    return {'direction': 'request', 'hex': text.replace(' ', '') + '0000', 'gap': gap}


_ANSWER = {'direction': 'answer', 'hex': '0103020025799f', 'gap': 0.003}
_POLL = _request('01 03 0258 0002')
_ZERO = _request('01 06 03FC 0000')
_RUN = _request('01 06 0298 0101')
_STOP = _request('01 06 0298 0000')
_WHO = [_request('01 2B 0E02 00'), _ANSWER, _request('01 11'), _ANSWER]
_GOOD = [_POLL, _ANSWER, *_WHO, _request('01 06 0294 0003'), _ZERO, _RUN, _POLL, _ANSWER, _STOP]


def test_a_good_ride_has_nothing_to_complain_of() -> None:
    assert violations(_GOOD, _GAP) == []


@pytest.mark.parametrize(
    ('bad', 'complaint'),
    [
        ([_POLL, _request('01 03 0400 0001', gap=0.0017)], 't3.5 is not kept'),
        ([_request('01 03 02A4 0001')], 'acknowledges'),
        ([_STOP, _request('01 06 0254 C076')], 'by SCMD and by the control word'),
        ([_request('01 10 0250 0002 04 FFF6 0000'), _STOP], 'by SCMD and by the control word'),
        ([_request('01 03 02A5 0002')], 'not exactly one parameter'),
        ([_request('01 03 0258 0001')], 'not exactly one parameter'),
        ([_request('01 03 0211 0001')], 'not exactly one parameter'),
        ([_request('01 10 027E 0001 02 0001')], 'not exactly one parameter'),
        ([_request('01 06 0294 0002')], 'MODE = 2'),
        ([_RUN], 'without set-point 0'),
        ([_request('02 06 03FC 0000'), _RUN], 'without set-point 0'),
        ([_ZERO, _request('01 06 03FC 0064'), _RUN], 'without set-point 0'),
        ([_ZERO, _RUN, _STOP, _RUN], 'without set-point 0'),
        ([_request('01 2B 0E01 0000')], 'not for parameters'),
        ([_request('01 2B 0E03 00')], 'not for parameters'),
        ([_request('01 2B 0E02 07')], 'not for parameters'),
        ([_request('01 2B 0D02 00')], 'not for parameters'),
        ([_request('01 11 00')], 'not for parameters'),
        ([_request('01 08 0001 0000')], 'not for parameters'),
        ([_request('01 17 0400 0001 0294 0001 02 0003')], 'not for parameters'),
        ([_POLL, _request('01 11', gap=0.0017)], 't3.5 is not kept'),
        ([_ZERO, *_WHO, _RUN, *_WHO, _RUN], 'without set-point 0'),
    ],
)
def test_a_bad_ride_is_found_out(bad: list[dict], complaint: str) -> None:
    found = violations(bad, _GAP)
    assert len(found) == 1
    assert complaint in found[0]
