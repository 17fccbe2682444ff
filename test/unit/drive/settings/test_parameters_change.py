# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Settings are changed all or none, read back, and left alone where they must be."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import struct
from typing import Any

import pytest
from support.rig import CONNECTIONS, Rig
from support.said import Said, raises, said
from support.variants import ramps

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.drive.change.parameter_writer import ParameterError
from nfo_sinus_driver.drive.change.parameters import Parameters
from nfo_sinus_driver.link import Refused

ACCEL, RETARD, FIX = 'control.accel', 'control.retard', 'freque.f_fix1'
MAGN, LIMT = 'motor.i_magn', 'motor.i_limt'
#: What is written together, in this order, and what was there before.
THREE: dict[str, Value] = {ACCEL: 7.0, RETARD: 7.0, FIX: 7.0}
BEFORE = [0.3, 0.3, 10.0]
BACK = (ACCEL, 0.3)
OVERLOAD = 5
WITH_SETTINGS = ('rtu', 'ascii', 'tcp', 'canopen', 'classic', 'classic v5.0', 'movitrac')


@pytest.fixture
def rig() -> Any:
    with Rig() as rig:
        rig.connect(parameters=True)
        yield rig


@pytest.fixture
def parameters(rig: Rig) -> Parameters:
    return rig.drive.parameters


def far(rig: Rig, *keys: str) -> list[Value]:
    """Return what the drive has."""
    return [rig.far.peek(key) for key in keys]


def on_write(rig: Rig, work: Callable[[str, Value], str | None]) -> None:
    """Have ``work`` say what goes wrong with a write to a setting, as ``Rig.meet`` does."""

    def meet(key: str, data: bytes | None) -> str | None:
        if data is None or key not in rig.far.settings:
            return None
        return work(key, rig.drive.params.value(key, data))

    rig.meet = meet


def refuse(key: str, value: Value) -> str | None:
    """Refuse to have the third written."""
    return 'refused' if key == FIX else None


def fails(rig: Rig, future: Future[Any], *left: str) -> Said:
    """Return why a change failed; these alone may not be as they were."""
    with pytest.raises(ParameterError) as error:
        rig.result(future)
    assert error.value.left == left
    return said(error.value)


# --- what is written ------------------------------------------------------------------------------


@pytest.mark.parametrize('connection', WITH_SETTINGS)
def test_a_change_is_written_once_and_read_back_and_what_is_the_same_is_not(
    connection: str,
) -> None:
    with Rig(connection) as rig:
        rig.connect(parameters=True)
        parameters = rig.drive.parameters
        up, down = ramps(CONNECTIONS[connection].model, 0.0, 0.0)
        rig.pass_time(0.3)
        rig.asked.clear()
        (change,) = rig.result(parameters.change({up: 7.5, down: 0.3}))
        assert str(change) == f'{up}: 0.3 -> 7.5 s'
        assert rig.far.writes == {up: 1}
        assert far(rig, up) == [7.5] == [parameters.values[up]]
        assert rig.notes.parameters[-1] == up
        assert rig.notes.said(f'{up}: 0.3 -> 7.5 s', Severity.INFO)
        assert not rig.notes.said(Cause.CHANGED_AT_DRIVE)
        written = [data is not None for _, key, data in rig.asked if key == up]
        # the refresh may read it once more
        at = written.index(True)
        assert written[at : at + 2] == [True, False] and written.count(True) == 1
        for wanted in ({up: 7.5, down: 0.3}, {}):
            assert rig.result(parameters.change(wanted)) == ()
        assert rig.far.writes == {up: 1}


def test_only_what_the_drive_has_counts_and_not_what_is_remembered(
    rig: Rig, parameters: Parameters
) -> None:
    rig.far.set_from_keypad(ACCEL, 7)
    assert rig.result(parameters.change({ACCEL: 7})) == ()
    assert parameters.values[ACCEL] == 7
    rig.far.set_from_keypad(ACCEL, 9)
    (change,) = rig.result(parameters.change({ACCEL: 7}))
    assert str(change) == f'{ACCEL}: 9 -> 7 s'
    assert rig.far.writes == {ACCEL: 1}


def test_an_old_value_that_means_nothing_is_replaced(rig: Rig, parameters: Parameters) -> None:
    for key, raw, new, says in (
        ('control.st_mode', 9, 'Release', '9 -> Release'),
        ('control.energy_save', 2, True, '0002h -> true'),
    ):
        rig.far.memory.put(key, raw)
        (change,) = rig.result(parameters.change({key: new}))
        assert str(change) == f'{key}: {says}'
        assert far(rig, key) == [new] == [parameters.values[key]]


def test_every_form_of_a_value_is_taken(rig: Rig, parameters: Parameters) -> None:
    rendered = struct.unpack('<f', struct.pack('<f', 123.4))[0]
    rig.result(parameters.change({ACCEL: rendered}))
    assert far(rig, ACCEL) == [123.4] == [parameters.values[ACCEL]] != [rendered]
    assert rig.result(parameters.change({ACCEL: 123.4})) == ()
    rig.result(parameters.change({ACCEL: 7, 'motor.u_nom': 700.0}))
    assert [type(parameters.values[key]) for key in (ACCEL, 'motor.u_nom')] == [float, int]
    wanted: dict[str, Value] = {
        ACCEL: 7.0, 'motor.u_nom': 700,
        'control.energy_save': True, 'control.mode': 'Speed', 'pi_reg.reg_amp': -1,
    }
    rig.result(parameters.change(wanted))
    assert far(rig, *wanted) == list(wanted.values())


# --- what is refused without asking the drive -----------------------------------------------------


def test_values_that_no_drive_can_have_are_refused(rig: Rig, parameters: Parameters) -> None:
    # what else the catalog refuses is tested there
    wrong = []
    for key, value, says in (
        (ACCEL, 7.123456, '7.123456 lies between two steps of the drive, 7.123 and 7.124'),
        (ACCEL, -7, '-7 is out of range, 0.2 to 500 s'),
        (ACCEL, 10**400, 'inf is not finite'),
        (ACCEL, None, 'None is not a number'),
        ('control.st_mode', 'brake', "'brake' is none of Release, Brake"),
        ('pi_reg.reg_amp', [1], '[1] is none of '),
    ):
        for take in (
            lambda: parameters.coerce(key, value),  # noqa: B023
            lambda: parameters.validate(key, value),  # noqa: B023
            lambda: rig.result(parameters.change({RETARD: 9, key: value})),  # noqa: B023
        ):
            with pytest.raises(ParameterError) as error:
                take()
            if not said(error.value).startswith(f'{key}: {says}'):
                wrong.append(said(error.value))
    assert not wrong
    assert not rig.far.writes


def test_what_is_no_setting_cannot_be_changed() -> None:
    with Rig(allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        rig.asked.clear()
        for key in (
            'fieldbus.scmd', 'fieldbus.drive_control', 'fieldbus.inv_st_with_ack',
            'fieldbus.spd_scl_numerator', 'status.frq_set', 'control.any_bus', 'made.up', '',
        ):  # fmt: skip
            answer = rig.answer(rig.drive.parameters.change({ACCEL: 7, key: 1}))
            assert answer == f'{key} is no parameter that can be changed here'
        assert not [key for _, key, data in rig.asked if data is not None]


# --- settings of the line -------------------------------------------------------------------------


def test_settings_of_the_line_are_guarded(rig: Rig, parameters: Parameters) -> None:
    for key, value in (
        ('serial.address', 9), ('serial.si_baud', '9600bps'), ('serial.bus_type', 'NFO'),
        ('serial.si_prot', '8b Op 1s'), ('serial.sio_tot', 9), ('serial.auto_reset', True),
    ):  # fmt: skip
        answer = rig.answer(parameters.change({ACCEL: 7, key: value}))
        assert answer.startswith(f'{key}: communication settings are not changed unless allow_')
        with raises(Cause.COMMUNICATION_PROTECTED):
            parameters.validate(key, value)
        assert not rig.far.writes
    # a saved state of the same drive loads all the same
    serial = {key: value for key, value in parameters.values.items() if key.startswith('serial.')}
    rig.result(parameters.change({**serial, ACCEL: 7}))
    assert rig.far.writes == {ACCEL: 1}
    # it is let through because the drive had it when it was read; nothing is written
    rig.far.set_from_keypad('serial.sio_tot', 9)
    assert rig.result(parameters.change({'serial.sio_tot': serial['serial.sio_tot']})) == ()
    assert far(rig, 'serial.sio_tot') == [9]


def test_settings_of_the_line_are_changed_last_and_followed() -> None:
    with Rig(allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        parameters = rig.drive.parameters
        on_write(rig, lambda key, value: 'ignored' if key == ACCEL else None)
        answer = fails(rig, parameters.change({'serial.address': 9, ACCEL: 7}))
        assert 'start this driver' not in answer
        assert not rig.far.writes
        rig.meet = lambda key, data: None
        wanted: dict[str, Value] = {
            'serial.address': 9, 'serial.si_prot': '8b Op 1s', 'serial.si_baud': '9600bps', ACCEL: 7
        }
        changes = rig.result(parameters.change(wanted))
        assert changes[0].key == ACCEL
        assert far(rig, *wanted) == list(wanted.values())
        hint = 'then start this driver with the address (9) and char_format (8O1) and baud_'
        assert rig.notes.said(hint, Severity.WARNING)


#: Settings of the line for which the drive itself does not want a motor at standstill.
LINE_SETTINGS: dict[str, dict[str, Value]] = {
    'rtu': {
        'serial.address': 9, 'serial.si_baud': '9600bps', 'serial.si_prot': '8b Op 1s',
        'serial.bus_type': 'NFO', 'serial.auto_reset': True,
    },
    'classic': {'serial.address': 9, 'serial.si_baud': '19200bps', 'serial.bus_type': 'ABCC'},
    'movitrac': {'serial.inverter_address': 9, 'serial.response_time': 20},
}


@pytest.mark.parametrize('connection', LINE_SETTINGS)
def test_no_running_motor_is_lost_by_a_setting_of_the_line(connection: str) -> None:
    with Rig(connection, allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        rig.enable()
        parameters = rig.drive.parameters
        up, down = ramps(rig.connection.model, 7.0, 9.0).items()
        for frequency in (0.0, 20.0):
            rig.send(frequency)
            rig.wait_until(lambda: abs(rig.far.motor.frequency - frequency) < 0.2)  # noqa: B023
            for key, value in LINE_SETTINGS[connection].items():
                before = rig.far.peek(key)
                answer = rig.answer(parameters.change(dict([up, (key, value)])))
                assert answer.startswith(f'{key}: the motor is enabled'), answer
                assert rig.far.peek(key) == before
        assert rig.drive.following and not rig.far.writes[up[0]]
        # nor one that is still on its ramp
        rig.far.set_from_keypad(*down)
        rig.answer(rig.drive.stop())
        assert rig.far.motor.driven
        for key, value in LINE_SETTINGS[connection].items():
            answer = rig.answer(parameters.change({key: value}))
            assert answer.startswith(f'{key}: only while the motor is stopped'), answer


def test_a_setting_of_the_line_that_waits_is_not_written_once_it_is_enabled() -> None:
    with Rig(allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        begun = []

        def meet(key: str, data: bytes | None) -> None:
            if key == ACCEL and not begun:
                begun.append(rig.drive.enable())

        rig.meet = meet
        answer = rig.answer(rig.drive.parameters.change({ACCEL: 7, 'serial.address': 9}))
        assert answer.startswith('serial.address: the motor is enabled'), answer
        assert 'enabled' in rig.answer(begun[0]) and rig.drive.following
        assert rig.far.peek('serial.address') == 1


def test_the_time_out_of_a_drive_can_be_set_while_its_motor_runs() -> None:
    with Rig(allow_communication_changes=True).turn() as rig:
        parameters = rig.drive.parameters
        rig.result(parameters.change({'serial.sio_tot': 5.0, 'serial.auto_stop': True}))
        rig.result(rig.drive.set_drive_timeout(2.0))
        assert far(rig, 'serial.sio_tot') == [2.0]


#: The codes of BusType [M0 tables 2, 4], and the protocol of this driver for each.
BUS_TYPES = {
    'NFO': (1, 'classic'), 'MbusAsc': (2, 'modbus_ascii'), 'MbusRtu': (3, 'modbus_rtu'),
    'ABCC': (4, 'ABCC'),
}


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'canopen'])
def test_the_protocol_of_the_drive_is_changed_with_permission_alone(connection: str) -> None:
    # of the line that it has it hears until the next power-on
    for allowed in (False, True):
        with Rig(connection, allow_communication_changes=allowed) as rig:
            rig.connect(parameters=True)
            parameters = rig.drive.parameters
            before = rig.far.peek('serial.bus_type')
            for name, (code, _) in BUS_TYPES.items():
                if not allowed and name != before:
                    answer = rig.answer(parameters.change({'serial.bus_type': name}))
                    assert 'communication settings are not changed unless allow_' in answer
                    assert rig.far.peek('serial.bus_type') == before
                elif allowed:
                    rig.result(parameters.change({'serial.bus_type': name}))
                    assert rig.far.memory.raw('serial.bus_type') == code


#: By these the line is lost for good: [M0 §5.3.1], [M4 §2.3.2].
CUT_OFF: dict[str, tuple[str, Value, tuple[str, Value]]] = {
    'rtu': ('serial.bus_type', 'None', (ACCEL, 7.0)),
    'classic': ('serial.bus_type', 'None', (ACCEL, 7.0)),
    'telegram1 g2, mailbox': ('serial.bus_type', 'None', (ACCEL, 7.0)),
    'movitrac': ('serial.master_slave', True, ('ramp.t11_up', 7.0)),
}


@pytest.mark.parametrize('connection', CUT_OFF)
def test_what_ends_all_communication_is_left_to_the_keypad(connection: str) -> None:
    key, value, (other, number) = CUT_OFF[connection]
    for allowed in (False, True):
        with Rig(connection, allow_communication_changes=allowed) as rig:
            rig.connect(parameters=True)
            parameters = rig.drive.parameters
            before = rig.far.memory.raw(key)
            answer = rig.answer(parameters.change({other: number, key: value}))
            assert answer.startswith(f'{key}: '), answer
            assert 'keypad' in answer and 'all communication' in answer
            assert 'allow_communication_changes' not in answer
            # a file that is loaded is written as bytes
            data = rig.drive.params.encode(key, value)
            assert rig.answer(parameters.write_each({key: data}, lambda _: None)) == answer
            assert rig.far.memory.raw(key) == before and not rig.far.writes


def test_the_driver_is_told_of_by_the_words_that_it_takes() -> None:
    settings: dict[str, dict[str, str]] = {
        'protocol': {name: ours for name, (_, ours) in BUS_TYPES.items()},
        # [M0 table 4]
        'baud_rate': {
            '1200bps': '1200', '2400bps': '2400', '4800bps': '4800', '9600bps': '9600',
            '38400 bps': '38400', '57600 bps': '57600', '19200bps': '19200',
        },
        'char_format': {
            '7b Ep 1s': '7E1', '7b Op 1s': '7O1', '7b Np 2s': '7N2', '8b Ep 1s': '8E1',
            '8b Op 1s': '8O1', '8b Np 2s': '8N2',
        },
    }
    keys = {'protocol': 'bus_type', 'baud_rate': 'si_baud', 'char_format': 'si_prot'}
    with Rig(allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        for setting, words in settings.items():
            for shown, ours in words.items():
                changed = rig.result(
                    rig.drive.parameters.change({f'serial.{keys[setting]}': shown})
                )
                if changed:
                    hint = f'then start this driver with the {setting} ({ours}) that it has'
                    assert rig.notes.said(hint, Severity.WARNING), hint


def test_a_new_address_that_counts_at_once() -> None:
    with Rig(parameters={'serial.auto_reset': True}, allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        future = rig.drive.parameters.change({'serial.address': 9, ACCEL: 7})
        answer = fails(rig, future, 'serial.address', ACCEL)
        assert answer.startswith('serial.address: ')
        assert 'whether the drive took 9 is not known' in answer
        assert 'serial.address is NOT put back to 1' in answer
        assert f'{ACCEL} is NOT put back to 0.3 s' in answer
        assert 'then start this driver with the address (9) that it has' in answer


def test_format_codes_of_older_firmware_are_uncertain() -> None:
    for firmware, known in ((4.27, False), (4.28, True)):
        settings = {'fieldbus.sw_ver': firmware}
        with Rig(parameters=settings, allow_communication_changes=True) as rig:
            rig.connect(parameters=True)
            wanted = {'serial.si_prot': '8b Op 1s', 'serial.sio_tot': 9}
            answer = rig.answer(rig.drive.parameters.change(wanted))
            assert ('change it at the keypad' not in answer) == known
            assert len(rig.far.writes) == (2 if known else 0)


# --- a motor that turns ---------------------------------------------------------------------------


def test_what_needs_a_standing_motor_waits_for_it() -> None:
    with Rig() as rig:
        rig.turn()
        parameters = rig.drive.parameters
        rig.result(parameters.read())
        rig.asked.clear()
        answer = rig.answer(parameters.change({RETARD: 7, MAGN: 2.0}))
        assert answer.startswith(f'{MAGN}: only while the motor is stopped, but it is not (')
        # a drive that is lax about it is not trusted
        assert not rig.written(MAGN) + rig.written(RETARD)
        # what is the same needs no stop; a wanted state is written as far as it can be
        rig.result(parameters.change({RETARD: 8, MAGN: 1.8}))
        rig.result(parameters.apply({MAGN: 2.0, RETARD: 7}, write=True))
        assert rig.far.writes == {RETARD: 2}
        assert [drift.key for drift in parameters.drift] == [MAGN]
        assert rig.notes.said(Cause.WANTED_BUT_REFUSED)
        assert rig.turns
        rig.send(None)
        rig.result(rig.drive.stop())
        rig.pass_time(4.0)
        rig.result(parameters.change({MAGN: 2.0}))
        assert far(rig, MAGN) == [2.0]


def test_a_refusal_by_a_motor_that_starts_meanwhile_says_so(
    rig: Rig, parameters: Parameters
) -> None:

    def start(key: str, data: bytes | None) -> None:
        if key == MAGN:
            rig.far.control_unit.press('ext')
            rig.far.set_run_input(True)

    rig.meet = start
    assert rig.answer(parameters.change({MAGN: 2.0})) == (
        f'{MAGN}: the drive cannot do this in its present state (exception 4): '
        'the motor must be stopped for this, and it runs'
    )
    rig.far.control_unit.press('stop')


# --- refusals, and a drive that does something else -----------------------------------------------


def test_a_refusal_is_explained(rig: Rig, parameters: Parameters) -> None:
    for code, says in (
        (Refused.ILLEGAL_ADDRESS, 'the drive has no such parameter (exception 2)'),
        (Refused.ILLEGAL_VALUE, 'the drive does not accept 7 s (exception 3)'),
        (Refused.DEVICE_FAILURE, 'the drive cannot do this in its present state (exception 4)'),
        (0, 'the drive cannot do this in its present state (exception 4); fault 5 Overload'),
    ):

        def work(key: str, value: Value, code: int = code) -> None:
            if not code:
                # just now, so that no poll has seen it
                rig.far.trip(OVERLOAD)
            raise Refused(code or Refused.DEVICE_FAILURE)

        on_write(rig, work)
        answer = fails(rig, parameters.change({ACCEL: 7}))
        assert answer.startswith(f'{ACCEL}: {says}')
        assert answer.endswith('is active: call ~/fault_ack first') is (code == 0)


@pytest.mark.parametrize(
    ('low', 'high', 'left'), [(0.2, 5.0, False), (0.3, 0.3, False), (4.0, 4.0, True)]
)
def test_a_drive_that_keeps_another_value_is_put_right(
    rig: Rig, parameters: Parameters, low: float, high: float, left: bool
) -> None:

    def clamp(key: str, value: Any) -> str:
        rig.far.set_from_keypad(key, min(max(value, low), high))
        return 'ignored'

    on_write(rig, clamp)
    answer = fails(rig, parameters.change({ACCEL: 7}), *[ACCEL] * left)
    stays = f'{ACCEL} is NOT put back to 0.3 s: the drive keeps 4 s'
    assert answer == (
        f'{ACCEL}: the drive keeps {high:g} s where 7 s was written; '
        + (stays if left else 'it is 0.3 s as before')
    )
    assert far(rig, ACCEL) == [high if left else 0.3]


# --- several --------------------------------------------------------------------------------------


@pytest.mark.parametrize('how', ['change', 'apply'])
def test_values_that_bound_each_other_come_in_any_order(
    rig: Rig, parameters: Parameters, how: str
) -> None:

    def bound(key: str, value: Value) -> None:
        # I-magn is at most I-limt [C34]
        has = {**dict(zip((MAGN, LIMT), far(rig, MAGN, LIMT), strict=True)), key: value}
        if has[MAGN] > has[LIMT]:
            raise Refused(Refused.ILLEGAL_VALUE)

    on_write(rig, bound)
    for magn, limt in ((6.0, 9.0), (0.5, 1.0)):
        for keys in ((MAGN, LIMT), (LIMT, MAGN)):
            rig.far.set_from_keypad(MAGN, 1.8)
            rig.far.set_from_keypad(LIMT, 5.1)
            rig.result(parameters.refresh())
            rig.far.writes.clear()
            wanted = {key: magn if key == MAGN else limt for key in keys}
            if how == 'change':
                assert len(rig.result(parameters.change(wanted))) == 2
            else:
                rig.result(parameters.apply(wanted, write=True))
                assert not rig.notes.said(Cause.WANTED_BUT_REFUSED)
            assert far(rig, *wanted) == list(wanted.values())
            assert rig.far.writes == {MAGN: 1, LIMT: 1}
    answer = fails(rig, parameters.change({MAGN: 3.0, ACCEL: 7, LIMT: 2.0}))
    assert 'the drive does not accept 3 A (exception 3)' in answer
    assert f'put back: {LIMT}, {ACCEL}' in answer
    assert far(rig, MAGN, ACCEL, LIMT) == [0.5, 0.3, 1.0]


def test_what_was_written_is_put_back_in_reverse_order_and_what_not_is_named(
    rig: Rig, parameters: Parameters
) -> None:
    on_write(rig, lambda key, value: 'refused' if key == FIX or (key, value) == BACK else None)
    rig.asked.clear()
    answer = fails(rig, parameters.change(THREE), ACCEL)
    assert answer.startswith(f'{FIX}: the drive cannot do this')
    assert f'; put back: {RETARD}; {ACCEL} is NOT put back to 0.3 s: the drive cannot do' in answer
    written = [key for _, key, data in rig.asked if key in THREE and data is not None]
    assert written == [ACCEL, RETARD, FIX, RETARD, ACCEL, ACCEL, ACCEL]
    assert far(rig, *THREE) == [7, 0.3, 10]


def test_changes_at_once_come_one_after_the_other(rig: Rig, parameters: Parameters) -> None:
    for count in range(1, 6):
        futures = [
            parameters.change(dict.fromkeys(THREE, first + count)) for first in (10.0, 50.0)
        ]
        for future in futures:
            rig.result(future)
        assert far(rig, *THREE) == [50.0 + count] * 3
    # what is put back undoes no other change
    on_write(rig, refuse)
    first, second = parameters.change(THREE), parameters.change({ACCEL: 9})
    fails(rig, first)
    (change,) = rig.result(second)
    assert change.new == 9
    assert far(rig, ACCEL) == [9] == [parameters.values[ACCEL]]


def test_what_is_read_meanwhile_is_no_change_at_the_drive(
    rig: Rig, parameters: Parameters
) -> None:
    parameters._keys = (ACCEL,)

    def reading(future: Future[Any]) -> None:
        while not future.done():
            rig.result(parameters.refresh())

    for count in range(20):
        value = 1.0 + count
        rig.meet = lambda key, data: None
        reading(parameters.change({ACCEL: value, FIX: value}))
        assert parameters.values[ACCEL] == value
        # and this one is put back
        on_write(rig, refuse)
        reading(parameters.change({ACCEL: 99.0, FIX: 99.0}))
        assert parameters.values[ACCEL] == value
    assert not rig.notes.said(Cause.CHANGED_AT_DRIVE)


def test_long_changes_leave_the_polls_their_turns() -> None:
    with Rig(line={'baud': 9600}) as rig:
        rig.connect(parameters=True)
        keys = [f'freque.f_fix{number}' for number in range(1, 8)] + [ACCEL, RETARD]
        for value in (7, 9, 11):
            before = len(rig.notes.snapshots)
            rig.result(rig.drive.parameters.change(dict.fromkeys(keys, value)))
            assert len(rig.notes.snapshots) - before >= 3


# --- no answer, and ends half-way -----------------------------------------------------------------


@pytest.mark.parametrize('done', [False, True])
@pytest.mark.parametrize('state', ['silent', 'gone'])
def test_a_loss_in_the_middle_names_what_is_not_known(
    rig: Rig, parameters: Parameters, state: str, done: bool
) -> None:

    def vanish(key: str, value: Value) -> None:
        if key == FIX:
            if done:
                rig.far.set_from_keypad(FIX, value)
            rig.line.state = state

    on_write(rig, vanish)
    rig.asked.clear()
    answer = fails(rig, parameters.change(THREE), FIX, RETARD, ACCEL)
    assert answer.startswith(f'{FIX}: unit 1 did not answer' if state == 'silent' else f'{FIX}: ')
    assert 'whether the drive took 7 Hz is not known' in answer
    assert f'{FIX} is NOT put back to 10 Hz' in answer
    assert f'{RETARD} is NOT put back to 0.3 s' in answer
    assert f'{ACCEL} is NOT put back to 0.3 s: not tried any more' in answer
    # not two time-outs for each of a hundred
    assert len(rig.asked) < 40
    rig.line.mend()
    rig.meet = lambda key, data: None
    rig.wait_until(lambda: rig.drive.snapshot.connected)
    # what it has is seen, and it can be put right
    rig.result(parameters.change(dict(zip(THREE, BEFORE, strict=True))))
    assert far(rig, *THREE) == BEFORE == [parameters.values[key] for key in THREE]


def test_a_line_that_is_silent_from_the_beginning_changes_nothing(
    rig: Rig, parameters: Parameters
) -> None:
    rig.line.state = 'silent'
    for key, value in ((ACCEL, 7), (MAGN, 2)):
        answer = fails(rig, parameters.change({key: value}))
        assert answer.startswith(f'{key}: unit 1 did not answer')
    rig.result(parameters.apply({MAGN: 2, ACCEL: 7}, write=True))
    reports = [event for event in rig.notes.events if event.text.startswith('not applied from')]
    assert len(reports) == 2
    assert len(parameters.drift) == 2


def test_the_end_of_the_driver_in_the_middle_says_what_is_changed(
    rig: Rig, parameters: Parameters
) -> None:
    first, second = parameters.change(THREE), parameters.change({ACCEL: 9})
    rig.wait_until(lambda: rig.far.writes[RETARD])
    rig.kill()
    assert said(first.exception()) == said(second.exception()) == 'this driver is ending'
    text = f'ended half-way, NOT put back: {ACCEL}: 0.3 -> 7 s'
    assert rig.notes.said(text, Severity.WARNING)
    assert far(rig, *THREE) == [7, 7, 10]


def test_changes_go_on_when_those_before_are_cancelled(rig: Rig, parameters: Parameters) -> None:
    first = rig.bus.spawn(parameters.change_now(THREE))
    second = parameters.change({ACCEL: 9})
    third = rig.bus.spawn(parameters.change_now({ACCEL: 11}))
    fourth = parameters.change({'freque.f_fix2': 9})
    rig.bus.cancel(third)
    rig.wait_until(lambda: rig.far.writes[RETARD])
    rig.bus.cancel(first)
    for future in (second, fourth):
        rig.result(future)
    assert far(rig, ACCEL, FIX, 'freque.f_fix2') == [9, 10, 9]
