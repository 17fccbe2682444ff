# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The tables of the drives and the simulator's own receivers under fuzz, each with its judge."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
import math
from random import Random
import struct

from support.addresses import packed

from fuzz import judges
from fuzz.decoders import Case, classic_frame
from fuzz.mutations import Mutator
from nfo_sinus_driver.catalog import State, families, load_family
from nfo_sinus_driver.families import USUAL
from nfo_sinus_driver.families.sinus_g2 import words
from nfo_sinus_driver.families.sinus_optimal import words as words_optimal
from nfo_sinus_driver.simulator.classic import Classic
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Receiver
from nfo_sinus_driver.simulator.modbus_frames import ModbusAscii, ModbusRtu, ModbusTcp
from nfo_sinus_driver.simulator.movitrac import Movitrac
from nfo_sinus_driver.simulator.protocol import Protocol

#: Most bytes that a receiver keeps without a word that something is due.
_MOST_KEPT = 600
_UNIT = 1
#: The silence that ends a frame, and a longer one, s.
_SILENCE, _OVER = 0.01, 0.011

_PARAMETERS = [
    (parameter, protocol)
    for model in map(load_family, families())
    for parameter in model.values()
    for protocol in ('modbus', 'classic')
    if protocol in parameter.addresses
]
#: How many bits of two words count [C24], [C26].
_LOW_BITS = {
    ('status.op_time', 'classic'): 24,
    ('status.rn_time', 'classic'): 24,
    ('status.br_time', 'classic'): 24,
    ('fieldbus.drive_status', 'modbus'): 16,
}


# --- catalog --------------------------------------------------------------------------------------


def _catalog(random: Random, frames: int) -> None:
    """Judge what raw words become, those of a damaged answer included."""
    for _ in range(frames):
        parameter, protocol = random.choice(_PARAMETERS)
        place = parameter.addresses[protocol]
        whole = place.codec.size // 2
        count = whole if random.random() < 0.9 else random.choice((0, 1, 2, 3))
        raw = [
            random.choice((0, 1, 0x7FFF, 0x8000, 0xFFFF, random.getrandbits(16)))
            for _ in range(count)
        ]
        try:
            value = parameter.decode(packed(*raw), protocol)
        except ValueError:
            assert count != whole or parameter.kind in (bool, int), 'it has a value'
            continue
        assert count == whole, f'{value!r} from {count} words'
        form = {(1, False): '<H', (1, True): '<h', (2, False): '<I', (2, True): '<i'}
        data = struct.pack(f'<{count}H', *raw)
        number = struct.unpack(form[count, place.number.signed], data)[0]
        if (bits := _LOW_BITS.get((parameter.key, protocol))) is not None:
            number &= (1 << bits) - 1
        assert type(value) is parameter.kind, f'{parameter.key}: {value!r}'
        if parameter.labels:
            label = parameter.labels.get(number, str(number))
            shown = {True: 'ON', False: 'OFF'}[value] if parameter.kind is bool else str(value)
            assert shown == label, f'{parameter.key}: {value!r} instead of {label!r}'
        else:
            assert math.isclose(value, Fraction(number) * place.factor, rel_tol=1e-12)
        word = random.getrandbits(16)
        assert words.state_of(word) in State
        assert words_optimal.state_of(word) in State


# --- the simulator's receivers --------------------------------------------------------------------


def _modbus_request(random: Random) -> bytes:
    """Return unit, function and data of a request to a drive."""
    unit = random.choice((_UNIT, _UNIT, 2, 0))
    function = random.choice((3, 3, 4, 6, 16, 17, 23, 43, random.getrandbits(8)))
    register = random.choice((0x0002, 0x000E, 0x0028, 0x00E8, 0xC000, random.getrandbits(16)))
    head = bytes((unit, function))
    if function in (3, 4):
        return head + struct.pack('>HH', register, random.choice((1, 2, 4, 125)))
    if function == 6:
        return head + struct.pack('>HH', register, random.choice((0, 1, 3, 0x101)))
    if function == 16:
        return head + struct.pack('>HHBHH', register, 2, 4, random.getrandbits(16), 0)
    if function == 23:
        return head + struct.pack('>HHHHBH', register, 1, register, 1, 2, random.getrandbits(16))
    if function == 43:
        return head + bytes((14, random.choice((1, 2, 4)), random.getrandbits(3)))
    return head


def _tcp_body(frame: bytes) -> tuple[int, bytes] | None:
    frames, out_of_step = judges.tcp_frames(frame)
    if out_of_step or len(frames) != 1 or len(frame) != 6 + len(frames[0][1]):
        return None
    message = frames[0][1]
    return message[0], message[1:]


def _modbus_body(message: bytes | None) -> tuple[int, bytes] | None:
    return None if message is None or len(message) < 2 else (message[0], message[1:])


def _ascii_body(frame: bytes) -> tuple[int, bytes] | None:
    # a drive knows digits in upper case only
    return _modbus_body(judges.ascii_message(frame)) if frame == frame.upper() else None


#: Where the prefix of a Classic request stands.
_PREFIX = {'enquiry': 2, 'select': 3}


def _classic_request(random: Random) -> bytes:
    """Return an ENQUIRY or a SELECT without its check sum."""
    while True:
        frame = classic_frame(random)
        if frame[0] == 0x04:
            return frame


def _classic_body(frame: bytes) -> tuple[int, bytes] | None:
    """Return a Classic message that is right; what is wrong with others the drive itself says."""
    for message in judges.classic_messages(frame):
        is_request = message.kind in _PREFIX and (message.begin, message.end) == (0, len(frame))
        # a drive knows the prefix in upper case only
        if is_request and frame[_PREFIX[message.kind]] == ord('E'):
            return message.unit, frame
    return None


#: The value that each kind of request carries to a MOVITRAC, by its start delimiter [M4 §2.1.1].
_MOVITRAC_VALUES = {0xB5: 0, 0xA9: 4, 0xAD: 8}


def _movitrac_request(random: Random) -> bytes:
    """Return an ENQUIRY, a SELECT or a LONG_SELECT without its sum."""
    start, size = random.choice(sorted(_MOVITRAC_VALUES.items()))
    index = random.choice((0, 4, 25, 203, 205, 223, 281, 284, 1001, random.getrandbits(16)))
    digits = bytes(random.choice((0, 0, 1, 2, 0x25, random.getrandbits(8))) for _ in range(size))
    return struct.pack('>BBH', start, random.choice((_UNIT, 0, 63)), index) + digits


def _movitrac_body(frame: bytes) -> tuple[int, bytes] | None:
    size = _MOVITRAC_VALUES.get(frame[0])
    whole = size is not None and len(frame) == 5 + size
    return (frame[1], frame) if whole and frame == judges.seal_movitrac(frame[:-1]) else None


def _seal_tcp(message: bytes) -> bytes:
    return judges.seal_tcp(0x1234, message)


def _receiving(
    make: Callable[[], Protocol],
    request: Callable[[Random], bytes],
    seal: Callable[[bytes], bytes],
    body: Callable[[bytes], tuple[int, bytes] | None],
    model: str = USUAL,
) -> Case:
    """Return the case of a simulated drive that receives: it takes what is whole, and lives on."""

    def case(random: Random, frames: int) -> None:
        mutator = Mutator(random)
        protocol = make()
        drive = simulated_drive(model)
        receiver = Receiver(protocol, 0.0, _SILENCE)
        now = 0.0

        def take(data: bytes) -> list[bytes]:
            taken = []
            for arrived in receiver.feed(data, now):
                taken.append(arrived.data)
                got = protocol.unwrap(arrived.data)
                right = body(arrived.data)
                if got is not None and got.whole:
                    assert (got.address, got.body) == right, f'{got} instead of {right}'
                else:
                    assert right is None, f'{arrived.data!r} was not taken'
                if got is not None:
                    drive.advance_to(now)
                    protocol.answer(drive, got)
            return taken

        while frames > 0:
            others = [seal(request(random)), seal(request(random))]
            count = 1 + int(random.random() * min(6, frames))
            frames -= count
            stream = b''.join(
                mutator.rubbish()
                if random.random() < 0.1
                else mutator.frame(request(random), others, seal)
                for _ in range(count)
            )
            came, fed = b'', 0
            for piece in mutator.pieces(stream):
                now += random.choice((0.0, 0.001, _OVER))
                fed += len(piece)
                came += b''.join(take(piece))
                assert fed - len(came) <= _MOST_KEPT, 'the receiver keeps more than a frame'
            now += _OVER
            came += b''.join(take(b''))
            assert came == stream, 'bytes were lost, doubled or kept'
            intact = seal(request(random))
            alone = take(intact)
            now += _OVER
            alone += take(b'')
            assert alone == [intact], f'{alone} behind a silence'

    return case


#: What else turns bytes into meaning.
OTHER_CASES: Mapping[str, Case] = {
    'catalog': _catalog,
    'simulator rtu': _receiving(
        ModbusRtu,
        _modbus_request,
        judges.seal_rtu,
        lambda frame: _modbus_body(judges.rtu_message(frame)),
    ),
    'simulator ascii': _receiving(
        ModbusAscii,
        _modbus_request,
        judges.seal_ascii,
        _ascii_body,
    ),
    'simulator tcp': _receiving(
        lambda: ModbusTcp(0.1), _modbus_request, _seal_tcp, _tcp_body
    ),
    'simulator classic': _receiving(Classic, _classic_request, judges.seal_classic, _classic_body),
    'simulator movitrac': _receiving(
        Movitrac, _movitrac_request, judges.seal_movitrac, _movitrac_body, 'movitrac31'
    ),
}
