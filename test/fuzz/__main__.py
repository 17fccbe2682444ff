# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``make fuzz``: many frames through every decoder, on all processors."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
import os
import secrets
import sys
import time

from fuzz import campaign
from fuzz.campaign import CASE, Finding, Part

#: Cases of one part; and how often progress is shown, in parts.
_PART = 500
_SHOWN = 20
#: After so many findings there is something to mend first.
_ENOUGH = 20


def main() -> int:
    """Run the campaign; return 1 if it found something."""
    parser = argparse.ArgumentParser(prog='fuzz', description=__doc__)
    parser.add_argument('--frames', type=int, default=1_000_000, help='how many (1000000)')
    parser.add_argument('--seed', type=int, help='of all random numbers (default: a new one)')
    parser.add_argument('-j', '--jobs', type=int, default=os.cpu_count(), help='processes')
    parser.add_argument('--only', type=int, metavar='FRAME', help='only the case of this frame')
    options = parser.parse_args()
    seed = secrets.randbits(32) if options.seed is None else options.seed
    print(f'seed {seed}', flush=True)
    if options.only is not None:
        case = options.only // CASE
        return _report(seed, campaign.run(Part(seed, case, case + 1)))
    began = time.monotonic()
    findings: list[Finding] = []
    done = 0
    with ProcessPoolExecutor(options.jobs) as pool:
        for number, (part, found) in enumerate(_parts(pool, seed, -(-options.frames // CASE)), 1):
            done += (part.end - part.first) * CASE
            findings += found
            if number % _SHOWN == 0:
                _show(done, began, findings)
            if len(findings) >= _ENOUGH:
                pool.shutdown(cancel_futures=True)
                break
    _show(done, began, findings)
    per_decoder = done // len(campaign.CASES)
    print(f'about {per_decoder} through each of: {", ".join(campaign.CASES)}')
    return _report(seed, findings)


def _parts(
    pool: ProcessPoolExecutor, seed: int, cases: int
) -> Iterator[tuple[Part, list[Finding]]]:
    parts = [Part(seed, first, min(first + _PART, cases)) for first in range(0, cases, _PART)]
    yield from zip(parts, pool.map(campaign.run, parts), strict=True)


def _show(done: int, began: float, findings: list[Finding]) -> None:
    rate = done / (time.monotonic() - began)
    print(f'{done} frames, {rate:.0f} a second, {len(findings)} findings', flush=True)


def _report(seed: int, findings: list[Finding]) -> int:
    for finding in findings:
        print(f'\n{finding.decoder}: --seed {seed} --only {finding.frame}\n{finding.what}')
    by_decoder = Counter(finding.decoder for finding in findings)
    print('found nothing' if not findings else f'found: {dict(by_decoder)}')
    return 1 if findings else 0


if __name__ == '__main__':
    sys.exit(main())
