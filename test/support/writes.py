# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which frames write, by the protocols and by nothing of the driver."""

from __future__ import annotations

#: Write coils and registers, one or several, and write and read at once.
_MODBUS = (5, 6, 15, 16, 23)
#: The start delimiters of SELECT and LONG_SELECT [M4 §2.1].
_SELECT = (0xA9, 0xAD)
#: The two highest client commands of SDO that write: a segment, and the beginning of a download.
_DOWNLOADS = (0x00, 0x20)
_STX = 0x02


def is_write(protocol: str, frame: bytes) -> bool:
    """
    Return whether a frame writes.

    :param protocol: of the line, as the simulator calls it.
    """
    match protocol:
        case 'canopen':
            # as an adapter takes it: t6, the node, the length, and the bytes in hexadecimal digits
            return frame[:2] == b't6' and int(frame[5:7], 16) & 0xE0 in _DOWNLOADS
        case 'classic':
            return frame[2] == _STX
        case 'movitrac':
            return frame[0] in _SELECT
        case 'modbus_tcp' | 'telegram1':
            return frame[7] in _MODBUS
        case 'modbus_ascii':
            return int(frame[3:5], 16) in _MODBUS
        case _:
            return frame[1] in _MODBUS
