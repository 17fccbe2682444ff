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

"""Settings of the property tests, and of the garbage collector."""

import gc

from hypothesis import HealthCheck
from hypothesis import settings
from support.examples import FULL

# The machine may be slow, and that is no failure. Always the same examples, whatever the machine
# and its environment (hypothesis has settings of its own where CI is set), so that what passes
# once passes everywhere; others with FULL=1.
settings.register_profile(
    'ours',
    derandomize=not FULL,
    database=None,
    deadline=None,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile('ours')


def pytest_collection() -> None:
    """Look for no garbage while nine thousand tests are made that all stay."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Look for it among what is made from now on."""
    gc.freeze()
    gc.enable()
