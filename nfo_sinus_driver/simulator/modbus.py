# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus as a simulated drive speaks it, in whatever frames ([M0 §6.2.3, §6.2.4], [M1])."""

from __future__ import annotations

import abc
from collections.abc import Mapping, Sequence
import functools

from nfo_sinus_driver.catalog import Family, Parameter, to_bytes, to_words
from nfo_sinus_driver.simulator import pymodbus_compat
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.protocol import Station

READ = 3
READ_INPUT = 4
WRITE_SINGLE = 6
DIAGNOSTICS = 8
WRITE_MULTIPLE = 16
REPORT_SLAVE_ID = 17
WRITE_AND_READ = 23
ENCAPSULATED = 43
_DEVICE_IDENTIFICATION = 14
#: Read device ID codes: basic, regular, specific; and which objects belong to each.
_BASIC, _REGULAR, _SPECIFIC = 1, 2, 4
_STREAMS = {_BASIC: range(3), _REGULAR: range(7)}
#: Regular identification, as a stream and object by object.
_CONFORMITY = 0x82
#: The standard's limits of registers in one message.
_MOST_READ = 125
_MOST_WRITTEN = 123
_MOST_WRITTEN_WITH_READ = 121


class Requests(abc.ABC):
    """
    What a unit does with Modbus requests; its registers are elsewhere.

    :ivar functions: those that it has; others are refused.
    :ivar silent: those that get no answer at all.
    """

    functions: frozenset[int]
    silent: frozenset[int] = frozenset()

    def slave_id(self) -> bytes:
        """Return what function 17 reports."""
        return b''

    def device_objects(self) -> Mapping[int, bytes]:
        """Return the objects of Read Device Identification, by their numbers."""
        return {}

    @abc.abstractmethod
    def read(self, register: int, count: int) -> tuple[int, ...]:
        """Return the words from a register on (Refused: as the reason says)."""

    @abc.abstractmethod
    def write(self, register: int, words: Sequence[int]) -> None:
        """Write words from a register on (Refused: as the reason says)."""

    def require(self, register: int, count: int) -> None:
        """Ensure that words can be read, or :class:`Refused`: for function 23, if it has it."""
        raise Refused(Reason.FUNCTION, 'there is no function 23')

    def write_and_read(
        self, register: int, words: Sequence[int], source: int, count: int
    ) -> tuple[int, ...]:
        """Write at ``register``, then read at ``source``; or none of both."""
        self.require(source, count)
        self.write(register, words)
        return self.read(source, count)

    def answer(self, pdu: bytes) -> bytes:
        """Carry out a request PDU and return the answer PDU; empty if it stays silent."""
        function = pdu[0] if pdu else 0
        if function in self.silent:
            return b''
        if function not in self.functions:
            return pymodbus_compat.encode_exception(function, Reason.FUNCTION)
        try:
            return self._carry_out(function, pdu[1:])
        except ValueError:
            return pymodbus_compat.encode_exception(function, Reason.VALUE)
        except Refused as refused:
            return pymodbus_compat.encode_exception(function, refused.reason)

    # ---- requests ----

    def _carry_out(self, function: int, data: bytes) -> bytes:
        if function in (READ, READ_INPUT):
            # the same registers by either [M1]
            return pymodbus_compat.encode_registers(function, self._read_words(data))
        if function == WRITE_SINGLE:
            return self._write_single(data)
        if function == WRITE_MULTIPLE:
            return self._write_multiple(data)
        if function == WRITE_AND_READ:
            return self._write_and_read(data)
        if function == REPORT_SLAVE_ID:
            return self._report_slave_id(data)
        if function == DIAGNOSTICS:
            return self._loop_back(data)
        assert function == ENCAPSULATED
        return self._identify(data)

    def _read_words(self, data: bytes) -> tuple[int, ...]:
        register, count = pymodbus_compat.decode_read(data)
        if not 1 <= count <= _MOST_READ or len(data) != 4:
            raise Refused(Reason.VALUE, f'a request for {count} registers is malformed')
        return self.read(register, count)

    def _write_single(self, data: bytes) -> bytes:
        register, word = pymodbus_compat.decode_write_single(data)
        if len(data) != 4:
            raise Refused(Reason.VALUE, 'a request of a wrong length')
        self.write(register, [word])
        return pymodbus_compat.encode_write_single(register, word)

    def _write_multiple(self, data: bytes) -> bytes:
        register, count, words = pymodbus_compat.decode_write_multiple(data)
        right = 1 <= count <= _MOST_WRITTEN and len(words) == count and data[4] == 2 * count
        if not right or len(data) != 5 + 2 * count:
            raise Refused(Reason.VALUE, f'a write of {count} registers is malformed')
        self.write(register, words)
        return pymodbus_compat.encode_write_multiple(register, count)

    def _write_and_read(self, data: bytes) -> bytes:
        source, wanted, register, count, words = pymodbus_compat.decode_write_and_read(data)
        right = 1 <= count <= _MOST_WRITTEN_WITH_READ and len(words) == count
        right = right and data[8] == 2 * count and 1 <= wanted <= _MOST_READ
        if not right or len(data) != 9 + 2 * count:
            raise Refused(Reason.VALUE, f'a write of {count} and read of {wanted} is malformed')
        read = self.write_and_read(register, words, source, wanted)
        return pymodbus_compat.encode_registers(WRITE_AND_READ, read)

    @staticmethod
    def _loop_back(data: bytes) -> bytes:
        if data[:2] != bytes(2):
            raise Refused(Reason.FUNCTION, 'of function 08 there is the loopback alone')
        return bytes((DIAGNOSTICS,)) + data

    def _report_slave_id(self, data: bytes) -> bytes:
        if data:
            raise Refused(Reason.VALUE, 'a request of a wrong length')
        # not pymodbus's, which puts the standard's run indicator behind it [C94]
        report = self.slave_id()
        return bytes((REPORT_SLAVE_ID, len(report))) + report

    def _identify(self, data: bytes) -> bytes:
        if data[:1] != bytes((_DEVICE_IDENTIFICATION,)):
            raise Refused(Reason.FUNCTION, 'only MEI type 14 is supported')
        code, first = pymodbus_compat.decode_device(data)
        if len(data) != 3:
            raise Refused(Reason.VALUE, 'a request of a wrong length')
        objects = self.device_objects()
        if code == _SPECIFIC:
            if first not in objects:
                raise Refused(Reason.ADDRESS, f'there is no object {first}')
            return pymodbus_compat.encode_device(code, _CONFORMITY, {first: objects[first]})
        if code not in _STREAMS:
            raise Refused(Reason.VALUE, f'read device ID code {code} is not supported')
        stream = _STREAMS[code]
        # from an object that is not there the standard begins anew
        wanted = stream[first if first in stream else 0 :]
        return pymodbus_compat.encode_device(
            code, _CONFORMITY, {number: objects[number] for number in wanted}
        )


class Server(Requests):
    """
    What one drive does with Modbus requests.

    One parameter in one message, the whole of it [M0 §6.2.3]. Registers are those of the tables;
    a family may have other functions, and say who it is.
    """

    functions = frozenset((READ, WRITE_SINGLE, WRITE_MULTIPLE))

    def __init__(self, drive: SimulatedDrive) -> None:
        self.drive = drive
        self._by_base = _registers(drive.model)
        # the manuals of some have none
        self._log = drive.model.error_logs.get('modbus')

    def slave_id(self) -> bytes:
        """Return what function 17 reports."""
        return self.drive.serial_number.encode('ascii')

    def read(self, register: int, count: int) -> tuple[int, ...]:
        """Read the parameter at a register, as words, the low one first; else :class:`Refused`."""
        entry = self._log_entry(register, count)
        if entry is not None:
            return entry
        parameter = self._find(register, count)
        raw = self.drive.read_over('modbus', parameter)
        return to_words(parameter.at('modbus').number.encode(raw))

    def write(self, register: int, words: Sequence[int]) -> None:
        """Write the parameter at a register (Refused: as the reason says)."""
        parameter = self._find(register, len(words))
        raw = parameter.at('modbus').number.decode(to_bytes(words))
        self.drive.write_over('modbus', parameter, raw)

    def require(self, register: int, count: int) -> None:
        """Ensure that a parameter stands at a register, and has so many."""
        self._find(register, count)

    def _log_entry(self, register: int, count: int) -> tuple[int, ...] | None:
        """Return the entry of the error log at ``register``; ``None`` if it is none."""
        log = self._log
        entry, rest = divmod(register - log.first, log.stride) if log else (-1, 0)
        if log is None or not 0 <= entry < log.limit:
            return None
        if rest or 2 * count != log.codec.size:
            raise Refused(Reason.ADDRESS, f'no entry of the error log is at {register:04X}h')
        return to_words(log.codec.encode(self.drive.faults.log_entry(entry)))

    def _find(self, register: int, count: int) -> Parameter:
        """Return the parameter that stands at ``register`` and has exactly ``count`` of them."""
        parameter = self._by_base.get(register)
        if parameter is None:
            raise Refused(Reason.ADDRESS, f'no parameter begins at register {register:04X}h')
        whole = parameter.at('modbus').codec.size // 2
        if count != whole:
            raise Refused(Reason.ADDRESS, f'{parameter.key} takes {whole} registers, not {count}')
        return parameter


def server(station: Station) -> Requests:
    """Return what does this with the requests to a station."""
    found = station.servers['modbus']
    assert isinstance(found, Requests)
    return found


def is_write(pdu: bytes) -> bool:
    """Whether a request only writes, so that it may be broadcast."""
    return pdu[:1] in (bytes([WRITE_SINGLE]), bytes([WRITE_MULTIPLE]))


@functools.cache
def _registers(model: Family) -> Mapping[int, Parameter]:
    """Return which parameter begins at which holding register [M0 table 4, table 5]."""
    return {
        parameter.at('modbus').index: parameter
        for parameter in model.values()
        if 'modbus' in parameter.addresses
    }
