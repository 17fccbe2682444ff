# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Make rows of test/unit/link/captures.csv of a trace: ``python tools/captures.py TRACE MAKER MODEL``.

Each exchange once, in the order in which it came, with what has to be filled in left empty. The
trace is one of the driver, of ``nfo-sinus`` or of the simulator; requests of other masters in it,
and answers that belong to none, are left out.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import csv
import json
from pathlib import Path
import sys

_TABLE = Path(__file__).resolve().parents[1] / 'test' / 'unit' / 'link' / 'captures.csv'


def exchanges(lines: Iterator[str]) -> Iterator[tuple[str, str]]:
    """Yield request and answer of each exchange, as hex; ``''``: there was no answer."""
    request = ''
    for line in lines:
        frame = json.loads(line)
        if frame['note']:
            request = ''
        elif frame['direction'] == 'request':
            if request:
                yield request, ''
            request = frame['hex']
        elif request:
            yield request, frame['hex']
            request = ''


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('trace', type=Path)
    parser.add_argument('maker')
    parser.add_argument('model')
    parser.add_argument('--protocol', default='modbus_rtu')
    options = parser.parse_args()
    with _TABLE.open(newline='', encoding='utf-8') as table:
        known = list(csv.DictReader(table))
    number = max(int(row['id']) for row in known)
    writer = csv.DictWriter(sys.stdout, list(known[0]), lineterminator='\n')
    with options.trace.open(encoding='ascii') as lines:
        for request, answer in dict.fromkeys(exchanges(lines)):
            number += 1
            writer.writerow({
                'id': number,
                'maker': options.maker,
                'model': options.model,
                'protocol': options.protocol,
                'request': _shown(request, options.protocol),
                'response': _shown(answer, options.protocol),
                'kind': 'capture',
            })


def _shown(frame: str, protocol: str) -> str:
    data = bytes.fromhex(frame)
    return data.decode('ascii').strip() if protocol == 'modbus_ascii' else data.hex(' ').upper()


if __name__ == '__main__':
    main()
