# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A trace of the line has what went over it, as the far end has it; it harms nothing."""

from __future__ import annotations

import json
import logging
from pathlib import Path
import threading
import time
from typing import Any

import pytest

from nfo_sinus_driver.bus import Bus, Priority
from nfo_sinus_driver.link import Address, BusSettings, Read
from nfo_sinus_driver.link.canopen.can import Frame, TracedCan
from nfo_sinus_driver.link.ports.port import TracedPort, port_of
from nfo_sinus_driver.link.ports.trace import Trace
from nfo_sinus_driver.simulator.simulator import Simulator

_PLACES = {
    'modbus_rtu': ('sinus_g2', Address('modbus', 0x2B0, None, 2, False)),
    'modbus_ascii': ('sinus_g2', Address('modbus', 0x2B0, None, 2, False)),
    'modbus_tcp': ('sinus_g2', Address('modbus', 0x2B0, None, 2, False)),
    'movitrac': ('movitrac31', Address('movitrac', 271, None, 4, False)),
}


def written(trace: Trace, path: Path) -> list[dict[str, Any]]:
    trace.wait_written(10.0)
    return frames(path)


def frames(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.mark.parametrize('protocol', _PLACES)
def test_the_trace_is_that_of_the_far_end(protocol: str, tmp_path: Path) -> None:
    model, address = _PLACES[protocol]
    ours, theirs = tmp_path / 'ours', tmp_path / 'theirs'
    with Simulator(model=model, protocol=protocol, trace=str(theirs)) as simulator:
        settings = BusSettings(simulator.port, protocol, response_timeout=5.0, trace=str(ours))
        bus = Bus(settings.open())
        bus.start()
        try:

            async def read() -> None:
                for _ in range(3):
                    await bus.ask(1, Read(address), Priority.SERVICE)

            bus.run(read()).result(20.0)
        finally:
            bus.close(5.0)
    deadline = time.monotonic() + 10.0
    while len(frames(ours)) < len(frames(theirs)):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    shown = [(frame['direction'], frame['hex']) for frame in frames(ours)]
    assert len(shown) >= 6
    assert shown == [(frame['direction'], frame['hex']) for frame in frames(theirs)]
    assert set(frames(ours)[0]) == set(frames(theirs)[0])
    for mine, far in zip(frames(ours), frames(theirs), strict=True):
        # one clock in both processes
        assert abs(mine['last'] - far['last']) < 5.0
        assert mine['first'] <= mine['last']


def test_what_comes_in_pieces_is_one_answer_and_its_silence_is_kept(tmp_path: Path) -> None:
    now = 10.0
    trace = Trace(str(tmp_path / 'trace'), now=lambda: now)
    trace.sent(b'\x01')
    now = 10.5
    trace.came(b'')
    trace.came(b'\x02')
    now = 10.6
    trace.came(b'\x03')
    trace.sent(b'\x04')
    asked, answered, again = written(trace, tmp_path / 'trace')
    assert (asked['hex'], answered['hex'], again['hex']) == ('01', '0203', '04')
    assert (answered['first'], answered['last'], answered['gap']) == (10.5, 10.6, 0.5)
    assert asked['gap'] is None and again['gap'] == 0.0


def test_it_never_grows_beyond_its_bound_and_keeps_the_newest(tmp_path: Path) -> None:
    path, most = tmp_path / 'trace', 4000
    trace = Trace(str(path), most)
    for number in range(500):
        trace.sent(number.to_bytes(2, 'big'))
        trace.wait_written(10.0)
        older = tmp_path / 'trace.1'
        length = path.stat().st_size + (older.stat().st_size if older.exists() else 0)
        assert length <= most
    numbers = [int(frame['hex'], 16) for half in (older, path) for frame in frames(half)]
    assert numbers == list(range(numbers[0], 500)) and len(numbers) > 10


def test_noise_that_does_not_end_is_written_all_the_same(tmp_path: Path) -> None:
    trace = Trace(str(tmp_path / 'trace'))
    for _ in range(100):
        trace.came(bytes(100))
    assert len(written(trace, tmp_path / 'trace')) == 2


def test_a_file_that_cannot_be_written_is_said_before_the_port_is_opened(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r'trace .*/no/trace: No such file'):
        BusSettings('/dev/null', trace=str(tmp_path / 'no' / 'trace')).open()
    # and a wrong port leaves no file behind
    with pytest.raises(ValueError, match='socket://'):
        BusSettings('host:502', trace=str(tmp_path / 'trace')).open()
    assert not (tmp_path / 'trace').exists()


def test_a_full_disk_ends_the_trace_and_nothing_else(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    class Port:
        place = ''
        written = b''

        def open(self) -> None: ...
        def close(self) -> None: ...

        def write(self, data: bytes) -> None:
            self.written += data

        def read(self, until: float) -> bytes:
            return b'\x05'

    port = Port()
    trace = Trace('/dev/full')
    traced = TracedPort(port, trace)
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            traced.write(b'\x01')
            assert traced.read(0.0) == b'\x05'
        traced.close()
        trace.wait_written(10.0)
    assert port.written == b'\x01\x01\x01'
    assert [record.getMessage() for record in caplog.records] == [
        'the trace /dev/full ends: No space left on device'
    ]


def test_no_request_waits_for_a_disk_and_what_is_left_out_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    goes_on = threading.Event()
    write = Trace._write

    def slow(trace: Trace, frame: Any) -> None:
        goes_on.wait(30.0)
        write(trace, frame)

    monkeypatch.setattr(Trace, '_write', slow)
    monkeypatch.setattr('nfo_sinus_driver.link.ports.trace._MOST_WAITING', 5)
    trace = Trace(str(tmp_path / 'trace'))
    began = time.monotonic()
    for number in range(50):
        trace.sent(bytes((number,)))
    assert time.monotonic() - began < 10.0
    goes_on.set()
    trace.wait_written(10.0)
    trace.sent(b'\xff')
    noted = written(trace, tmp_path / 'trace')
    assert len(noted) < 10
    assert noted[-1]['hex'] == 'ff' and noted[-1]['note'] == 'frames before it are left out'


def test_frames_of_a_can_bus_are_traced_each_by_itself(tmp_path: Path) -> None:
    class Bus:
        place, trouble, remark = 'can0', 'trouble', 'remark'
        sent: list[Frame] = []  # noqa: RUF012

        def open(self) -> None: ...
        def close(self) -> None: ...

        def send(self, frame: Frame) -> None:
            self.sent.append(frame)

        def receive(self, until: float) -> list[Frame]:
            return [Frame(0x581, b'\x01'), Frame(0x701, b'\x05')]

    trace = Trace(str(tmp_path / 'trace'))
    traced = TracedCan(Bus(), trace)
    traced.open()
    traced.send(Frame(0x601, b'\x40'))
    assert Bus.sent == [Frame(0x601, b'\x40')]
    assert traced.receive(0.0) == Bus().receive(0.0)
    assert (traced.place, traced.trouble, traced.remark) == ('can0', 'trouble', 'remark')
    shown = written(trace, tmp_path / 'trace')
    assert [frame['hex'] for frame in shown] == ['060140', '058101', '070105']
    traced.close()


def test_without_it_the_port_is_the_port() -> None:
    assert not isinstance(port_of('/dev/null', BusSettings().line), TracedPort)
