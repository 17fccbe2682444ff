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

"""What a simulated drive says about itself [M0 §6.2.4]."""

from __future__ import annotations

from collections.abc import Mapping

from nfo_sinus_driver.simulator.memory import Memory

#: How a drive treats the functions that older ones do not have (17, 23 and 43) [C57].
KNOWN, REFUSED, SILENT = 'known', 'refused', 'silent'
NEWER_FUNCTIONS = (KNOWN, REFUSED, SILENT)

SERIAL_LENGTH = 16
_REVISION_LENGTH = 17
_MODEL_LENGTH = 8


def device_objects(memory: Memory) -> Mapping[int, bytes]:
    """Return the objects of Read Device Identification, by their numbers."""
    versions = f' {memory.number("fieldbus.sw_ver"):.2f} / {memory.number("fieldbus.nfo_ver"):.0f} '
    texts = (
        'NFO Drives AB',
        '',
        versions.ljust(_REVISION_LENGTH),
        'http://www.nfo.se',
        'NFO Sinus',
        _model(memory.number('motor.p_nom'), memory.number('motor.u_nom')),
        '',
    )
    return {number: text.encode('ascii') for number, text in enumerate(texts)}


def serial_number(text: str | None, address: int) -> str:
    """
    Return the 16 characters of a serial number; by default one for each address.

    :raises ValueError: too long, or not ASCII.
    """
    if text is None:
        text = f'{26_0117_0000_0000 + address:0{SERIAL_LENGTH}d}'
    if len(text) > SERIAL_LENGTH or not (text.isascii() and text.isprintable()):
        raise ValueError(f'serial number {text!r}: at most {SERIAL_LENGTH} characters of ASCII')
    return text.ljust(SERIAL_LENGTH)


def _model(power: float, voltage: float) -> str:
    """Return power and voltage in 8 characters, such as 1.50/400 or 11.0/400."""
    fitting = (f'{power:.{decimals}f}/{voltage:.0f}' for decimals in (2, 1, 0))
    return next(text for text in fitting if len(text) <= _MODEL_LENGTH).ljust(_MODEL_LENGTH)
