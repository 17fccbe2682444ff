# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``check``."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
import contextlib
import math
import os
from pathlib import Path
import sys

from nfo_sinus_driver.catalog import Family, load_family
from nfo_sinus_driver.cli.check import report
from nfo_sinus_driver.cli.check.readings import Reading, Seen, look, table, turned
from nfo_sinus_driver.cli.check.sight import (
    BlockSight,
    CanopenSight,
    ClassicSight,
    ModbusSight,
    MovitracSight,
    Register,
    Sight,
)
from nfo_sinus_driver.cli.check.turn import Moment, agreed, turn
from nfo_sinus_driver.cli.check.verdict import Verdict
from nfo_sinus_driver.cli.check.wire import (
    FIRST,
    CanWire,
    ClassicWire,
    MovitracWire,
    SerialWire,
    TcpWire,
    Wire,
)
from nfo_sinus_driver.cli.console import (
    CliError,
    OutputLost,
    UsageError,
    as_json,
    can_ask,
    progress,
    put,
    remark,
)
from nfo_sinus_driver.cli.options import Verb, add_flag
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive.known.settings import TELEGRAM_WORDS
from nfo_sinus_driver.link import PROTOCOLS, BusSettings, PortError
from nfo_sinus_driver.link.canopen.link import can_port_of
from nfo_sinus_driver.link.modbus.tcp import host_and_port
from nfo_sinus_driver.link.ports.port import port_of
from nfo_sinus_driver.link.ports.tcp_connection import Connection, TcpConnection, TracedConnection
from nfo_sinus_driver.link.ports.trace import Trace

#: The silence before a request, until it is known how short it may be, s.
_GAP = 0.02
#: What looks at a drive by each protocol.
_SIGHTS: Mapping[str, type[Sight]] = {
    **dict.fromkeys(('modbus_rtu', 'modbus_ascii', 'modbus_tcp'), ModbusSight),
    'classic': ClassicSight,
    'movitrac': MovitracSight,
    'canopen': CanopenSight,
}
#: So near are two values that are the same.
_SAME = 0.02
#: Functions that drives may have or not, each as a request that changes nothing.
_FUNCTIONS = {
    4: '04 02A5 0001', 8: '08 0000 A537', 17: '11', 43: '2B 0E 01 00',
}
_NONE_ANSWERS = 2


class Check(Verb):
    """
    Ask a drive what it shows of the readings of its manual; without --turn nothing is written.

    The exit status is 0 if it contradicts none, 1 if it does or the motor did not do what it
    should, and 2 if nothing answers.
    """

    failed = _NONE_ANSWERS

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument(
            '--report', metavar='FILE', type=Path,
            help='write a JSON file, to be sent: it has no name, path or serial number',
        )
        add_flag(parser, '--no-questions', 'ask nothing about what the keypad shows')
        add_flag(
            parser, '--turn', 'then turn the motor, at 5 Hz at most, with a person beside it'
        )

    def main(self, options: argparse.Namespace) -> int:
        """Ask, and report."""
        if options.report is not None and options.report.exists():
            raise UsageError(f'{options.report} exists: name another file')
        if options.report is not None and not os.access(options.report.parent, os.W_OK):
            raise UsageError(f'{options.report.parent} is no folder that can be written to')
        try:
            settings = BusSettings(
                options.port, options.protocol, options.baud_rate, options.char_format
            )
        except ValueError as error:
            raise UsageError(str(error)) from None
        if options.turn and not can_ask():
            raise UsageError('--turn needs a terminal: Enter stops the motor')
        model, protocol = load_family(options.model), options.protocol
        telegram = _telegram(options)
        if options.turn and telegram:
            raise UsageError(
                '--turn turns no motor behind a PLC: the PLC commands the drive, and stops it when '
                'this computer is gone; turn it by the program of the PLC'
            )
        _require_standstill(options)
        if telegram:
            model = load_family(options.model, telegram, options.telegram_words)
            protocol = f'{telegram}_{options.telegram_words or TELEGRAM_WORDS[0]}'
        try:
            with _wire(settings, options) as (wire, set_gap):
                sight = (
                    BlockSight(wire, model, options.block_address) if telegram
                    else _SIGHTS[options.protocol](wire, model)
                )
                if not sight.parameters:
                    raise UsageError(f'no registers of a {model.name} are known by this protocol')
                timing = sight.timing(set_gap)
                with progress('reading the registers', len(sight.parameters)) as step:
                    registers = list(sight.registers(step))
                if not any(one.words or one.refused_with for one in registers):
                    raise CliError('the drive does not answer any more')
                functions = _functions(sight) if type(sight) is ModbusSight else ''
                seen = list(look(sight, protocol))
        except (PortError, OSError) as error:
            raise CliError(str(error)) from error
        asks = can_ask() and not options.no_questions and not options.json
        seen += _questions(model, registers, protocol, asks=asks)
        moments, status = _turn(options, model, protocol) if options.turn else ([], 0)
        seen += turned(moments, model.name, protocol)
        facts = {
            # a file of one's own may be named after its owner
            'model': model.name if '/' not in options.family else 'described by a file',
            'protocol': protocol, 'functions': functions,
            'baud_rate': settings.line.baud_rate, 'char_format': settings.line.char_format,
        }
        document = report.document(sight, facts, seen, registers, timing, moments)
        try:
            if options.json:
                put(as_json(document, indent=1))
            else:
                for line in report.screen(seen, registers, timing, functions, moments):
                    put(line)
        except OutputLost:
            # the terminal is gone, which may have ended the turning
            if not status:
                raise
        finally:
            if options.report is not None:
                _write(options.report, as_json(document, indent=1) + '\n')
        return status or int(any(one.verdict is Verdict.CONTRADICTED for one in seen))


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding='utf-8')
    except OSError as error:
        raise CliError(f'{path}: {error.strerror}') from error


def _telegram(options: argparse.Namespace) -> str:
    """Return the control method by which a PLC reaches the drive; nothing: there is none."""
    settings = DriveSettings(
        model=options.model, family=options.family, control_method=options.control_method
    )
    through_plc = settings.goes_through_plc(PROTOCOLS[options.protocol])
    return settings.method if through_plc else ''


def _turn(
    options: argparse.Namespace, model: Family, protocol: str
) -> tuple[list[Moment], int]:
    """Turn the motor, if the operator has typed the word for it."""
    if not agreed(model, options.protocol):
        remark('nothing was turned')
        return [], 0
    rows = [one for one in table() if one.part == 'turn']
    return turn(
        options, model, [one.shows for one in rows if one.fits(model.name, protocol)]
    )


def _require_standstill(options: argparse.Namespace) -> None:
    """
    Make sure that nothing asked for here stops a motor.

    What a drive does not know, or a wrong sum, may be a serial fault while the bus has control, and
    that stops the motor [C99].
    """
    with Session(options) as session:
        status = session.drive().read_status()
    if status.driven and status.from_bus:
        raise CliError(
            'the motor runs by the bus: a request that the drive does not know may be a fault '
            'then, which stops it. Stop it first (nfo-sinus stop)'
        )


@contextlib.contextmanager
def _wire(
    settings: BusSettings, options: argparse.Namespace
) -> Iterator[tuple[Wire, Callable[[float], None] | None]]:
    """Open the line; yield the drive on it, and what sets the silence before a request."""
    first = max(FIRST, options.response_timeout)
    if options.protocol == 'modbus_tcp':
        try:
            connection: Connection = TcpConnection(*host_and_port(options.port))
        except ValueError as error:
            raise UsageError(str(error)) from None
        if options.trace:
            connection = TracedConnection(connection, Trace(options.trace))
        with contextlib.closing(connection):
            yield TcpWire(connection, options.address, first), None
        return
    if options.protocol == 'canopen':
        can = can_port_of(options.port, settings.line, options.trace)
        can.open()
        try:
            yield CanWire(can, options.address, first), None
        finally:
            can.close()
        return
    try:
        port = port_of(options.port, settings.line, options.trace)
    except ValueError as error:
        raise UsageError(str(error)) from None
    port.open()
    try:
        gap = max(_GAP, load_family(options.model).profile.gap)
        wire: SerialWire | ClassicWire | MovitracWire
        if options.protocol == 'classic':
            wire = ClassicWire(port, options.address, gap, first)
        elif options.protocol == 'movitrac':
            wire = MovitracWire(port, options.address, gap, first)
        else:
            ascii_frames = options.protocol == 'modbus_ascii'
            wire = SerialWire(port, options.address, gap, first, ascii_frames=ascii_frames)
        yield wire, lambda gap: setattr(wire, 'gap', gap)
    finally:
        port.close()


def _functions(sight: Sight) -> str:
    found = []
    for number, request in _FUNCTIONS.items():
        answer = sight.ask(bytes.fromhex(request))
        came = 'no answer' if not answer.pdu else 'yes'
        if answer.refused_with is not None:
            came = f'refused with {answer.refused_with}'
        found.append(f'{number:02} {came}')
    return ', '.join(found)


def _questions(
    model: Family, registers: list[Register], protocol: str, *, asks: bool
) -> Iterator[Seen]:
    """Ask what the keypad shows; an empty answer leaves a question out."""
    for reading in table():
        if reading.part != 'eyes' or not reading.fits(model.name, protocol):
            continue
        key = reading.shows
        found = next((one for one in registers if one.key == key and one.value), None)
        if found is None:
            yield Seen(reading, Verdict.NOT_SEEN, f'{key} was not answered')
        elif not any(found.words or ()):
            yield Seen(reading, Verdict.NOT_SEEN, f'{key} is 0, by whatever factor')
        elif not asks:
            yield Seen(reading, Verdict.NOT_SEEN, 'nothing was asked')
        else:
            yield _asked(reading, model[key].name, model[key].unit, found)


def _asked(reading: Reading, name: str, unit: str, found: Register) -> Seen:
    words = ' '.join(f'{word:04X}h' for word in found.words or ())
    while True:
        sys.stderr.write(
            f'{name} reads {found.value} ({words}). What does the keypad show, in {unit}? '
            '(Enter: leave it out) '
        )
        sys.stderr.flush()
        given = sys.stdin.readline().strip().replace(',', '.')
        if not given:
            return Seen(reading, Verdict.NOT_SEEN, 'it was left out')
        try:
            shown = float(given)
        except ValueError:
            remark(f'{given} is no number')
            continue
        value = float(found.value.split()[0])
        # the keypad may show fewer digits
        last = 10 ** -len(given.partition('.')[2])
        same = math.isclose(shown, value, rel_tol=_SAME, abs_tol=last)
        verdict = Verdict.CONFIRMED if same else Verdict.CONTRADICTED
        return Seen(reading, verdict, f'{name}: {words} = {found.value}; the keypad shows {given}')
