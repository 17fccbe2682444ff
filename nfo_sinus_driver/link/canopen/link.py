# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of nodes on a CAN bus, by the service data objects of CANopen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence, Set as AbstractSet
import contextlib
from dataclasses import replace
import math
import re
import time

from nfo_sinus_driver.link.canopen import sdo
from nfo_sinus_driver.link.canopen.can import FUNCTION_CODE, CanPort, Frame, SocketCan, TracedCan
from nfo_sinus_driver.link.canopen.lawicel import LawicelPort
from nfo_sinus_driver.link.canopen.sdo import SECOND, Download, Kind, ObjectShapes, Transfer, Upload
from nfo_sinus_driver.link.canopen.supervision import (
    HEARTBEATS,
    LONGEST_DRAIN,
    CanopenSupervision,
    start,
)
from nfo_sinus_driver.link.foreign_traffic import Sightings
from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    DamagedAnswer,
    Identification,
    InProgress,
    LineSettings,
    LinkError,
    NoAnswer,
    Plan,
    PortError,
    Read,
    Refused,
    Remarks,
    Reply,
    Why,
)
from nfo_sinus_driver.link.late_replies import LISTENING_STEP, STOP_WAITS, LateReplies
from nfo_sinus_driver.link.pauses import Pauses
from nfo_sinus_driver.link.ports.port import port_of
from nfo_sinus_driver.link.ports.trace import Trace
from nfo_sinus_driver.link.protocols import CANOPEN
from nfo_sinus_driver.link.thread_clock import ThreadClock

#: Bit rate of the serial port of an adapter; those on USB do not care.
_ADAPTER_RATE = 115_200
#: Objects that may be read at any time: device type, error register, the number of entries of the
#: identity, and the vendor. Each node has them (CiA 301); one that does not says so by an abort,
#: which names the object and serves as well. With four of them one is always certain, see
#: LateReplies.
_EVERYWHERE = ((0x1000, 0), (0x1001, 0), (0x1018, 0), (0x1018, 1))
#: The name of a network interface, which no path of a device has.
_INTERFACE = re.compile(r'[^/:\s]+')
#: An adapter as python-can names it, by its maker's library: see docs/architecture.md.
_BY_LIBRARY = re.compile(r'(pcan|kvaser|ixxat|vector):')
#: Bits of a frame with eight bytes, at least.
_FRAME_BITS = 108
#: The longest value that comes in one answer, bytes.
_EXPEDITED = 4
#: How often a read is tried that another client's requests make uncertain.
_TRIES = 3


def _remark(unit: int) -> str:
    return (
        f'another SDO client asks node {unit}: a node answers one client at a time, so disconnect '
        'it or stop its program; until then readings come later, and commands of its own may '
        'reach the drive'
    )


class ForeignSdo:
    """
    Finds the requests of another client to the nodes of this one.

    A node carries out the requests of all clients in order. So an answer that the other's request
    may have, too, is uncertain until the node has answered another, later request. A segment names
    no object, and any request that begins a transfer ends the one before: a transfer in segments
    is uncertain when any other request came meanwhile.
    """

    def __init__(self, remarks: Remarks) -> None:
        self._sightings = Sightings(remarks)
        #: The last request to each node, until it comes back: some adapters return what they sent.
        self._own: dict[int, bytes] = {}
        #: The nodes of which the beginning of the last transfer came back.
        self._returned: set[int] = set()
        self._disturbed: set[int] = set()
        self._meanwhile: set[Kind] = set()

    def sent(self, frame: Frame) -> None:
        """Note a request of ours; earlier requests are answered before it."""
        self._own[frame.identifier - sdo.REQUESTS] = frame.data
        self._meanwhile.clear()

    def begins(self, unit: int) -> None:
        """Note that a transfer of ours is about to begin."""
        self._returned.discard(unit)
        self._disturbed.discard(unit)

    def is_there(self, now: float) -> bool:
        """Return whether another client has sent anything recently."""
        return self._sightings.is_there(now)

    def disturbed(self, unit: int) -> bool:
        """Return whether a node got another request since our transfer began."""
        return unit in self._disturbed

    @property
    def meanwhile(self) -> frozenset[Kind]:
        """The kinds of answers to its requests since our last one."""
        return frozenset(self._meanwhile)

    def hear_frame(self, frame: Frame, now: float) -> frozenset[Kind]:
        """Take a frame; return the kinds of answers that another client may get to it."""
        unit = frame.identifier - sdo.REQUESTS
        if unit not in self._own:
            return frozenset()
        kinds = sdo.kinds_asked_for(frame.data)
        names_object = kinds.isdisjoint(sdo.SEGMENTS)
        if frame.data == self._own[unit] and (names_object or unit in self._returned):
            # or the other's is the same: its answer says what ours does
            self._own[unit] = b''
            self._returned.add(unit)
            return frozenset()
        self._sightings.add(now, _remark(unit))
        self._disturbed.add(unit)
        self._meanwhile |= kinds
        return kinds


_SPACE = 'object'
#: The longest text that is expected.
_TEXT = 64


def _number(data: bytes) -> str:
    return str(int.from_bytes(data, 'little'))


def _text(data: bytes) -> str:
    """Return a text as the drive has it; what cannot be printed is left out."""
    text = data.decode('ascii', errors='replace').partition('\0')[0]
    return ''.join(char for char in text if char.isascii() and char.isprintable()).strip()


#: The objects of the identity: index, sub-index, size, field, and how its bytes are decoded.
_QUESTIONS: tuple[tuple[int, int, int, str, Callable[[bytes], str]], ...] = (
    (0x1018, 1, 4, 'vendor', _number),
    (0x1018, 2, 4, 'product_code', _number),
    (0x1018, 4, 4, 'serial', _number),
    (0x1008, 0, _TEXT, 'product', _text),
    (0x100A, 0, _TEXT, 'revision', _text),
)


class _Ambiguous(DamagedAnswer):
    """An answer came that may belong to an earlier request, or to another client."""


def can_port_of(port: str, settings: LineSettings, trace: str = '') -> CanPort:
    """Return what carries frames on a port, as :meth:`CanopenLink.on_port` names it."""
    if _INTERFACE.fullmatch(port):
        identifiers = sdo.ANSWERS, sdo.REQUESTS, HEARTBEATS
        wanted = tuple((identifier, FUNCTION_CODE) for identifier in identifiers)
        can: CanPort = SocketCan(port, wanted)
        return TracedCan(can, Trace(trace)) if trace else can
    if _BY_LIBRARY.match(port):
        raise ValueError(
            f'port {port!r} names an adapter by the library of its maker: Linux has drivers for '
            'them that make CAN interfaces. ip -br link show type can lists these: write such as '
            'can0'
        )
    of_adapter = replace(settings, baud_rate=_ADAPTER_RATE, char_format='8N1')
    return LawicelPort(port_of(port, of_adapter, trace), settings.baud_rate)


class CanopenLink:
    """
    A client of the default SDO server of each node on one bus; one request at a time.

    An answer names node and object, and whether something was read or written; only segments do
    not name the object. So what could be taken for another is a late answer about the same
    object, or a segment: after a missing answer its kind is in quarantine (:class:`LateReplies`),
    and the object is only read when the node has answered about another one. A write is never kept
    waiting, for it may be a stop; but if an earlier one of the same object may still be answered,
    the answer is not believed: something is read, and :class:`DamagedAnswer` says that the outcome
    is unknown.

    CAN itself detects damaged frames, but a frame may be sent twice, the second time right behind
    the first. So what is the same as the answer before, and comes before the request can have been
    answered, is believed only if no other comes for as long as the node may take.

    What is promised: no value of another object or node is taken, no answer up to three time-outs
    late to an earlier request, no answer to another write. An answer that is sent twice just when
    the next one is lost is not distinguished.

    Another client may use the same nodes: an answer that may be to it is not believed, and a read
    is repeated (:class:`ForeignSdo`).

    How long a number is, and where the sub-indices of an array begin, is up to the node [C102];
    above this link a number has the length of the catalog (:class:`ObjectShapes`).

    A node is made operational before the first write to it, and again when it has restarted or was
    silent: reading changes nothing. From then on the client's heartbeat is sent, by the thread
    that sends requests: a node that watches it notices when that thread is gone
    (:class:`CanopenSupervision`).
    """

    #: Node ids and bit rates (CiA 301). No manual says with which the drive leaves the factory.
    protocol = CANOPEN
    _patience = math.inf

    def __init__(
        self, port: CanPort, settings: LineSettings, now: Clock = time.monotonic
    ) -> None:
        self.clock = self._now = ThreadClock(now)
        self.stop_waits: Callable[[], bool] = lambda: False
        self._port = port
        self._settings = settings
        self.remarks = Remarks()
        # frames have no gaps of this kind: each node takes them as they come
        self.pauses = Pauses(self.remarks.add, lambda: -math.inf)
        self.last_byte_at = -math.inf
        self._late: LateReplies[Transfer, Kind] = LateReplies(
            settings.response_timeout, lambda transfer: transfer.kinds
        )
        self._another = ForeignSdo(self.remarks)
        #: The nodes that were made operational.
        self._started: set[int] = set()
        self._shapes = ObjectShapes()
        self.supervision = CanopenSupervision(port, now, self._take)

    def wait_at_most(self, seconds: float) -> None:
        """Wait for the next answers so long at most, s, but as long as the unit has ever taken."""
        self._patience = seconds

    def end_listening_if(self, stop_waits: Callable[[], bool]) -> None:
        """Wait for no more than the answer to the request that was sent, where a stop waits."""
        self.stop_waits = stop_waits

    def answers_twice(self, unit: int) -> bool:
        """Return false: each SDO answer names what it answers."""
        return False

    @classmethod
    def on_port(cls, port: str, settings: LineSettings, trace: str = '') -> CanopenLink:
        """
        Return the link on a port.

        :param port: a CAN interface, such as ``can0``; or of a LAWICEL adapter the device path, or
            a URL of pyserial.
        :raises ValueError: it is none of them; the message says what to write.
        """
        return cls(can_port_of(port, settings, trace), settings)

    @property
    def place(self) -> str:
        """Where the port is."""
        return self._port.place

    def open(self) -> None:
        """Open the port."""
        self._port.open()
        if self._port.remark:
            self.remarks.add(self._port.remark)
        self.supervision.opened()

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""
        self._port.close()
        self._late.clear()
        self._started.clear()
        self._shapes.clear()
        self.supervision.closed()

    def use_resync_reads(self, unit: int, addresses: Sequence[Address], why: Why = None) -> None:
        """Take parameters that are safe to read; here those are read that every node has."""

    def read(self, unit: int, address: Address, once: bool = False) -> Reply:
        """Read one parameter; a number in as many bytes as the catalog has for it."""
        sub_index = self._shapes.sub_index(unit, address)
        if sub_index is None:
            second = self._read_second(unit, address)
            if second is not None and address.sub_index == SECOND:
                return self._fitted(unit, address, SECOND, second)
            return self.read(unit, address, once)
        reply = self._read_object(unit, address, sub_index, once)
        return self._fitted(unit, address, sub_index, reply)

    def _fitted(self, unit: int, address: Address, sub_index: int, reply: Reply) -> Reply:
        return reply._replace(data=self._shapes.fit_read(unit, address, sub_index, reply.data))

    def _read_second(self, unit: int, address: Address) -> Reply | None:
        """Find out how a node numbers an array; return the second value, if it was read."""
        reply, refusal = None, None
        try:
            reply = self._read_object(unit, address, SECOND)
        except Refused as error:
            refusal = error
        self._shapes.note_array(unit, address.index, refusal)
        return reply

    def _read_object(
        self, unit: int, address: Address, sub_index: int, once: bool = False
    ) -> Reply:
        for _ in range(0 if once else _TRIES - 1):
            try:
                return self._read_once(unit, address, sub_index)
            except DamagedAnswer:
                if not self._another.is_there(self._now()) or self.stop_waits():
                    raise
        return self._read_once(unit, address, sub_index)

    def _read_once(self, unit: int, address: Address, sub_index: int) -> Reply:
        upload = Upload(unit, address.index, sub_index)
        kinds = upload.kinds[:1] + (sdo.SEGMENTS if address.size > _EXPEDITED else ())
        questions = ((upload, kinds), *self._resync_reads(unit))
        certain = self._late.first_certain(unit, questions, self._now())
        if certain is not upload:
            self._resync_read(certain)
            if self.stop_waits():
                raise InProgress(self._now())
        try:
            arrived = self._transact(upload)
        except LinkError as error:
            error.responded = certain is not upload
            raise
        return Reply(upload.value, arrived)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """Write one parameter; a number in as many bytes as the node has for it."""
        sub_index = self._shapes.sub_index(unit, address)
        if sub_index is None:
            self._read_second(unit, address)
            return self.write(unit, address, data)

        def send(fitted: bytes) -> float:
            return self._write_object(Download(unit, address.index, sub_index, fitted))

        return Reply(b'', self._shapes.write(unit, address, sub_index, data, send))

    def _write_object(self, download: Download) -> float:
        unit = download.unit
        self._drain()
        if unit not in self._started:
            self._port.send(start(unit))
            self._started.add(unit)
        self.supervision.note_request(unit, writes=True)
        try:
            return self._transact(download)
        except _Ambiguous:
            # not after mere silence: a repeated stop would only have to wait for it
            self._settle(unit)
            raise

    def write_and_read(
        self, unit: int, address: Address, data: bytes, source: Address
    ) -> Reply:
        """Write one parameter, then read another; in as many transfers as that takes."""
        self.write(unit, address, data)
        return self.read(unit, source)

    def read_then_write(
        self, unit: int, source: Address, address: Address, data: bytes
    ) -> Reply:
        """
        Read a parameter whose value is not needed, then write another; nothing is sent between.

        :raises LinkError: as for a write; :attr:`LinkError.maybe_done` once the read was sent.
        """
        sub_index = self._shapes.sub_index(unit, source)
        if sub_index is None:
            self._read_second(unit, source)
            return self.read_then_write(unit, source, address, data)
        with contextlib.suppress(NoAnswer, DamagedAnswer, Refused):
            self._transact(Upload(unit, source.index, sub_index))
        try:
            return self.write(unit, address, data)
        except LinkError as error:
            error.maybe_done = True
            raise

    def identify(self, unit: int) -> Plan[Identification]:
        """Have a node identify itself; what it does not give stays empty."""
        found: dict[str, str] = {}
        for index, sub_index, size, field, value_of in _QUESTIONS:
            reply = yield Read(Address(_SPACE, index, sub_index, size))
            if reply is not None:
                found[field] = value_of(reply.data)
        return Identification(**found)

    # --- belief -----------------------------------------------------------------------------------

    def _resync_reads(self, unit: int) -> Iterator[tuple[Upload, Sequence[Kind]]]:
        for index, sub_index in _EVERYWHERE:
            upload = Upload(unit, index, sub_index)
            yield upload, upload.kinds

    def _resync_read(self, upload: Upload) -> None:
        """Have the node answer; whatever it says, late answers have come before it."""
        try:
            self._transact(upload)
        except Refused:
            return
        except LinkError as error:
            # the request that it prepares has not been sent
            error.maybe_done = False
            raise

    def _settle(self, unit: int) -> None:
        """Try to read something, so that the next answer is believed again."""
        if self.stop_waits():
            return
        try:
            questions = self._resync_reads(unit)
            self._resync_read(self._late.first_certain(unit, questions, self._now()))
        except PortError:
            raise
        except LinkError:
            return

    # --- one transfer -----------------------------------------------------------------------------

    def _transact(self, transfer: Transfer) -> float:
        """Carry out a transfer; return when its last answer came."""
        unit = transfer.unit
        self._drain()
        self.supervision.note_request(unit, writes=False)
        self._another.begins(unit)
        arrived = 0.0
        while transfer.request is not None:
            self._late.sent(transfer)
            sent = self._now()
            self.supervision.send_due(sent)
            self._send(unit, transfer.request)
            try:
                arrived = self._receive(transfer, sent)
            except Refused:
                self._release(unit)
                raise
            except (NoAnswer, DamagedAnswer) as error:
                self._late.expect(transfer, self._now())
                if isinstance(error, NoAnswer):
                    # another master may have stopped the node, which answers nothing then
                    self._started.discard(unit)
                if transfer.has_begun:
                    self._send(unit, transfer.abort())
                raise
            self._release(unit)
        return arrived

    def _send(self, unit: int, message: bytes) -> None:
        frame = Frame(sdo.REQUESTS + unit, message)
        self._another.sent(frame)
        self._port.send(frame)

    def _release(self, unit: int) -> None:
        """Expect no more answers of a node to requests before the one that it has answered."""
        self._late.release(unit)
        self._late.quarantine(unit, self._another.meanwhile, self._now())

    def _drain(self) -> None:
        """Take what came unrequested: a late answer, one to another client, a boot-up."""
        until = self._now() + LONGEST_DRAIN
        while self._take(0.0) and self._now() < until:
            continue

    def _take(self, until: float) -> Sequence[Frame]:
        """Return what has come, as the port does; note which nodes have restarted."""
        frames = self._port.receive(self._now.until(until))
        self._note(frames)
        return frames

    def _note(self, frames: Sequence[Frame]) -> AbstractSet[int]:
        """Note the requests of others; return which nodes have restarted."""
        now = self._now()
        if frames:
            self.last_byte_at = now
        for frame in frames:
            kinds = self._another.hear_frame(frame, now)
            if kinds:
                self._late.quarantine(frame.identifier - sdo.REQUESTS, kinds, now)
        restarted = self.supervision.take_frames(frames)
        self._started -= restarted
        return restarted

    def _receive(self, transfer: Transfer, sent: float) -> float:
        """Take the answer to the present request, sent just now; return when it came."""
        unit = transfer.unit
        most = max(self._patience, self._late.longest_ever(unit))
        deadline = sent + min(self._settings.response_timeout, most)
        other = 0
        while True:
            until = min(deadline, self.supervision.sign_due)
            frames = self._port.receive(self._now.until(until))
            now = self._now()
            self.supervision.send_due(now)
            if unit in self._note(frames):
                raise NoAnswer(f'unit {unit} has restarted')
            for frame in frames:
                if frame.identifier != sdo.ANSWERS + unit:
                    continue
                found = sdo.kind(frame.data)
                if found is not None and found in transfer.kinds:
                    self._require_certain(transfer, found, now)
                    self._require_one(transfer, frame, sent, now)
                    if transfer.take_message(frame.data):
                        return now
                other += 1
            if now >= deadline:
                break
        if other:
            raise DamagedAnswer(f'unit {unit}: {other} answers came, but none to this request')
        hint = self._port.trouble
        silent = NoAnswer(f'unit {unit} did not answer{": " if hint else ""}{hint}')
        silent.hint = hint
        raise silent

    def _require_certain(self, transfer: Transfer, found: Kind, now: float) -> None:
        """
        Make sure that an answer is not to an earlier request, nor to another client.

        :raises DamagedAnswer: it may be.
        """
        unit = transfer.unit
        if sdo.is_among(found, self._late.quarantined(unit, now)) or (
            transfer.has_begun and self._another.disturbed(unit)
        ):
            raise _Ambiguous(
                f'unit {unit} answered, but perhaps to an earlier request or to another client'
            )

    def _require_one(self, transfer: Transfer, answer: Frame, sent: float, now: float) -> None:
        """
        Make sure that an answer is not the one before, sent twice.

        :raises DamagedAnswer: another one came.
        """
        unit = transfer.unit
        # a request and its answer
        soonest = 2 * _FRAME_BITS / self._settings.baud_rate
        self._late.note_reply(transfer, answer.data, now, 0.0)
        if self._late.repeated is not None and now < sent + soonest:
            until = sent + max(soonest, self._late.longest(unit))
            while (later := self._now()) < until:
                if self.stop_waits():
                    raise DamagedAnswer(f'unit {unit}: {STOP_WAITS}')
                self.supervision.send_due(later)
                came = self._take(min(until, later + LISTENING_STEP))
                if any(frame.identifier == answer.identifier for frame in came):
                    raise DamagedAnswer(f'unit {unit}: an answer came twice')
        if self._now.resumed_at <= sent:
            self._late.took(unit, now - sent)
