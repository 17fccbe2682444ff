# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a node says of its objects: how long a number is, and where an array begins [C102]."""

from __future__ import annotations

from canopen_bench import UNIT, Bench
from canopen_far_end import NO_OBJECT, WRONG_LENGTH, Server
from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.link import Address, DamagedAnswer, Refused
from nfo_sinus_driver.link.canopen import sdo

MODE = 0x2022
INV_ST = 0x2026
WITH_ACK = Address('object', INV_ST, 1, 2, False)
WITHOUT_ACK = Address('object', INV_ST, 2, 2, False)


def number(index: int, size: int, *, signed: bool) -> Address:
    return Address('object', index, None, size, signed)


class Strict(Server):
    """A node that takes a value of its own length alone."""

    abort = WRONG_LENGTH

    def _store(self, value: bytes) -> bytes:
        place = int.from_bytes(self._name[:2], 'little'), self._name[2]
        has = len(self.objects[place])
        if len(value) == has:
            return super()._store(value)
        codes = {'longer': sdo.TOO_LONG, 'shorter': sdo.TOO_SHORT}
        code = codes['longer' if len(value) > has else 'shorter']
        return self._abort(WRONG_LENGTH if self.abort == WRONG_LENGTH else code)


def bench_with(objects: dict[tuple[int, int], bytes], server: type[Server] = Server) -> Bench:
    bench = Bench()
    bench.bus.servers[UNIT] = server(dict(objects))
    bench.bus.value = (  # type: ignore[method-assign]
        lambda index, number: objects[index, 0]
    )
    return bench


def numbers(size: int, *, signed: bool) -> st.SearchStrategy[int]:
    span = 1 << 8 * size
    low = -span // 2 if signed else 0
    return st.integers(low, low + span - 1)


@given(st.data(), st.sampled_from([1, 2, 4]), st.sampled_from([1, 2, 4, 8]), st.booleans())
def test_a_number_is_the_same_however_long_the_node_has_it(
    data: st.DataObject, size: int, length: int, signed: bool
) -> None:
    value = data.draw(numbers(min(size, length), signed=signed))
    raw = value.to_bytes(length, 'little', signed=signed)
    bench = bench_with({(MODE, 0): raw})
    data = bench.read(number(MODE, size, signed=signed)).data
    assert data == value.to_bytes(size, 'little', signed=signed)
    # and it is written as long as it was read
    bench.write(number(MODE, size, signed=signed), data)
    assert bench.bus.servers[UNIT].objects[MODE, 0] == raw


def test_what_the_catalog_has_no_room_for_is_no_value() -> None:
    bench = bench_with({(MODE, 0): (70_000).to_bytes(4, 'little')})
    with pytest.raises(DamagedAnswer, match=r'2022h, sub-index 0: .* is no number of 2 bytes'):
        bench.read(number(MODE, 2, signed=False))
    bench = bench_with({(MODE, 0): bytes(3)})
    with pytest.raises(DamagedAnswer, match='no number'):
        bench.read(number(MODE, 2, signed=False))


@given(
    st.data(), st.sampled_from([1, 2, 4]), st.sampled_from([1, 2, 4, 8]), st.booleans(),
    st.sampled_from([WRONG_LENGTH, sdo.TOO_LONG]),
)
def test_a_length_that_is_not_known_is_found_by_trying(
    data: st.DataObject, size: int, length: int, signed: bool, abort: int
) -> None:
    value = data.draw(numbers(min(size, length), signed=signed))
    bench = bench_with({(MODE, 0): bytes(length)}, Strict)
    assert isinstance(bench.bus.servers[UNIT], Strict)
    bench.bus.servers[UNIT].abort = abort
    address = number(MODE, size, signed=signed)
    for _ in range(2):
        tries = len(bench.bus.begun)
        bench.write(address, value.to_bytes(size, 'little', signed=signed))
        stored = bench.bus.servers[UNIT].objects[MODE, 0]
        assert stored == value.to_bytes(length, 'little', signed=signed)
    # what was found is kept
    assert len(bench.bus.begun) == tries + 1


def test_a_value_that_is_too_long_for_the_node_is_refused_unsent() -> None:
    bench = bench_with({(MODE, 0): bytes(1)})
    bench.read(number(MODE, 2, signed=False))
    with pytest.raises(Refused, match='has 1 bytes for it, 300 takes more') as refused:
        bench.write(number(MODE, 2, signed=False), (300).to_bytes(2, 'little'))
    assert refused.value.code == Refused.ILLEGAL_VALUE
    assert len(bench.bus.begun) == 1


def test_what_is_refused_for_another_reason_is_not_tried_again() -> None:
    bench = bench_with({(MODE, 0): bytes(2)})
    bench.bus.servers[UNIT].refuses[MODE, 0] = 0x06090030
    with pytest.raises(Refused, match='does not accept this value'):
        bench.write(number(MODE, 2, signed=False), b'\3\0')
    assert len(bench.bus.begun) == 1


# --- arrays ---------------------------------------------------------------------------------------


def inv_st(*sub_indices: int) -> Bench:
    """Return a bus with a node that has these values in its array."""
    bench = Bench()
    bench.bus.servers[UNIT] = Server({(INV_ST, each): b'' for each in sub_indices})
    return bench


def asked(bench: Bench) -> list[int]:
    return [sub_index for _, _, sub_index, _, _ in bench.bus.begun]


def test_an_array_that_is_numbered_from_1_as_in_the_catalog() -> None:
    bench = inv_st(0, 1, 2)
    assert bench.read(WITHOUT_ACK).data == bench.answer_of(0)
    assert asked(bench) == [2]
    bench.read(WITH_ACK)
    assert asked(bench) == [2, 1]


def test_an_array_that_is_numbered_from_0() -> None:
    bench = inv_st(0, 1)
    assert bench.read(WITHOUT_ACK).data == bench.answer_of(1)
    assert asked(bench) == [2, 1]
    bench.read(WITHOUT_ACK)
    bench.read(WITH_ACK)
    assert asked(bench) == [2, 1, 1, 0]


@pytest.mark.parametrize(('sub_indices', 'expected'), [((0, 1, 2), [2, 1]), ((0, 1), [2, 0])])
def test_nothing_acknowledges_before_it_is_known_what_does(
    sub_indices: tuple[int, ...], expected: list[int]
) -> None:
    bench = inv_st(*sub_indices)
    bench.read(WITH_ACK)
    assert asked(bench) == expected


@pytest.mark.parametrize(('sub_indices', 'expected'), [((0, 1, 2), [2, 1, 0]), ((0, 1), [2, 0, 0])])
def test_nothing_comes_between_the_acknowledging_and_the_stop(
    sub_indices: tuple[int, ...], expected: list[int]
) -> None:
    bench = inv_st(*sub_indices)
    bench.bus.servers[UNIT].objects[MODE, 0] = bytes(2)
    mode = number(MODE, 2, signed=False)
    bench.link.read_then_write(UNIT, WITH_ACK, mode, b'\1\0')
    assert asked(bench) == expected


def test_another_refusal_does_not_show_how_an_array_is_numbered() -> None:
    bench = inv_st(0, 1)
    bench.bus.servers[UNIT].refuses[INV_ST, 2] = NO_OBJECT
    for address in (WITHOUT_ACK, WITH_ACK):
        with pytest.raises(Refused, match='no such object'):
            bench.read(address)
    assert asked(bench) == [2, 2]


def test_what_was_learnt_is_forgotten_when_the_port_is_closed() -> None:
    bench = inv_st(0, 1)
    bench.read(WITHOUT_ACK)
    bench.link.close()
    bench.link.open()
    bench.bus.servers[UNIT] = Server({(INV_ST, each): b'' for each in (0, 1, 2)})
    bench.read(WITHOUT_ACK)
    assert asked(bench) == [2, 1, 2]
