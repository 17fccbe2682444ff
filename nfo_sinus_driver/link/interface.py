# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The interface of every link: its settings, its transactions and its errors."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence, Set as AbstractSet
from dataclasses import dataclass
import functools
import re
from typing import NamedTuple, Protocol, TypeVar

from nfo_sinus_driver.link.pauses import Pauses
from nfo_sinus_driver.link.thread_clock import ThreadClock

#: The baud rates of serial lines to drives, bit/s.
BAUD_RATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600)
_Found = TypeVar('_Found')
_FORMAT = re.compile(r'([78])([EON])([12])')
#: Most protocols are not the factory setting of their drives [C93].
_CHECK = (
    'the protocol that the drive is set to (the factory setting may be another one), RS232 or '
    'RS485 (there may be a jumper for that), the address, baud rate and parity'
)


#: A steady clock, in seconds; as ``time.monotonic``.
Clock = Callable[[], float]


#: The space of addresses that are PNUs: parameters that a PLC reads from a drive.
MAILBOX = 'pnu'


class Address(NamedTuple):
    """
    The address of a parameter on a line; only the link uses its fields.

    :ivar space: the numbering of the protocol that ``index`` belongs to, such as ``register``.
    :ivar index: its number there; of several registers the first.
    :ivar sub_index: which part of it; where a protocol has parts, the index of the second one.
    :ivar size: how many bytes it takes.
    :ivar signed: whether the number in them may be negative, for a line where the drive decides how
        many bytes it has; ``None``: it is no number, and the bytes count as they come.
    :ivar block: the first register of the block of a PLC by which it is reached; ``None``: it is
        reached directly.
    """

    space: str
    index: int  # type: ignore[assignment]  # hides a method of tuples that is never called
    sub_index: int | None
    size: int
    signed: bool | None = None
    block: int | None = None


class Reply(NamedTuple):
    """
    What a unit answered.

    :ivar data: the bytes read, as on the bus; empty for a write.
    :ivar arrived: when the last byte came, in seconds of ``time.monotonic``.
    :ivar requests: how many were sent for it; 0: it came with an answer before.
    """

    data: bytes
    arrived: float
    requests: int = 1


@dataclass(frozen=True)
class Identification:
    """
    The identity that a unit gives; ``''``: unknown.

    :ivar revision: its firmware, such as ``4.30 / 4018``.
    :ivar model: its size, such as ``1.50/400``.
    :ivar application: the name that a user gave it.
    :ivar serial: its serial number.
    """

    vendor: str = ''
    product_code: str = ''
    revision: str = ''
    url: str = ''
    product: str = ''
    model: str = ''
    application: str = ''
    serial: str = ''


class Read(NamedTuple):
    """Read a parameter; ``once``: sent once, whatever becomes of its answer: it has an effect."""

    address: Address
    once: bool = False

    def carry_out(self, link: Link, unit: int) -> Reply:
        """Read it (LinkError: as its subclasses say)."""
        return link.read(unit, self.address, self.once)


class Write(NamedTuple):
    """Write a parameter."""

    address: Address
    data: bytes

    def carry_out(self, link: Link, unit: int) -> Reply:
        """Write it (LinkError: as its subclasses say)."""
        return link.write(unit, self.address, self.data)


class WriteAndRead(NamedTuple):
    """Write a parameter and read another in the same transaction."""

    address: Address
    data: bytes
    source: Address

    def carry_out(self, link: Link, unit: int) -> Reply:
        """Write and read (LinkError: as its subclasses say)."""
        return link.write_and_read(unit, self.address, self.data, self.source)


class ReadThenWrite(NamedTuple):
    """Read a parameter whose value is not needed, then write another; nothing goes between."""

    source: Address
    address: Address
    data: bytes

    def carry_out(self, link: Link, unit: int) -> Reply:
        """Read, then write (LinkError: as its subclasses say)."""
        return link.read_then_write(unit, self.source, self.address, self.data)


class Ask(NamedTuple):
    """Ask a unit what is no parameter."""

    question: Callable[[], Reply]

    def carry_out(self, link: Link, unit: int) -> Reply:
        """Ask it (LinkError: as its subclasses say); the question has its link and its unit."""
        return self.question()


Written = Write | WriteAndRead
#: What may be wanted of a unit; each takes a turn on the line.
Operation = Read | Written | ReadThenWrite | Ask
#: Several of them, one by one, so that other requests go between; each brings its reply, or
#: ``None`` where it failed.
Plan = Generator[Operation, Reply | None, _Found]
#: Finds out why a unit refused a write whose answer does not say it: by a call that reads a
#: parameter, and its status just before, if that is known. Returns code and text of the refusal.
Why = Callable[[Callable[[Read], int], int | None], tuple[int, str]] | None


class Supervision(Protocol):
    """
    Messages on a line beside requests and answers; for the thread that has the line.

    By them units notice that this end is gone, and this end that a unit has restarted.
    """

    @property
    def due(self) -> float:
        """When :meth:`serve` has to be called again, s of the clock of the link; or infinity."""

    def serve(self) -> None:
        """Send what is due, and take what came unrequested (PortError: the port is lost)."""

    def take_restarted(self) -> AbstractSet[int]:
        """Return the units that have restarted since the last call."""

    def watch(self, unit: int, seconds: float) -> Plan[str]:
        """Have a unit watch this end, with a time-out, s; return by which means (``''``: none)."""


class Remarks:
    """
    What a link has noticed about its line although it works; any thread may read it.

    :ivar foreign_frames: how many requests of another master have come.
    """

    def __init__(self) -> None:
        self.foreign_frames = 0
        self._texts: dict[str, None] = {}

    def add(self, text: str) -> None:
        """Add a sentence, which says what to do, too; once only."""
        self._texts = {**self._texts, text: None}

    @property
    def texts(self) -> tuple[str, ...]:
        """All sentences, in the order in which they came."""
        return tuple(self._texts)


@dataclass(frozen=True)
class LineProtocol:
    """
    What a protocol can do, and how its lines leave the factory.

    :ivar name: as in the driver's parameter ``protocol``.
    :ivar link: its module and class in this folder, such as ``rtu.RtuLink``.
    :ivar addressing: the addresses of the catalog by which it reaches parameters.
    :ivar units: the addresses that a drive may have, in order.
    :ivar baud_rate: of the factory, bit/s.
    :ivar char_format: of the factory, such as ``8E1``.
    :ivar baud_rates: those of the protocol.
    :ivar char_formats: those of the protocol, the likeliest first; none where the line is a
        gateway's.
    :ivar broadcast: the address that every drive obeys and none answers; ``None``: there is none.
    :ivar point_to_point: the address at which a drive that is alone answers, whatever its own is.
    :ivar has_parts: the sub-index of an address is the place of its second part, which takes a
        transaction of its own to read.
    :ivar identifies: a drive can be asked for its identity.
    :ivar writes_and_reads: it can write one parameter and read another in one transaction.
    :ivar most_requests: how many requests a second a PLC or gateway gets at most by default [C118];
        0: the line itself is the limit.
    :ivar carries: other addressings by which it reaches parameters, those of a PLC.
    :ivar rates_disturb: a wrong bit rate disturbs all others on the line, so none is tried.
    :ivar check: what to check, in this order, where no drive answers.
    """

    name: str
    link: str
    addressing: str
    units: Sequence[int]
    baud_rate: int
    char_format: str
    baud_rates: Sequence[int] = BAUD_RATES
    char_formats: Sequence[str] = ()
    broadcast: int | None = None
    point_to_point: int | None = None
    has_parts: bool = False
    identifies: bool = False
    writes_and_reads: bool = False
    most_requests: float = 0.0
    carries: frozenset[str] = frozenset()
    rates_disturb: bool = False
    check: str = _CHECK

    def reaches_by(self, addressing: str) -> bool:
        """Return whether parameters are reached by this addressing; ``''``: that of the line."""
        return addressing in ('', self.addressing, *self.carries)

    def parts(self, address: Address) -> tuple[Address, ...]:
        """Return the parts that each take a transaction to read, the first one of one word."""
        if not self.has_parts or address.sub_index is None or address.block is not None:
            return (address,)
        first = address._replace(sub_index=None, size=2)
        return first, first._replace(index=address.sub_index, size=address.size - 2)

    def require_unit(self, address: int) -> None:
        """
        Make sure that a drive may have an address.

        :raises ValueError: it may not; the message says which it may.
        """
        if address not in self.units:
            raise ValueError(f'address {address}: {self.addressing.title()} has {self.unit_spans}')

    @property
    def unit_spans(self) -> str:
        """The addresses that a drive may have, such as ``0 to 247, 255``."""
        last = [unit for unit in self.units if unit + 1 not in self.units]
        first = [unit for unit in self.units if unit - 1 not in self.units]
        spans = zip(first, last, strict=True)
        return ', '.join(f'{low}' if low == high else f'{low} to {high}' for low, high in spans)

    def require_baud_rate(self, baud_rate: int) -> None:
        """
        Make sure that the protocol can have a baud rate.

        :raises ValueError: it cannot; the message says which it can.
        """
        if baud_rate not in self.baud_rates:
            has = ', '.join(map(str, self.baud_rates))
            raise ValueError(f'baud_rate {baud_rate}: {self.name} has {has}')

    def require_char_format(self, char_format: str) -> None:
        """
        Make sure that the protocol can have a character format.

        :raises ValueError: it cannot; the message says which it can.
        """
        if not self.char_formats or char_format in self.char_formats:
            return
        has = ', '.join(self.char_formats)
        bits, *other_bits = {known[0] for known in self.char_formats}
        if not other_bits and char_format[0] != bits and len(self.char_formats) > 1:
            has = f'{bits} data bits, write {bits}{char_format[1:]}'
        raise ValueError(f'char_format {char_format!r}: {self.name} has {has}')


class Link(Protocol):
    """
    One line to several units, used by one thread.

    :ivar protocol: that of the line.
    :ivar remarks: what it has noticed.
    :ivar last_byte_at: when the last byte has come, whatever it was, s; on CAN the last frame.
    :ivar clock: the clock of that thread, for what else it waits for, too.
    :ivar pauses: how long line and units are left alone before a request.
    """

    protocol: LineProtocol
    remarks: Remarks
    last_byte_at: float
    clock: ThreadClock
    pauses: Pauses

    def wait_at_most(self, seconds: float) -> None:
        """
        Wait for the next answers so long at most, s, but longer than the unit has ever taken.

        It is for a line where many units have to get something, and may all be silent. What comes
        after that is a late answer.
        """

    def end_listening_if(self, stop_waits: Callable[[], bool]) -> None:
        """
        Wait for no more than the answer to the request that was sent, where a stop waits.

        :param stop_waits: returns whether one does.
        """

    def answers_twice(self, unit: int) -> bool:
        """Return whether a unit does: an answer is certain only once the line was silent for it."""

    @property
    def supervision(self) -> Supervision | None:
        """Its messages beside requests and answers; ``None``: it has none."""

    @property
    def place(self) -> str:
        """
        Where the port is that was opened last: the same words, the same place.

        ``''``: that cannot be told. Of an adapter the socket that it is plugged into, its make and
        its serial number; on the network host and port, whatever is behind them. A pseudo-terminal
        has a program behind it: its name (``/dev/pts/5``) is given to the next that wants one, but
        a link to it has a name that lasts, as host and port are.
        """

    def open(self) -> None:
        """
        Open the port; where it is open, and nothing comes from it, open it again.

        What was handed over and has not left is discarded; what may still arrive is not forgotten.

        :raises Connecting: that takes longer.
        :raises PortError: it cannot be opened; the message says what to do.
        """

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""

    def read(self, unit: int, address: Address, once: bool = False) -> Reply:
        """
        Read one parameter, or one part of it where it has several.

        :param once: not again where its answer may be to another master.
        :raises InProgress: it takes more transactions, and has to be called again for each; so does
            a write.
        :raises LinkError: as its subclasses say.
        """

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """Write one parameter (LinkError: as its subclasses say)."""

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """
        Write one parameter and read another, in one transaction.

        :returns: the bytes read; none if it was only written, because a reading could not have been
            believed. A write is not held back for that.
        :raises LinkError: as its subclasses say.
        """

    def read_then_write(self, unit: int, source: Address, address: Address, data: bytes) -> Reply:
        """
        Read a parameter whose value is not needed, then write another; nothing is sent between.

        For a read with an effect, such as acknowledging a fault (02A4h, E00E8). Even if the read
        fails, the write is the next request on the line.

        :param source: what is read in one transaction.
        :returns: the answer to the write.
        :raises LinkError: as for a write; :attr:`LinkError.maybe_done` once the read was sent.
        """

    def identify(self, unit: int) -> Plan[Identification]:
        """Have a unit identify itself; what it does not give stays empty."""

    def use_resync_reads(self, unit: int, addresses: Sequence[Address], why: Why = None) -> None:
        """
        Name parameters whose answers differ and that are safe to read at any time.

        After a doubtful answer, reading one of them shows whether the line can be believed again.

        :param why: finds out why the unit refused, where that needs its status, the first of them.
        """


class LinkError(Exception):
    """
    A transaction failed.

    :ivar maybe_done: the drive may have carried the request out. False only where it cannot have.
    """

    maybe_done = False
    #: The unit answered the resync read before this request: it responds.
    responded = False
    #: What is between has answered, if not the unit: the port is not mute.
    heard = False
    #: What the port knows of the reason, to be shown; ``''`` if nothing.
    hint = ''


class PortError(LinkError):
    """The port cannot be opened or was lost; the message says what to do."""


class Connecting(PortError):
    """Opening the port takes longer: call ``open`` again, which goes on with it."""


class NoAnswer(LinkError):
    """No answer in time."""

    maybe_done = True


def silent(unit: int) -> NoAnswer:
    """Return the error of a unit that has not answered."""
    return NoAnswer(f'unit {unit} did not answer')


class GatewaySilent(NoAnswer):
    """The gateway itself did not answer in time, not even that the drive is silent."""


class GatewayLate(NoAnswer):
    """The gateway answered too late; the message says what to do."""

    heard = True


class NoData(NoAnswer):
    """A PLC answered that it has no valid data from the drive; the message says more."""

    heard = True


class Interrupted(LinkError):
    """A PLC has stopped the drive, for it was not reached for longer than its time-out."""


class MailboxSilent(NoAnswer):
    """A PLC did not answer a read by its mailbox; the message says what to do."""


class Unconfirmed(LinkError):
    """The same of a write: whether the drive has taken it is unknown; it is not repeated."""

    maybe_done = True


class NoPath(LinkError):
    """A gateway does not know where the drive is; the message says what to do."""

    heard = True


class DamagedAnswer(LinkError):
    """Something came, but no answer to this request: noise, a collision or wrong line settings."""

    maybe_done = True


class GatewayFault(DamagedAnswer):
    """The gateway answered against the standard; the message says what to do."""

    heard = True


class NeverSilent(DamagedAnswer):
    """The line is never silent, so nothing was sent."""

    maybe_done = False


class AnotherValue(LinkError):
    """
    A unit has taken a write, and answers that it has another value than was written.

    :ivar data: that value.
    """

    maybe_done = True
    responded = True

    def __init__(self, unit: int, written: bytes, data: bytes) -> None:
        super().__init__(f'unit {unit} has {data.hex()}h where {written.hex()}h was written')
        self.data = data


class Refused(LinkError):
    """
    The drive refused a request.

    :ivar code: the Modbus exception code, or on other protocols the one that means the same; those
        from ``SETTINGS_CONFLICT`` on are not of Modbus.
    :ivar what: what was requested, in the words of the drive; ``''``: not said.
    """

    heard = True
    ILLEGAL_FUNCTION = 1
    ILLEGAL_ADDRESS = 2
    ILLEGAL_VALUE = 3
    DEVICE_FAILURE = 4
    BUSY = 6
    NO_PATH = 10
    NO_ANSWER = 11
    #: Other settings forbid the value; it may be accepted after they have changed.
    SETTINGS_CONFLICT = 0x100
    #: The output stage has to be off.
    RELEASE_NEEDED = 0x101

    def __init__(self, code: int, reason: str = '', what: str = '') -> None:
        self.code = code
        self.what = what
        self._reason = reason
        #: What an operator may look up, for the end of a sentence.
        self.behind = f': {reason}' if reason else f' (exception {code})'
        text = _REFUSALS.get(code, 'the drive refused')
        super().__init__(reason or f'{text} (exception {code})')

    @property
    def is_busy(self) -> bool:
        """The drive has done nothing, and may take the same request the next moment."""
        return self.code == self.BUSY

    def of(self, what: str) -> Refused:
        """Return the same refusal, of something that is named."""
        return Refused(self.code, self._reason, what)

    def naming(self) -> Refused:
        """Return the same refusal, whose text says what it is that the drive does not have."""
        if self.code != self.ILLEGAL_ADDRESS or self._reason or not self.what:
            return self
        return Refused(self.code, f'the drive has no {self.what} (exception {self.code})')


_REFUSALS = {
    Refused.ILLEGAL_FUNCTION: 'the drive does not know this function',
    Refused.ILLEGAL_ADDRESS: 'the drive has no such parameter',
    Refused.ILLEGAL_VALUE: 'the drive does not accept this value',
    Refused.DEVICE_FAILURE: 'the drive cannot do this in its present state',
    5: 'the drive needs more time',
    Refused.BUSY: 'the drive is busy',
    8: 'the drive found a memory error',
    Refused.NO_PATH: 'the gateway has no path to the drive',
    Refused.NO_ANSWER: 'the gateway got no answer from the drive',
}


class NotSent(Refused):
    """The link itself has refused a request: nothing was sent, and no drive has answered."""


class NotReady(LinkError):
    """
    Requests to this unit must pause, so that no late answer is taken for the right one.

    Nothing was sent.

    :ivar until: when it may get a request again, in seconds of ``time.monotonic``.
    """

    def __init__(self, until: float) -> None:
        self.until = until
        super().__init__('answers to earlier requests may still be on their way')


class InProgress(NotReady):
    """One transaction of several was done: repeat the call for the next of them."""


@dataclass(frozen=True)
class LineSettings:
    """
    The settings of a serial line.

    :ivar baud_rate: bit/s, one of the protocol's. 19200 is the drive's default for Modbus
        [M0 §6.2.2].
    :ivar char_format: data bits, parity and stop bits, such as ``8E1``.
    :ivar response_timeout: from the last byte sent to the first byte of the answer, s.
    :ivar rs485: let the port itself switch the transmitter, where it can.
    :ivar request_gap: the least silence before each request, s; 0: that of the protocol.
    :raises ValueError: a setting that no drive has; the message says which ones are possible.
    """

    baud_rate: int = 19200
    char_format: str = '8E1'
    response_timeout: float = 0.2
    rs485: bool = False
    request_gap: float = 0.0

    def __post_init__(self) -> None:
        if self.baud_rate <= 0:
            raise ValueError(f'baud_rate {self.baud_rate}: it is more than 0')
        if not _FORMAT.fullmatch(self.char_format):
            raise ValueError(
                f'char_format {self.char_format!r}: write data bits, parity and stop bits, '
                'such as 8E1, 8O1 or 8N2'
            )
        if not 0.01 <= self.response_timeout <= 10:
            raise ValueError(f'response_timeout {self.response_timeout}: 0.01 to 10 s')

    @property
    def data_bits(self) -> int:
        """7 or 8."""
        return int(self.char_format[0])

    @property
    def parity(self) -> str:
        """``E``, ``O`` or ``N``."""
        return self.char_format[1]

    @property
    def stop_bits(self) -> int:
        """1 or 2."""
        return int(self.char_format[2])

    @functools.cached_property
    def char_time(self) -> float:
        """The time of one character on the wire, s."""
        bits = 1 + self.data_bits + (self.parity != 'N') + self.stop_bits
        return bits / self.baud_rate

    @property
    def frame_gap(self) -> float:
        """The silence between two Modbus RTU frames, t3.5, s; fixed above 19200 bit/s."""
        return 0.00175 if self.baud_rate > 19200 else 3.5 * 11 / self.baud_rate
