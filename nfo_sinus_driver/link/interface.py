# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The one interface of every link: how it is set, what it does, and what can go wrong on it."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set as AbstractSet
from dataclasses import dataclass
import functools
import re
from typing import NamedTuple, Protocol

#: Of serial lines to drives, bit/s.
BAUD_RATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600)
_FORMAT = re.compile(r'([78])([EON])([12])')
#: Most protocols are for drives that leave the factory set to another one [C93].
_CHECK = (
    'the protocol that the drive is set to (the factory setting may be another one), RS232 or '
    'RS485 (there may be a jumper for that), the address, baud rate and parity'
)


#: A steady clock, in seconds; as ``time.monotonic``.
Clock = Callable[[], float]


#: The space of addresses that count in PNUs: of parameters that a PLC asks a drive for.
MAILBOX = 'pnu'
#: That of addresses of the drive itself, which go by such parameters.
DRIVE_ADDRESS = 'drive_address'
#: Both: what is reached by the mailbox of a PLC.
BY_MAILBOX = frozenset((MAILBOX, DRIVE_ADDRESS))


class Address(NamedTuple):
    """
    Where a parameter stands on a line; only the link looks inside.

    :ivar space: which numbering of the protocol ``index`` counts in, such as ``register``.
    :ivar index: its number there; of several registers the first.
    :ivar sub_index: which part of it; on Classic the id of the high word.
    :ivar size: how many bytes it takes.
    :ivar signed: whether the number in them may be negative, for a line where the drive says how
        many bytes it has for it; ``None``: it is no number, and they count as they come.
    :ivar block: the first register of the block of a PLC that it is reached by; ``None``: it is
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

    :ivar data: the bytes read, as they stand on the bus; empty for a write.
    :ivar arrived: when the last byte came, in seconds of ``time.monotonic``.
    :ivar requests: how many were sent for it; 0: it came with an answer before.
    """

    data: bytes
    arrived: float
    requests: int = 1


@dataclass(frozen=True)
class Identification:
    """
    Who a unit says it is; ``''`` where it does not tell.

    :ivar revision: its firmware, such as ``4.30 / 4018``.
    :ivar model: its size, such as ``1.50/400``.
    :ivar application: what a user named it.
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


class Inquiry(Protocol):
    """Questions to a unit about itself, asked one by one, so that others may talk between."""

    @property
    def done(self) -> bool:
        """There is nothing left to ask."""

    @property
    def found(self) -> Identification:
        """What it has said so far."""

    def ask(self) -> Reply:
        """
        Ask the next question: one transaction.

        A question that failed is not asked again; only after :class:`NotReady` it still is to be.

        :raises LinkError: as its subclasses say.
        """


class Watch(Protocol):
    """
    How a unit is made to notice silence on the line; step by step, as an inquiry.

    :ivar means: by what it notices; ``''``: it has nothing for it, or it is turned off.
    """

    means: str

    @property
    def done(self) -> bool:
        """There is nothing left to do."""

    def step(self) -> Reply:
        """
        Do the next step: one transaction, which is done again after an error.

        :raises LinkError: as its subclasses say.
        """


class Supervision(Protocol):
    """
    What lives on a line beside questions and answers; for the thread that has the line.

    Units notice by it that this end is gone, and this end that a unit has started anew.
    """

    @property
    def due(self) -> float:
        """When :meth:`serve` has to be called again, s of the clock of the link; or infinity."""

    def serve(self) -> None:
        """Send what is due, and take what came unasked (PortError: the port is lost)."""

    def take_restarted(self) -> AbstractSet[int]:
        """Return the units that have started anew since this was asked last."""

    def watch(self, unit: int, seconds: float) -> Watch:
        """Return how a unit is made to notice a silence of so long, s; 0: nothing any more."""


class Remarks:
    """
    What a link has noticed about its line although it works; any thread may read it.

    :ivar foreign_frames: how many requests of another master have been heard.
    """

    def __init__(self) -> None:
        self.foreign_frames = 0
        self._texts: dict[str, None] = {}

    def add(self, text: str) -> None:
        """Take note of a sentence, which says what to do, too; once only."""
        self._texts = {**self._texts, text: None}

    @property
    def texts(self) -> tuple[str, ...]:
        """Every sentence, in the order in which they came."""
        return tuple(self._texts)


class NothingToAsk:
    """The inquiry of a protocol that knows nothing but parameters: it has no questions."""

    done = True
    found = Identification()

    def ask(self) -> Reply:
        """Ask nothing: there is no question."""
        raise IndexError('there is no question left')


@dataclass(frozen=True)
class LineProtocol:
    """
    What a protocol can do, and how its lines leave the factory.

    :ivar name: as the driver's parameter ``protocol`` has it.
    :ivar link: what speaks it, file and class of this folder, such as ``rtu.RtuLink``.
    :ivar addressing: which addresses of the catalog it reaches parameters by.
    :ivar units: the addresses that a drive may have.
    :ivar baud_rate: of the factory, bit/s.
    :ivar char_format: of the factory, such as ``8E1``.
    :ivar baud_rates: those that the protocol can have.
    :ivar char_formats: those that the protocol can have, the likeliest first; none where the line
        is a gateway's.
    :ivar broadcast: the address that every drive obeys and none answers; ``None``: there is none.
    :ivar point_to_point: the address at which a drive that is alone answers, whatever its own is.
    :ivar identifies: a drive can be asked who it is.
    :ivar writes_and_reads: it can write one parameter and read another in one transaction.
    :ivar most_requests: how many a second what serves the line is sent at most by default, a PLC or
        a gateway [C118]; 0: the line itself is the limit.
    :ivar carries: what else it reaches parameters by, that stand at who is between: a PLC.
    :ivar rates_disturb: whoever has a wrong bit rate disturbs all others on the line, so that none
        is tried.
    :ivar check: what to look at, in this order, where no drive answers.
    """

    name: str
    link: str
    addressing: str
    units: range
    baud_rate: int
    char_format: str
    baud_rates: Sequence[int] = BAUD_RATES
    char_formats: Sequence[str] = ()
    broadcast: int | None = None
    point_to_point: int | None = None
    identifies: bool = False
    writes_and_reads: bool = False
    most_requests: float = 0.0
    carries: frozenset[str] = frozenset()
    rates_disturb: bool = False
    check: str = _CHECK

    def reaches_by(self, addressing: str) -> bool:
        """Tell whether parameters are reached by these addresses; ``''``: as the line does."""
        return addressing in ('', self.addressing, *self.carries)

    def require_unit(self, address: int) -> None:
        """
        Make sure that a drive may have an address.

        :raises ValueError: it may not; the message says which there are.
        """
        if address not in self.units:
            name = self.addressing.title()
            raise ValueError(f'address {address}: {name} has {self.units[0]} to {self.units[-1]}')

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

    :ivar protocol: what it speaks.
    :ivar remarks: what it has noticed.
    """

    protocol: LineProtocol
    remarks: Remarks

    @property
    def supervision(self) -> Supervision | None:
        """What lives on it beside questions and answers; ``None``: nothing."""

    def open(self) -> None:
        """
        Open the port; where it is open, and nothing comes from it, another way to its far end.

        :raises Connecting: that takes longer.
        :raises PortError: it cannot be opened; the message says what to do.
        """

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""

    def parts(self, address: Address) -> Sequence[Address]:
        """Return what each takes a transaction of its own to read, the low part first."""

    def read(self, unit: int, address: Address) -> Reply:
        """
        Read one parameter, or one part of it where it has several.

        :raises InProgress: it takes more transactions, and the same has to be called for each; so
            it is with a write.
        :raises LinkError: as its subclasses say.
        """

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """Write one parameter (LinkError: as its subclasses say)."""

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """
        Write one parameter and read another, in one transaction.

        :returns: the bytes read; none if it was only written, because what was read could not have
            been believed. A write is not held back for that.
        :raises LinkError: as its subclasses say.
        """

    def read_then_write(self, unit: int, source: Address, address: Address, data: bytes) -> Reply:
        """
        Read a parameter whose value is not needed, then write another; nothing is sent between.

        For reading that does something, such as acknowledging a fault (02A4h, E00E8). Whatever
        becomes of the read, the write is the next thing on the line.

        :param source: what is read in one transaction.
        :returns: the answer to the write.
        :raises LinkError: as for a write; :attr:`LinkError.maybe_done` once the read was sent.
        """

    def identify(self, unit: int) -> Inquiry:
        """Return the questions by which a unit tells who it is; nothing is sent yet."""

    def use_resync_reads(self, unit: int, addresses: Sequence[Address]) -> None:
        """
        Name parameters of different sizes that are safe to read at any time.

        After a doubtful answer one of them tells whether the line can be believed again.
        """


class LinkError(Exception):
    """
    A transaction failed.

    :ivar maybe_done: the drive may have carried the request out. False only where it cannot have.
    """

    maybe_done = False
    #: The unit answered a question before, for the sake of this one: it is there.
    heard = False
    #: What the port knows of why, as it may be shown; ``''`` if nothing.
    hint = ''


class PortError(LinkError):
    """The port cannot be opened or was lost; the message says what to do."""


class Connecting(PortError):
    """It takes longer to open the port: it has to be opened again, which goes on with it."""


class NoAnswer(LinkError):
    """No answer in time."""

    maybe_done = True


class GatewaySilent(NoAnswer):
    """The gateway itself said nothing in time, not even that the drive is silent."""


class GatewayLate(NoAnswer):
    """The gateway answered too late; the message says what to do."""


class NoData(NoAnswer):
    """A PLC between answered that it has no valid data from the drive; the message says more."""


class Interrupted(LinkError):
    """What is between has stopped the drive, for it was not reached for longer than its time."""


class MailboxSilent(NoAnswer):
    """A PLC did not answer what was asked by its mailbox; the message says what to do."""


class Unconfirmed(LinkError):
    """The same of a write: whether the drive has taken it is not known, nor is it repeated."""

    maybe_done = True


class NoPath(LinkError):
    """A gateway does not know where the drive is; the message says what to do."""


class DamagedAnswer(LinkError):
    """Something came, but no answer to this request: noise, a collision or wrong line settings."""

    maybe_done = True


class GatewayFault(DamagedAnswer):
    """The gateway answered in a way that no gateway may; the message says what to do."""


class NeverSilent(DamagedAnswer):
    """The line is never silent, so nothing was sent."""

    maybe_done = False


class Refused(LinkError):
    """
    The drive answered that it will not.

    :ivar code: the Modbus exception code, or on other protocols the one that means the same; those
        from ``SETTINGS_CONFLICT`` on are none of Modbus.
    """

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

    def __init__(self, code: int, reason: str = '') -> None:
        self.code = code
        #: What a person may look up, to stand behind a sentence.
        self.behind = f': {reason}' if reason else f' (exception {code})'
        text = _REFUSALS.get(code, 'the drive refused')
        super().__init__(reason or f'{text} (exception {code})')


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


class NotReady(LinkError):
    """
    This unit must be left alone for a while, so that no late answer is taken for the right one.

    Nothing was sent.

    :ivar until: when it may be asked again, in seconds of ``time.monotonic``.
    """

    def __init__(self, until: float) -> None:
        self.until = until
        super().__init__('answers to earlier requests may still be on their way')


class InProgress(NotReady):
    """One transaction of several was done: the same is to be asked again, for the next of them."""


@dataclass(frozen=True)
class LineSettings:
    """
    How a serial line is set.

    :ivar baud_rate: bit/s; which there are is for the protocol to say. 19200 is the drive's default
        for Modbus [M0 §6.2.2].
    :ivar char_format: data bits, parity and stop bits, such as ``8E1``.
    :ivar response_timeout: from the last byte sent to the first byte of the answer, s.
    :ivar rs485: let the port itself switch the transmitter, where it can.
    :raises ValueError: a setting that no drive has; the message says which there are.
    """

    baud_rate: int = 19200
    char_format: str = '8E1'
    response_timeout: float = 0.2
    rs485: bool = False

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
