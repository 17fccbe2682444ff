# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Reads and writes the parameters of one drive by their catalog names, in engineering units."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from fractions import Fraction
from typing import NamedTuple

from nfo_sinus_driver.bus import Bus, ByAddress, Priority
from nfo_sinus_driver.catalog import Access, Family, Parameter, Role, Value, profile
from nfo_sinus_driver.drive.known.contact import Contact
from nfo_sinus_driver.drive.known.events import DriveError
from nfo_sinus_driver.link import (
    MAILBOX,
    Address,
    AnotherValue,
    DamagedAnswer,
    Identification,
    NoAnswer,
    Read,
    ReadThenWrite,
    Refused,
    Reply,
    Write,
    WriteAndRead,
    Written,
)

#: How often a request to a busy drive is repeated, s, and how many times.
_BUSY_PERIOD = 0.05
_BUSY_REPEATS = 10
#: The space of the addresses of the drive itself, and all that is reached by the mailbox of a PLC.
_OWN = 'drive_address'
_BY_MAILBOX = frozenset((MAILBOX, _OWN))
#: How a drive answers that lacks the option card of a parameter, and how often until that is
#: believed.
NONE_SUCH = frozenset((Refused.ILLEGAL_ADDRESS, Refused.ILLEGAL_FUNCTION))
_DENIALS = 2
#: How often an impossible value is read at most, until it is believed.
_READINGS = 3
#: Parameters of different sizes that are safe to read at any time.
_RESYNC_READS = (Role.STATUS_CODE, Role.STATUS_WORD, Role.OPERATING_TIME)


class Patience(NamedTuple):
    """
    How often a request is repeated before its error counts.

    A stop has none: it repeats itself, by what each try has shown (:mod:`..motion.stopping`). Nor
    has a set-point: the next one takes its turn (:mod:`..motion.setpoint`).

    :ivar silent: while it gets no answer, or a damaged one.
    :ivar busy: while the drive answers that it is busy; it has done nothing then.
    """

    silent: int
    busy: int


class ParameterAccess:
    """
    The parameters of one drive, for coroutines on the bus.

    Nothing is written before the drive is recognised: what writes reads first what tells that.

    :param addressing: how they are addressed; ``''``: as the line does.
    :param block_address: the first register of their block, behind a PLC.
    :param retries: how often a request without an answer is sent again, where ``retry`` is true.
    :raises LinkError: reading or writing fails, as the link does.
    :raises DriveError: nothing is written, for it is not known what is there.
    :raises ValueError: a value that the drive cannot have, or bytes that mean none.
    :ivar contact: whether that is known, and whether it answers.
    """

    def __init__(
        self,
        bus: Bus,
        unit: int,
        model: Family,
        retries: int,
        contact: Contact,
        addressing: str = '',
        block_address: int = 0,
    ) -> None:
        self.model = model
        self._bus = bus
        #: The clock of the bus.
        self.now, self.sleep = bus.now, bus.sleep
        self._unit = unit
        self._retries = retries
        self.contact = contact
        self._recognise: Callable[[], Awaitable[None]] | None = None
        #: Impossible values that were read more than once.
        self._odd: dict[str, bytes] = {}
        #: What steps of a profile have written last and no reading has shown yet.
        self._own: dict[str, bytes] = {}
        #: What this drive does not have.
        self._lacking: frozenset[str] = frozenset()
        #: The refusals in a row of parameters whose option card may be missing.
        self._denials: dict[str, list[Refused]] = {}
        self._addresses: dict[str, Address] = {}
        #: Those that have another factor in this drive than in the tables.
        self._rescaled: dict[str, Parameter] = {}
        #: How parameters are addressed on this line.
        self.protocol = addressing or bus.protocol.addressing
        #: They are in the registers of a PLC.
        self.in_block = self.protocol != bus.protocol.addressing
        self._block = block_address if self.in_block else None
        #: The PLC has a mailbox by which parameters of the drive are reached.
        self._has_mailbox = False
        self._by_address = ByAddress(bus)
        usual = (model.key(role) for role in _RESYNC_READS if role in model.roles)
        reads = model.profile.resync_reads.get(self.protocol, usual)
        ask = model.profile.why_refused

        def why(read: Callable[[Read], int], before: int | None) -> tuple[int, str]:
            assert ask is not None
            return ask(lambda key: read(Read(self.address(key), self._acknowledges(key))), before)

        bus.use_resync_reads(unit, tuple(map(self.address, reads)), ask and why)
        bus.require_gap(unit, model.profile.gap)

    def address(self, key: str) -> Address:
        """Return the address of a parameter."""
        if key not in self._addresses:
            address = Address(*self.model[key].at(self.protocol).place)
            self._addresses[key] = address._replace(block=self._block)
        return self._addresses[key]

    def is_rescaled(self, key: str) -> bool:
        """Return whether a parameter has another factor in this drive than in the tables."""
        return key in self._rescaled

    def rescale(self, factors: Mapping[str, Fraction]) -> None:
        """Multiply the factors of parameters by those of this drive, by key."""
        self._rescaled = {
            key: self.model[key].rescaled(self.protocol, factor)
            for key, factor in factors.items()
            if factor != 1 and self.reaches(key)
        }

    def _parameter(self, key: str) -> Parameter:
        return self._rescaled.get(key) or self.model[key]

    def with_status(self, address: Address, data: bytes) -> Written:
        """Return a write that brings the status word, too, where line and drive can do that."""
        if self._bus.protocol.writes_and_reads and self.model.profile.writes_and_reads:
            return WriteAndRead(address, data, self.address(self.model.key(Role.STATUS_WORD)))
        return Write(address, data)

    def encode(self, key: str, value: Value) -> bytes:
        """Return the bytes to write for a value."""
        parameter = self._parameter(key)
        if parameter.never_negative and not isinstance(value, str) and value < 0:
            raise ValueError(f'{key}: {value:g} is out of range, at least 0 {parameter.unit}')
        highest = self._highest(key)
        if highest is not None and not isinstance(value, str) and value > highest:
            raise ValueError(f'{key}: {value:g} is out of range, at most {highest} on this bus')
        return parameter.encode(value, self.protocol)

    def target(self, step: profile.Write) -> tuple[Address, bytes]:
        """Return where a step of a profile is written, and what: a float as the nearest step."""
        address = self.address(step.at if self.reaches(step.at) else step.key)
        if isinstance(step.value, float):
            return address, self._parameter(step.key).quantise(step.value, self.protocol)
        return address, self.encode(step.key, step.value)

    def value(self, key: str, data: bytes) -> Value:
        """Return the value that bytes mean."""
        return self._parameter(key).decode(data, self.protocol)

    def has_one_word(self, key: str) -> bool:
        """Return whether a number has 16 bits on this line."""
        return self.model[key].at(self.protocol).codec.size == 2

    def is_addressable(self, key: str) -> bool:
        """Return whether the tables have the address of a parameter on this line."""
        return key in self.model and self.protocol in self.model[key].addresses

    def reaches(self, key: str) -> bool:
        """Return whether the drive has a parameter and it can be reached over this line."""
        if not self.is_addressable(key) or key in self._lacking:
            return False
        return self.reaches_space(self.model[key].at(self.protocol).space)

    def reaches_space(self, space: str) -> bool:
        """Return whether a space of addresses can be reached over this line."""
        return space not in _BY_MAILBOX or not self.in_block or self._has_mailbox

    def by_mailbox(self, key: str) -> bool:
        """Return whether a parameter is reached by the mailbox of a PLC, which is slow."""
        there = self.in_block and self.is_addressable(key)
        return there and self.model[key].at(self.protocol).space in _BY_MAILBOX

    def use_mailbox(self, has_mailbox: bool) -> None:
        """Note whether parameters are reached by the mailbox of the PLC."""
        self._has_mailbox = has_mailbox

    async def find_lacking(self) -> None:
        """Find out which parameters this drive lacks of those that not every drive has."""
        lacking = set()
        for key in self.model.profile.may_lack.get(self.protocol, ()):
            try:
                await self.read_data(key, Priority.SERVICE)
            except Refused as error:
                if error.code not in NONE_SUCH:
                    raise
                lacking.add(key)
        self._lacking = frozenset(lacking)

    def _acknowledges(self, key: str) -> bool:
        """Return whether reading a parameter acknowledges."""
        return self.model[key].access is Access.ACKNOWLEDGE

    def limits(self, key: str) -> tuple[float, float, float]:
        """Return the least value of a number, the greatest, and the step between two."""
        parameter = self._parameter(key)
        low, high = parameter.span(self.protocol)
        low = max(low, Fraction(0)) if parameter.never_negative else low
        high = self._highest(key) or high
        return float(low), float(high), float(parameter.step(self.protocol))

    def connected(self) -> None:
        """Note that the drive is connected: it may have another option card than before."""
        self._denials.clear()

    def require_fitted(self, key: str) -> None:
        """Raise what the drive has answered each time, if it lacks the option card for a key."""
        denials = self._denials.get(key, [])
        if len(denials) >= _DENIALS:
            raise denials[-1]

    def _highest(self, key: str) -> Fraction | None:
        """Return the highest address of the line: beyond it the drive would be lost [C10]."""
        if self.model.role_of.get(key) is not Role.BUS_ADDRESS:
            return None
        highest = Fraction(self._bus.protocol.units[-1])
        return highest if highest < self.model[key].span(self.protocol)[1] else None

    def number(self, key: str, data: bytes) -> float:
        """Return the number that bytes mean; of a value with labels, its code."""
        return self.model[key].number_of(self.value(key, data))

    async def read(self, key: str, priority: Priority, *, retry: bool = True) -> Value:
        """Read a parameter."""
        return self.value(key, await self.read_data(key, priority, retry=retry))

    async def read_data(self, key: str, priority: Priority, *, retry: bool = True) -> bytes:
        """Read the bytes of a parameter."""
        return (await self.read_reply(key, priority, retry=retry)).data

    async def read_number(self, key: str, priority: Priority, *, retry: bool = True) -> float:
        """Read a parameter that is a number."""
        return self.number(key, await self.read_data(key, priority, retry=retry))

    def recognise_by(self, recognise: Callable[[], Awaitable[None]]) -> None:
        """Take what reads all that tells whether it is a drive of this family."""
        self._recognise = recognise

    async def require_recognised(self) -> None:
        """Make sure that it is known what is there, by reading it if need be (DriveError: not)."""
        if not self.contact.is_recognised and self._recognise is not None:
            await self._recognise()
        self.contact.require_recognised()

    async def identify(self, priority: Priority) -> Identification:
        """Read the identity of the drive; what it does not give stays empty."""
        return await self._bus.identify(self._unit, priority)

    async def watch(self, seconds: float, priority: Priority) -> str:
        """Have the drive notice a silence of the line; see :meth:`Bus.watch`."""
        if self._bus.supervised:
            await self.require_recognised()
        tries, require = 1 + self._retries, self.contact.require_recognised
        return await self._bus.watch(self._unit, seconds, priority, tries, require)

    async def acknowledge(self, key: str, priority: Priority) -> Value:
        """Read a parameter whose reading acknowledges, once: an operator has requested it."""
        assert self._acknowledges(key), key
        read = Read(self.address(key), once=True)
        reply = await self._ask(read, priority, self._patience(priority, retry=False))
        return self.value(key, reply.data)

    async def acknowledge_and_write(self, key: str, step: profile.Write) -> None:
        """
        Read a parameter whose reading acknowledges, and write another as the very next frame.

        :raises LinkError: the write was not answered, or refused, whether or not the reading was.
        """
        assert self._acknowledges(key), key
        both = ReadThenWrite(self.address(key), *self.target(step))
        await self._ask(both, Priority.STOP, Patience(silent=0, busy=0))

    async def write(
        self,
        step: profile.Write,
        priority: Priority,
        require_wanted: Callable[[], None] = lambda: None,
        permit: Callable[[], None] | None = None,
    ) -> bytes:
        """
        Write as a profile says, unless ``require_wanted`` raises when its turn has come.

        :returns: what the drive has then, as far as its answer shows.

        :param permit: raises likewise where it is not known what is there, in place of the usual
            recognition: of a stop.
        """
        address, data = self.target(step)
        priority = Priority.STOP if step.head else priority
        self._own[step.key] = data
        try:
            reply = await self._ask(
                Write(address, data),
                priority,
                self._patience(priority, step.retry, at_head=step.head),
                require_wanted,
                permit,
            )
            return reply.data or data
        except Refused as error:
            self._own.pop(step.key, None)
            raise self._named(error, step.key) from None
        except DriveError:
            self._own.pop(step.key, None)
            raise

    def is_own(self, key: str, data: bytes) -> bool:
        """Return whether a step of a profile has written what was now read of a parameter."""
        return self._own.pop(key, None) == data

    async def write_data(
        self, key: str, data: bytes, priority: Priority, *, retry: bool = True
    ) -> None:
        """Write the bytes of a parameter, whatever its range."""
        try:
            write = Write(self.address(key), data)
            await self._ask(write, priority, self._patience(priority, retry))
        finally:
            self.rest()

    def rest(self) -> None:
        """Have the drive asked nothing for as long as it wants after a parameter was written."""
        self._bus.rest(self._unit, self.model.profile.rest_after_write)

    async def read_from(self, address: Address, priority: Priority, *, retry: bool = True) -> bytes:
        """Read the bytes at an address."""
        there = Read(address._replace(block=self._block))
        return (await self._ask(there, priority, self._patience(priority, retry))).data

    def is_odd(self, key: str) -> bool:
        """Return whether the last value of a parameter is impossible, read more than once."""
        return key in self._odd

    def can_be(self, key: str, data: bytes) -> bool:
        """Return whether bytes mean a value that the manual allows for a parameter."""
        try:
            return self.model.can_be(key, self.value(key, data))
        except ValueError:
            return False

    async def read_reply(self, key: str, priority: Priority, *, retry: bool = True) -> Reply:
        """
        Read the bytes of a parameter; an impossible value counts when it comes again.

        :raises ValueError: its reading acknowledges, and a motor might start by that.
        """
        if self._acknowledges(key):
            raise ValueError(f'{key} is not just read: that acknowledges a fault')
        there, patience = Read(self.address(key)), self._patience(priority, retry)
        try:
            reply = await self._ask(there, priority, patience)
        except Refused as error:
            if error.code in NONE_SUCH and self.model[key].option:
                self._denials[key] = [*self._denials.get(key, ()), error][-_DENIALS:]
            raise self._named(error, key) from None
        self._denials.pop(key, None)
        before = self._odd.pop(key, None)
        readings = 1
        while not self.can_be(key, reply.data):
            if reply.data == before or readings == _READINGS:
                self._odd[key] = reply.data
                break
            before = reply.data
            reply = await self._ask(there, priority, patience)
            readings += 1
        return reply

    def _named(self, refusal: Refused, key: str) -> Refused:
        parameter = self.model[key]
        return refusal.of(parameter.key if parameter.is_setting else parameter.name)

    def meant(self, refusal: Refused) -> Refused:
        """Return a refusal with what its code means to this family."""
        profile, code = self.model.profile, refusal.code
        if code in profile.busy:
            return Refused(Refused.BUSY, profile.refusals.get(code, ''))
        text = profile.refusals.get(code)
        return refusal if text is None else Refused(code, f'{text} (exception {code})')

    def _patience(self, priority: Priority, retry: bool, *, at_head: bool = False) -> Patience:
        """
        Return how often a request is repeated.

        :param at_head: it goes ahead of all else, and is no stop, which is repeated by its caller.
        """
        waits = retry or at_head or priority > Priority.LOOK
        return Patience(self._retries if retry else 0, _BUSY_REPEATS if waits else 0)

    async def _ask(
        self,
        operation: Read | Write | ReadThenWrite,
        priority: Priority,
        patience: Patience,
        require_wanted: Callable[[], None] = lambda: None,
        permit: Callable[[], None] | None = None,
    ) -> Reply:
        there = operation.address
        if there.space == _OWN:
            if permit is None:
                await self.require_recognised()
            began = self.now()

            def require_same() -> None:
                if permit is None:
                    # what was written before may be in another drive
                    self.contact.require_recognised(began)
                else:
                    permit()
                require_wanted()

            def ask(pnu: int, word: int | None) -> Awaitable[Reply]:
                at = Address(MAILBOX, pnu, None, 2, False, there.block)
                step = Read(at) if word is None else Write(at, word.to_bytes(2, 'big'))
                # the PLC does nothing twice, so what is lost of it may be repeated
                repeated = self._patience(priority, retry=True)
                return self._ask(step, priority, repeated, require_same, permit)

            word = None if isinstance(operation, Read) else int.from_bytes(operation.data, 'big')
            return await self._by_address.access(there.index, word, ask)
        has_effect = not isinstance(operation, Read) or operation.once
        # a mailbox is asked by a write to the registers of the PLC
        if has_effect or (self.in_block and there.space in _BY_MAILBOX):
            if permit is None:
                await self.require_recognised()

            def require() -> None:
                if permit is None:
                    self.contact.require_recognised()
                else:
                    permit()
                require_wanted()
        else:
            require = require_wanted
        silent, busy = patience
        while True:
            try:
                return await self._bus.ask(self._unit, operation, priority, require)
            except AnotherValue as error:
                # what writes looks at what the drive has then
                return Reply(error.data, self.now())
            except (NoAnswer, DamagedAnswer) as error:
                self.contact.count(error)
                if not silent:
                    raise
                silent -= 1
            except Refused as refusal:
                meant = self.meant(refusal)
                if not (meant.is_busy and busy):
                    raise meant from None
                busy -= 1
                await self._bus.sleep(_BUSY_PERIOD)
            self._bus.recorder.retry(self._unit)
