# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Settings of the property tests, and of the garbage collector; a state folder of their own."""

import contextlib
import gc
import os
import tempfile

from hypothesis import HealthCheck, settings
import pytest
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
# what programs under test remember of simulated drives is not to be found by real ones
_state = tempfile.TemporaryDirectory(prefix='nfo_state_')
os.environ['XDG_STATE_HOME'] = _state.name
#: After how many new objects garbage is looked for; Python's own number makes tests a tenth slower.
_SELDOM = 50_000
if not FULL:
    # newer versions also try numbers of the modules that are loaded by then, which are others in
    # each worker
    with contextlib.suppress(ImportError):
        from hypothesis.internal.conjecture import providers

        providers._get_local_constants = lambda: providers._local_constants


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the slowest to ``FULL=1``, but for those that are named."""
    if FULL or any('::' in argument for argument in config.args):
        return
    slow = [item for item in items if item.get_closest_marker('slow')]
    config.hook.pytest_deselected(items=slow)
    items[:] = [item for item in items if item not in slow]


def pytest_collection() -> None:
    """Look for no garbage while nine thousand tests are made that all stay."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Look for it among what is made from now on, seldom: each test makes a whole drive."""
    gc.freeze()
    gc.set_threshold(_SELDOM)
    gc.enable()
