# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The requests to a G2, step by step, whatever it answers."""

from __future__ import annotations

import pytest
from support.steps import REFUSED, Wait, play, status

from nfo_sinus_driver.catalog import (
    Holder,
    NotPossible,
    Procedure,
    Refusal,
    Removal,
    Reset,
    State,
    load_family,
)
from nfo_sinus_driver.catalog.profile import (
    FAULT_GONE,
    Acknowledge,
    AcknowledgeThenWrite,
    ControlMethod,
    Read,
    Write,
)

G2 = load_family('sinus_g2')
MODE, SCMD, WORD = 'fieldbus.mode', 'fieldbus.scmd', 'fieldbus.drive_control'
MASK, STATUS = 'fieldbus.drv_ctrl_write_mask', 'fieldbus.drive_status'
ACK = 'fieldbus.inv_st_with_ack'
INHIBIT, STOP, EXT, BUS = range(4)
#: Control from the network; its reference, too.
FROM_NET = 0x0200
READY, NET_REF, RUN_BITS = 0x4076, 0x8000, 0x2009
OVERLOAD, SIO_FAIL = G2.status_code(5), G2.status_code(14)

IN_CONTROL = (Read(MODE), BUS)
NOT_IN_CONTROL = (Read(MODE), STOP)
SCMD_STOP = Write(SCMD, 0)
TO_NOBODY = Write(MODE, STOP)


def zero(retry: bool = True, key: str = 'status.frq_set') -> Write:
    return Write(key, 0.0, at='fieldbus.setpoint', retry=retry)


#: Set-point 0, read back; and what the drive keeps.
ZEROED = ((zero(), None), (Read('status.frq_set'), 0.0))
KEPT = ((zero(), None), (Read('status.frq_set'), 5.0))


def _method(name: str, reference: str, classic: bool) -> ControlMethod:
    protocol = 'classic' if classic else 'modbus'
    return G2.profile.methods[name](reference, lambda key: protocol in G2[key].addresses)


def scmd(reference: str = 'fieldbus', *, classic: bool = False) -> ControlMethod:
    return _method('mode_scmd', reference, classic)


def control(reference: str = 'fieldbus', *, classic: bool = False) -> ControlMethod:
    return _method('drive_control', reference, classic)


def change(clear: int, add: int = 0, *, retry: bool = False) -> Write:
    """Some bits of the control word, as one transaction: the AND mask is the low word."""
    return Write(MASK, ~clear & 0xFFFF | add << 16, retry=retry)


#: Bit 7 rises, and stands until the fault is gone.
EDGE = (
    (change(RUN_BITS | 0x80), None),
    (change(RUN_BITS | 0x80, 0x80), None),
    (FAULT_GONE, True),
    (change(RUN_BITS | 0x80), None),
)


# --- MODE and SCMD --------------------------------------------------------------------------------


def test_who_has_control() -> None:
    for mode, holder in (
        (INHIBIT, Holder.INHIBITED),
        (STOP, Holder.NOBODY),
        (EXT, Holder.LOCAL),
        (BUS, Holder.BUS),
        (9, Holder.UNKNOWN),
    ):
        for method in (scmd(), control()):
            assert play(method.holder(), (Read(MODE), mode)) is holder
        assert play(scmd().in_control(), (Read(MODE), mode)) is (mode == BUS)


def test_control_is_taken_and_the_stop_is_the_next_frame() -> None:
    first, taken = Write(SCMD, 0, head=True), (Write(MODE, BUS), None)
    for mode in (STOP, EXT):
        play(scmd().take_control(), (Read(MODE), mode), taken, (first, None))
    play(scmd().take_control(), (Read(MODE), BUS), (first, None))
    # one that comes too soon is given again under control
    reached = Wait(status(from_bus=True), not_by=[status()]), None
    play(scmd().take_control(), (Read(MODE), STOP), taken, (first, REFUSED), reached, (first, None))
    # control that is refused is not followed by anything
    with pytest.raises(Refusal):
        play(scmd().take_control(), (Read(MODE), STOP), (Write(MODE, BUS), REFUSED))
    for method in (scmd(), control()):
        with pytest.raises(NotPossible, match='MODE is Inhibit'):
            play(method.take_control(), (Read(MODE), INHIBIT))


def test_the_run_command_says_where_the_reference_comes_from() -> None:
    for reference, command in (
        *(('fieldbus', 0x101), ('terminal', 0x81), ('op_mode', 0x41), ('fix7_reverse', 0x3D)),
    ):
        play(scmd(reference).run(), (Write(SCMD, command, retry=False), None))


def test_stop() -> None:
    stop, to_zero = Write(SCMD, 0, retry=False), zero(retry=False)
    play(scmd().stop('Freque'), (stop, None), (to_zero, None))
    # no set-point is followed in a mode that is not known
    play(scmd().stop(''), (stop, None))
    # keypad or terminals have control: it is none of ours
    play(scmd().stop('Freque'), (stop, REFUSED), (Read(MODE), EXT))
    play(scmd().stop('Freque'), (stop, None), (to_zero, REFUSED))


def test_a_refused_stop_is_reported_where_the_bus_may_have_control() -> None:
    first = Refusal('the first')
    refused, to_zero = (Write(SCMD, 0, retry=False), first), (zero(retry=False), None)
    for mode in (BUS, INHIBIT, REFUSED):
        with pytest.raises(Refusal) as raised:
            play(scmd().stop('Freque'), refused, (Read(MODE), mode), to_zero)
        assert raised.value is first


def test_quick_stop_gives_control_back() -> None:
    assert G2.profile.methods['mode_scmd'].coasts
    play(scmd().quick_stop('Speed'), (TO_NOBODY, None), (zero(key='status.spd_set'), None))
    play(scmd().quick_stop('Freque'), (TO_NOBODY, None), (zero(), REFUSED))
    with pytest.raises(Refusal):
        play(scmd().quick_stop('Freque'), (TO_NOBODY, REFUSED), (Read(MODE), BUS), (zero(), None))


def test_control_is_given_back_only_where_it_is_ours() -> None:
    play(scmd().release(), IN_CONTROL, (TO_NOBODY, None))
    play(scmd().release(), NOT_IN_CONTROL)
    play(control().release(), (Read(STATUS), FROM_NET), (TO_NOBODY, None))
    play(control().release(), (Read(STATUS), 0))


def test_what_is_removed() -> None:
    refused, given_back = ((TO_NOBODY, REFUSED),), (TO_NOBODY, None)
    for command, setpoint, mode, removed in (
        (None, ZEROED, (given_back, NOT_IN_CONTROL), Removal.COMMAND),
        (None, ((zero(), REFUSED),), refused, Removal.COMMAND),
        (REFUSED, KEPT, (given_back, NOT_IN_CONTROL), Removal.COMMAND),
        (REFUSED, ZEROED, (given_back, IN_CONTROL), Removal.SETPOINT),
        (REFUSED, ZEROED, refused, Removal.SETPOINT),
        (REFUSED, KEPT, refused, Removal.NOTHING),
        (REFUSED, ((zero(), REFUSED),), refused, Removal.NOTHING),
    ):
        assert play(scmd().remove('Freque'), (SCMD_STOP, command), *setpoint, *mode) is removed


NOTHING_REMOVED = ((SCMD_STOP, REFUSED), (zero(), REFUSED), (TO_NOBODY, REFUSED))
COMMAND_REMOVED = ((SCMD_STOP, None), *ZEROED, (TO_NOBODY, None), NOT_IN_CONTROL)


def test_a_fault_is_acknowledged_by_reading() -> None:
    for script in (
        (NOT_IN_CONTROL, (Acknowledge(ACK), 5)),
        (IN_CONTROL, *COMMAND_REMOVED, (Acknowledge(ACK), 5)),
        # what releases the motor soonest is the very next frame
        (IN_CONTROL, *NOTHING_REMOVED, (AcknowledgeThenWrite(ACK, TO_NOBODY), None)),
        (IN_CONTROL, *NOTHING_REMOVED, (AcknowledgeThenWrite(ACK, TO_NOBODY), REFUSED)),
    ):
        assert play(scmd().acknowledge(OVERLOAD, 'Freque'), *script) == ''


GONE, STANDS = (Read('fieldbus.inv_st'), 37), (Read('fieldbus.inv_st'), SIO_FAIL.code)
FLAGS = Acknowledge('fieldbus.sio_err')
BY_READING = (NOT_IN_CONTROL, (Acknowledge(ACK), 14))


def test_a_serial_fault_ends_by_mode_stop() -> None:
    by_mode = (Read(MODE), BUS), (TO_NOBODY, None), NOT_IN_CONTROL
    assert play(scmd().acknowledge(SIO_FAIL, 'Freque'), *by_mode, GONE, GONE) == ''
    # Modbus has no flags
    script = (*by_mode, STANDS, STANDS, *BY_READING)
    assert play(scmd().acknowledge(SIO_FAIL, 'Freque'), *script) == ''


def test_a_serial_fault_ends_by_its_flags_on_classic() -> None:
    acknowledge = scmd(classic=True).acknowledge
    by_mode = (Read(MODE), STOP), (TO_NOBODY, REFUSED)
    # that a fault kept a message from being carried out is no reason of it
    said = play(acknowledge(SIO_FAIL, 'Freque'), *by_mode, STANDS, (FLAGS, 0b10101), GONE)
    assert said == 'wrong check sum, time-out of the serial communication'
    said = play(acknowledge(SIO_FAIL, 'Freque'), *by_mode, STANDS, (FLAGS, 1 << 12), GONE)
    assert said == 'flag 12'


def test_a_serial_fault_takes_no_control_from_the_terminals() -> None:
    script = ((Read(MODE), EXT), STANDS, STANDS, *BY_READING)
    assert play(scmd().acknowledge(SIO_FAIL, 'Freque'), *script, GONE) == ''
    with pytest.raises(NotPossible, match='press STOP at the drive'):
        play(scmd().acknowledge(SIO_FAIL, 'Freque'), *script, STANDS)
    begins = ((Read(MODE), EXT),)
    assert play(control().acknowledge(SIO_FAIL, 'Freque'), *begins, *EDGE, GONE) == ''
    with pytest.raises(NotPossible, match='press STOP at the drive'):
        play(control().acknowledge(SIO_FAIL, 'Freque'), *begins, *EDGE, STANDS)


def test_procedures() -> None:
    # once, and behind no stop that comes later
    commands = {
        Procedure.FULL: 0x201,
        Procedure.BASIC: 0x301,
        Procedure.STATOR_RESISTANCE: 0x401,
        Procedure.CALCULATE: 0x501,
        Reset.ERROR_LOG: 0x800,
        Reset.ENERGY: 0x900,
    }
    for procedure, command in commands.items():
        assert scmd().procedures[procedure] == Write(SCMD, command, retry=False, head=True)
        assert G2.profile.methods_with(procedure) == ['mode_scmd', 'telegram1']


# --- the control word -----------------------------------------------------------------------------


def test_the_network_has_control() -> None:
    assert play(control().in_control(), (Read(STATUS), FROM_NET | 0x31)) is True
    assert play(control().in_control(), (Read(STATUS), 0x31)) is False


def test_the_control_word_is_taken_and_runs() -> None:
    # from a motor that still stops, too: no state between shows then
    others = [
        status(state=state, word=FROM_NET) for state in (State.FAULTED, State.OPERATION_ENABLED)
    ]
    stopping = status(state=State.STOPPING, word=FROM_NET)
    startable = status(state=State.READY_TO_SWITCH_ON, word=FROM_NET)
    local = status(state=State.READY_TO_SWITCH_ON, word=0)
    for reference, ready in (('fieldbus', READY | NET_REF), ('terminal', READY)):
        method = control(reference)
        play(method.take_control(), (Read(MODE), STOP), (Write(WORD, ready), None))
        play(
            method.run(),
            (Wait(startable, stopping, not_by=[*others, local]), None),
            (Write(WORD, ready | 1, retry=False), None),
            (Wait(status(state=State.SWITCHED_ON), stopping, not_by=others), None),
            (Write(WORD, ready | 9, retry=False), None),
        )


def test_the_run_bits_are_reset_and_the_others_left() -> None:
    play(control().stop('Freque'), (change(RUN_BITS), None), (zero(retry=False), None))
    # Classic has no masks
    play(
        control(classic=True).stop('Freque'),
        (Read(WORD, retry=False), 0xC07F),
        (Write(WORD, 0xC076, retry=False), None),
        (zero(retry=False), None),
    )


def test_a_refused_reset_is_reported_where_the_network_has_control() -> None:
    # a mask is not the only way to reset them
    refused = (change(RUN_BITS), REFUSED), (Read(WORD, retry=False), 0xC07F)
    refused += ((Write(WORD, 0xC076, retry=False), REFUSED),)
    play(control().stop('Freque'), *refused, (Read(STATUS), 0))
    with pytest.raises(Refusal):
        steps = *refused, (Read(STATUS), FROM_NET), (zero(retry=False), None)
        play(control().stop('Freque'), *steps)


def test_a_control_word_that_cannot_be_read_is_written_only_where_the_network_has_control() -> None:
    refused = (change(RUN_BITS), REFUSED), (Read(WORD, retry=False), REFUSED)
    blind = (Write(WORD, READY | NET_REF, retry=False), None), (zero(retry=False), None)
    play(control().stop('Freque'), *refused, (Read(STATUS), FROM_NET), *blind)
    play(control().stop('Freque'), *refused, (Read(STATUS), 0), (Read(STATUS), 0))


def test_quick_stop_coasts_and_keeps_control() -> None:
    coast = change(RUN_BITS | 4, 0x800, retry=True)
    play(control().quick_stop('Freque'), (coast, None), (zero(), REFUSED))


#: A drive that lets go of no run bits, in whatever way they are reset.
NOT_RESET = (
    (change(RUN_BITS, retry=True), REFUSED),
    (Read(WORD), 0xC07F),
    (Write(WORD, 0xC076), REFUSED),
)


def test_what_is_removed_by_the_control_word() -> None:
    given_back, refused = (TO_NOBODY, None), (TO_NOBODY, REFUSED)
    for script, removed in (
        (((change(RUN_BITS, retry=True), None),), Removal.COMMAND),
        ((*NOT_RESET, given_back, (Read(STATUS), 0)), Removal.COMMAND),
        ((*NOT_RESET, given_back, (Read(STATUS), FROM_NET), *ZEROED), Removal.SETPOINT),
        ((*NOT_RESET, refused, *ZEROED), Removal.SETPOINT),
        ((*NOT_RESET, refused, *KEPT), Removal.NOTHING),
    ):
        assert play(control().remove('Freque'), *script) is removed


def test_a_fault_is_acknowledged_by_an_edge() -> None:
    assert play(control().acknowledge(OVERLOAD, 'Freque'), *EDGE) == ''
    # a serial one by MODE = Stop alone first
    serial = (Read(MODE), BUS), (TO_NOBODY, REFUSED)
    assert play(control().acknowledge(SIO_FAIL, 'Freque'), *serial, *EDGE) == ''


def test_where_no_edge_is_taken_reading_has_to_do() -> None:
    low = change(RUN_BITS | 0x80)
    stop = AcknowledgeThenWrite(ACK, Write(WORD, READY | NET_REF))
    for removed, end in (
        (((change(RUN_BITS, retry=True), None),), (Acknowledge(ACK), 5)),
        ((*NOT_RESET, (TO_NOBODY, REFUSED), *KEPT), (stop, REFUSED)),
    ):
        script = ((low, REFUSED), *removed, end)
        assert play(control().acknowledge(OVERLOAD, 'Freque'), *script) == ''


# --- set-points, and who was in charge ------------------------------------------------------------


def test_set_point_0_is_read_back() -> None:
    for method in (scmd(), control()):
        play(method.zero_setpoint('Freque'), *ZEROED)
        with pytest.raises(NotPossible, match='keeps a set-point of 5 where 0 was written'):
            play(method.zero_setpoint('Freque'), *KEPT)
        with pytest.raises(NotPossible, match=r'no set-point over the bus in control mode \?'):
            play(method.zero_setpoint(''))


@pytest.mark.parametrize('classic', [False, True])
def test_under_the_control_word_a_sign_is_a_direction(classic: bool) -> None:
    method = control(classic=classic)
    # the mask leaves SwitchOn as it is; without it, over Classic, the whole word is written [C27]
    forward, reverse = (
        (Write(WORD, READY | NET_REF | 0x0009), Write(WORD, READY | NET_REF | 0x2001))
        if classic else (change(0x2008, 0x0008, retry=True), change(0x2008, 0x2000, retry=True))
    )
    for mode, target in G2.profile.setpoints.items():
        directed = method.setpoint_target(target)
        size, nothing = Write(target.key, 20.0, at=target.at), zero(key=target.key)
        if mode == 'PI-Reg':
            assert directed is target
            continue
        assert directed.writes(-20.0, 0.0) == (reverse, size)
        assert directed.writes(-20.0, 5.0) == (nothing, reverse, size)
        assert directed.writes(20.0, -0.0) == (forward, size)
        assert directed.writes(20.0) == (nothing, forward, size)
        assert directed.value({reverse.key: reverse.value, target.key: 20.0}) == -20.0
        assert directed.written_once == {reverse.key}
        # by MODE and SCMD it is the sign [M2 table 2]
        assert scmd(classic=classic).setpoint_target(target) is target


def test_active_method() -> None:
    active_method = G2.profile.active_method
    # what has no control is asked for nothing: older firmware may not know it
    assert play(active_method(None)) == play(active_method(status())) == 'mode_scmd'
    assert play(active_method(status(from_bus=True)), (Read(MODE), BUS)) == 'mode_scmd'
    assert play(active_method(status(from_bus=True)), (Read(MODE), STOP)) == 'drive_control'


def test_every_parameter_that_is_named_is_one() -> None:
    profile = G2.profile
    assert profile.identified_by in G2
    assert profile.broadcast_stop == Write(MODE, STOP)
    assert {*profile.uncertain} <= {*G2}
    for target in profile.setpoints.values():
        assert target.key in G2
        assert target.at in G2
    for method in profile.methods.values():
        assert {write.key for write in method.procedures.values()} <= {*G2}
