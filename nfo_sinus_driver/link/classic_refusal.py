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

"""
Why a drive answered a SELECT by NAK [M0 §6.1.5], [M2 §7].

The NAK says nothing. The inverter status says whether a fault is active, for then nothing can be
written; and when it is the serial fault, its flags say more, but reading them clears them.
"""

from __future__ import annotations

from nfo_sinus_driver.link.errors import LinkError
from nfo_sinus_driver.link.errors import Refused

#: The parameters that the protocol itself needs; both firmwares have them.
INV_ST = 0x00E9  #: inverter status, without acknowledging
SIO_ERR = 0x00AC  #: serial fault flags; reading clears them and the serial fault
MODE = 0x0029  #: who controls the drive

#: The inverter status of a serial fault [M0 table 19].
SIO_FAIL = 14
#: The inverter status codes that are faults; the rest are what the drive does.
_FAULTS = range(1, 24)

_VALUE = 10
#: Prefix, unknown, unreadable, not to be written.
_ADDRESS = (5, 7, 8, 9)
#: SioErr, bit by bit [M2 table 4].
FLAGS = {
    0: 'the inverter is blocked by an alarm',
    1: 'wrong parity',
    2: 'wrong check sum',
    3: 'wrong message structure',
    4: 'time-out of the serial communication',
    5: 'wrong parameter prefix',
    6: 'not permitted in the current mode',
    7: 'unknown parameter',
    8: 'the parameter cannot be read',
    9: 'the parameter cannot be written',
    10: 'the value is out of range',
    14: 'receive buffer overrun',
}


def flag_names(word: int) -> list[str]:
    """Return what the serial fault flags say, in words."""
    bits = (bit for bit in range(16) if word >> bit & 1)
    return [FLAGS.get(bit, f'flag {bit}') for bit in bits]


def by_status(inv_st: int) -> Refused:
    """Return what the inverter status says of a NAK, where the flags are not read."""
    if inv_st == SIO_FAIL:
        text = 'a serial fault (Sio Fail) is active: until it is acknowledged nothing can be done'
        return Refused(Refused.DEVICE_FAILURE, f'{text} (NAK)')
    if inv_st in _FAULTS:
        text = f'a fault is active (InvSt {inv_st}): until it is acknowledged nothing can be done'
        return Refused(Refused.DEVICE_FAILURE, f'{text} (NAK)')
    text = 'the drive does not accept this value, or not in its present state'
    return Refused(Refused.ILLEGAL_VALUE, f'{text} (NAK, InvSt {inv_st})')


def by_flags(word: int) -> Refused:
    """Return what the serial fault flags say of the NAK that raised them; they are clear now."""
    code = Refused.DEVICE_FAILURE
    if word >> _VALUE & 1:
        code = Refused.ILLEGAL_VALUE
    elif any(word >> bit & 1 for bit in _ADDRESS):
        code = Refused.ILLEGAL_ADDRESS
    why = ', '.join(flag_names(word)) or 'it does not say why'
    text = f'the drive refused: {why}; its serial fault (Sio Fail) by this is cleared (NAK)'
    return Refused(code, text)


def unknown(error: LinkError) -> Refused:
    """Return what to say of a NAK whose reason could not be found out."""
    return Refused(Refused.DEVICE_FAILURE, f'the drive refused (NAK); why is not known: {error}')
