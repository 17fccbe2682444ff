# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A G2 by the drive profile of its CANopen module: the objects of [M0 table 11], by CiA 402."""

from can_bus_bench import Bus
import pytest

ERROR_CODE, CONTROL, STATUS, TARGET, DEMAND, ACTUAL = range(0x603F, 0x6045)
MODES, MODE, SCMD = 0x6060, 0x2022, 0x2023
#: By hand: the whole message of a client, and that of the node. Target velocity 600 rpm; shutdown,
#: switch on, enable operation, with the ramp generator in use; disable voltage.
STARTS = (
    ('2b42600058020000', '6042600000000000'),
    ('2b40600076000000', '6040600000000000'),
    ('4041600000000000', '4b41600031020000'),
    ('2b40600077000000', '6040600000000000'),
    ('4041600000000000', '4b41600033020000'),
    ('2b4060007f000000', '6040600000000000'),
    ('4041600000000000', '4b41600037020000'),
    ('4061600000000000', '4f61600002000000'),
)
COASTS = (('2b40600000000000', '6040600000000000'), ('4041600000000000', '4b41600007020000'))


def word(value: int) -> bytes:
    return value.to_bytes(2, 'little', signed=value < 0)


def number(bus: Bus, index: int, sub_index: int = 0) -> int:
    return int.from_bytes(bus.read(index, sub_index), 'little', signed=True)


def said(bus: Bus, messages: tuple[tuple[str, str], ...]) -> None:
    for request, answer in messages:
        assert bus.sdo(request) == answer


def running(rpm: int = 600, **options: object) -> Bus:
    """Return a bus with a drive that turns at so many rpm."""
    quick = {'control.accel': 0.3, 'control.retard': 0.5}
    bus = Bus(settings={**quick, **options.pop('settings', {})}, **options)
    said(bus, STARTS)
    bus.write(TARGET, 0, word(rpm))
    bus.wait(2.0)
    assert number(bus, STATUS) & 0x6F == 0x27
    return bus


def test_it_starts_in_three_steps_and_coasts_without_voltage() -> None:
    bus = running()
    # 600 rpm of a motor of two pole pairs, and 6043h asks for them
    assert bus.drive.motor.frequency == pytest.approx(20.0, abs=0.1)
    assert number(bus, DEMAND) == 600 and number(bus, ACTUAL) == pytest.approx(600, abs=40)
    said(bus, COASTS)
    assert not bus.drive.motor.driven and bus.drive.motor.turning
    bus.wait(60.0)
    assert number(bus, STATUS) == 0x0240


def test_reverse_is_the_sign_and_shows_the_same_states() -> None:
    bus = running(-300)
    assert bus.drive.motor.frequency == pytest.approx(-10.0, abs=0.1)
    # by SCMD, analog reverse, it has a bit of its own in DriveStatus
    bus.write(SCMD, 0, word(0x005))
    bus.wait(5.0)
    assert bus.drive.motor.frequency == pytest.approx(-30.0, abs=0.1)
    assert number(bus, STATUS) & 0x6F == 0x27


@pytest.mark.parametrize(
    ('shown', 'ramp'), [('running', 0x27), ('ready', 0x21)]
)
def test_what_it_shows_while_it_ramps_to_a_stop(shown: str, ramp: int) -> None:
    bus = running(canopen_ramp=shown)
    bus.write(CONTROL, 0, word(0x76))
    assert bus.drive.motor.driven and number(bus, STATUS) & 0x6F == ramp
    bus.wait(5.0)
    assert number(bus, STATUS) & 0x6F == 0x21 and not bus.drive.motor.driven


def test_a_fault_waits_for_an_edge_of_bit_7_and_nothing_turns_then() -> None:
    bus = running()
    bus.drive.trip(8)
    bus.wait(60.0)
    assert number(bus, STATUS) & 0x4F == 0x08
    # DC link overvoltage
    assert number(bus, ERROR_CODE) == 0x3210
    bus.write(CONTROL, 0, word(0xFF))
    assert bus.drive.faults.shown == 0 and number(bus, ERROR_CODE) == 0
    bus.wait(5.0)
    assert number(bus, STATUS) & 0x4F == 0x40 and not bus.drive.motor.driven
    bus.drive.trip(8)
    bus.wait(1.0)
    bus.write(CONTROL, 0, word(0xFF))
    assert bus.drive.faults.shown == 8, 'the bit has not risen'


def test_local_control_is_not_remote_and_the_control_word_is_not_processed() -> None:
    bus = Bus(canopen_bus_mode='free')
    assert number(bus, STATUS) & 0x200 == 0
    # without remote the control word is not processed
    for value in (0x76, 0x77, 0x7F):
        bus.write(CONTROL, 0, word(value))
        bus.wait(1.0)
    assert not bus.drive.motor.driven and number(bus, CONTROL) == 0x7F
    bus.write(MODE, 0, word(3))
    assert number(bus, STATUS) & 0x200


def test_the_last_command_has_the_reference() -> None:
    bus = running()
    bus.write(SCMD, 0, word(0x101))
    bus.wait(5.0)
    assert bus.drive.motor.frequency == pytest.approx(0.0, abs=0.1)


def test_no_other_mode_than_that_of_the_drive_is_taken() -> None:
    bus = running(settings={'control.mode': 'Speed'})
    assert bus.drive.motor.frequency == pytest.approx(20.0, abs=1.5)
    assert bus.write(MODES, 0, b'\x02') == '' and bus.write(MODES, 0, b'\x04') == '06090030'


def test_the_scale_of_the_target_is_the_dimension_factor() -> None:
    bus = running()
    bus.write(0x604C, 2, (2).to_bytes(4, 'little'))
    bus.wait(2.0)
    assert bus.drive.motor.frequency == pytest.approx(10.0, abs=0.1)


def test_the_least_and_the_greatest_speed_hold_for_every_target() -> None:
    bus = running()
    for target, sub_index, limit, frequency in ((0, 1, 300, 10.0), (-600, 2, 450, -15.0)):
        bus.write(TARGET, 0, word(target))
        assert bus.write(0x6046, sub_index, limit.to_bytes(4, 'little')) == ''
        bus.wait(2.0)
        assert bus.drive.motor.frequency == pytest.approx(frequency, abs=0.1)


def test_what_is_not_implemented_is_absent_and_the_words_of_the_state_machine_may_be() -> None:
    for index in ('766000', '876000'):
        assert Bus().sdo(f'40{index}00000000') == f'80{index}00000206'
    bus = Bus(canopen_state_machine='absent')
    for index in ('012000', '032000', '122000', '132000'):
        assert bus.sdo(f'40{index}00000000') == f'80{index}00000206'
    # by MODE and SCMD, and by the profile, it is commanded all the same
    assert number(bus, 0x2026, 2) == 37 and bus.read(MODE) == b'\x03\x00'
    said(bus, STARTS)
