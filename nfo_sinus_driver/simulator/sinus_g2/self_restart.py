# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A G2 that acknowledges a fault by itself and goes on: RstDly, TrTime and ErrCnt of the group Error.

[M0] and [M2] have one line for each of them: "time from when fault disappears to restart", "time
inverter must run perfectly not to stop" and "tries". What is simulated is how we read them: a fault
whose cause is gone ends after RstDly, so often as ErrCnt says; who then runs for TrTime without a
fault has all tries again. With ErrCnt = 0, the factory setting, it waits to be acknowledged.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.memory import Memory

_RST_DLY, _TR_TIME = 'error.rst_dly', 'error.tr_time'
#: The tries of each fault that has any; a short circuit shows as no fault of its own.
TRIES: Mapping[int, str] = {
    2: 'error.ac_fail_err_cnt',
    3: 'error.temp_hi_err_cnt',
    4: 'error.ptc_temp_err_cnt',
    5: 'error.overload_err_cnt',
    6: 'error.ain_fail_err_cnt',
    7: 'error.dc_low_err_cnt',
    8: 'error.dc_high_err_cnt',
    10: 'error.imagn_low_err_cnt',
    11: 'error.cur_low_err_cnt',
    12: 'error.cur_high_err_cnt',
    13: 'error.run_fail_err_cnt',
}


class SelfRestart:
    """Ends the faults of one drive by itself."""

    def __init__(self, memory: Memory, faults: Faults) -> None:
        self._memory = memory
        self._faults = faults
        self._tries: Counter[int] = Counter()
        self._waited = 0.0
        self._ran = 0.0

    def tripped(self, code: int) -> None:
        """Take note of a fault."""
        self._tries[code] += 1
        self._waited = self._ran = 0.0

    def wait(self, dt: float, *, driven: bool, voltage: bool) -> None:
        """Let ``dt`` seconds pass; while there is voltage, the reaction to a fault goes on."""
        if self.waiting and not voltage:
            self._waited += dt
            if self._waited >= self._memory.number(_RST_DLY):
                self._waited = 0.0
                self._faults.acknowledge()
        elif self._tries and not self._faults and driven:
            self._ran += dt
            if self._ran >= self._memory.number(_TR_TIME):
                self._tries.clear()

    @property
    def waiting(self) -> bool:
        """Whether a fault is active that ends by itself."""
        codes = self._faults.codes
        return bool(codes) and not self._faults.lasting and all(map(self._has_tries, codes))

    def _has_tries(self, code: int) -> bool:
        key = TRIES.get(code, '')
        return key in self._memory.model and self._tries[code] <= self._memory.number(key)
