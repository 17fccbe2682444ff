# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a Sinus G2 is commanded: by MODE and SCMD [M0 §7.2 tables 17 and 18], or by the control word of
the generic state machine [M0 §7.1 tables 14 to 16].
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import contextlib
from fractions import Fraction
from typing import ClassVar

from nfo_sinus_driver.catalog.directed import with_direction
from nfo_sinus_driver.catalog.profile import (
    FAULT_GONE,
    Acknowledge,
    AcknowledgeThenWrite,
    ControlMethod,
    Holder,
    NotPossible,
    OlderDialect,
    Profile,
    Read,
    Refusal,
    Removal,
    SetpointTarget,
    Status,
    Steps,
    Until,
    Write,
    one_step,
    try_steps,
)
from nfo_sinus_driver.catalog.status import Meaning, Role, State, StatusCode
from nfo_sinus_driver.families.sinus_g2 import words
from nfo_sinus_driver.families.sinus_g2.ds402.method import Ds402
from nfo_sinus_driver.families.sinus_g2.telegram1.profile import G2Telegram1
from nfo_sinus_driver.families.sinus_g2.words import ControlWord, Mode, Scmd

MODE = 'fieldbus.mode'
CONTROL_WORD = 'fieldbus.drive_control'
STATUS_WORD = 'fieldbus.drive_status'
INV_ST = 'fieldbus.inv_st'
INV_ST_WITH_ACK = 'fieldbus.inv_st_with_ack'
_MASK = 'fieldbus.drv_ctrl_write_mask'
_SIO_ERR = 'fieldbus.sio_err'

#: Over Classic all are written there, in the unit of the control mode ([C11], [C12]).
_COMMON = 'fieldbus.setpoint'
#: The greatest ones are those over a bus [M2 table 2].
_SETPOINTS = {
    'Freque': SetpointTarget('status.frq_set', 150.0, at=_COMMON, nominal='motor.f_nom'),
    # [C113]
    'PI-Reg': SetpointTarget(
        'status.reg_set',
        2000.0,
        at=_COMMON,
        ends=('pi_reg.setmin', 'pi_reg.setmax'),
        older_most=150.0,
    ),
    'Torque': SetpointTarget('status.trq_set', 200.0, at=_COMMON, nominal=100.0),
    'Speed': SetpointTarget('status.spd_set', 9000.0, at=_COMMON, nominal='motor.n_nom'),
}
#: Beyond what any reference asks for in either direction, 150 Hz, 9000 rpm and 200 % ([M0 table 4],
#: [M2 table 2]): by a fifth for slip and overshoot, twice for a torque peak.
MOST = {
    Role.ACTUAL_FREQUENCY: 180.0,
    Role.ACTUAL_SPEED: 10800.0,
    Role.ACTUAL_TORQUE: 400.0,
}
#: The run command that each reference has; the fixed ones are made of their number.
_COMMANDS = {
    'fieldbus': Scmd.FIELDBUS,
    'terminal': Scmd.TERMINAL,
    'op_mode': Scmd.OP_MODE,
    'analog': Scmd.ANALOG_F,
    'analog_reverse': Scmd.ANALOG_R,
    **{
        f'fix{number}{way}': Scmd[f'FIX_{number}_{letter}']
        for number in range(1, 8)
        for way, letter in (('', 'F'), ('_reverse', 'R'))
    },
}
#: Power and ramps; with it the G2 waits in READY_TO_SWITCH_ON.
_READY = (
    ControlWord.NET_CTRL
    | ControlWord.ENABLE_VOLTAGE
    | ControlWord.DISABLE_QUICK_STOP
    | ControlWord.ENABLE_RFG
    | ControlWord.UNLOCK_RFG
    | ControlWord.USE_REF_FOR_RFG
)
_DIRECTIONS = ControlWord.ENABLE_OP | ControlWord.ENABLE_REV_OP
_RUN = ControlWord.SWITCH_ON | _DIRECTIONS

#: SioErr, bit by bit [M2 table 4].
_LINE_FAULTS = {
    0: 'the inverter is blocked by an alarm',
    1: 'wrong parity',
    2: 'wrong check sum',
    3: 'wrong message structure',
    4: 'time-out of the serial communication',
    5: 'wrong parameter prefix',
    6: 'not permitted in the current mode',
    7: 'unknown parameter',
    8: 'the parameter cannot be read',
    9: 'the parameter cannot be written',
    10: 'the value is out of range',
    14: 'receive buffer overrun',
}
#: Prefix, unknown, unreadable, not to be written.
_ADDRESS_FLAGS = 1 << 5 | 1 << 7 | 1 << 8 | 1 << 9
_VALUE_FLAG = 1 << 10
#: The inverter status of a serial fault [M0 table 19], and those that are faults.
_SERIAL_FAULT, _FAULTS = 14, range(1, 24)
#: The exception codes of Modbus for an address, a value and a state that do not allow a write.
_ADDRESS, _VALUE, _FAILURE = 2, 3, 4
_NOT_NOW = f'control of the drive cannot be taken now ({words.INHIBITED})'
#: Why a serial fault is left that MODE = Stop would end.
_CONTROLLED_ELSEWHERE = (
    'the serial fault is still active: keypad or terminals have control, which MODE = Stop, the '
    'command that ends it, would take from them; press STOP at the drive, then acknowledge again'
)


def _masked(keep: ControlWord, add: ControlWord) -> int:
    """Return what changes bits of DriveControl at once: AND mask, then OR mask [M0 §7.1]."""
    return int(keep) & 0xFFFF | int(add) << 16


def _in_words(flags: int) -> str:
    bits = (bit for bit in range(16) if flags >> bit & 1)
    return ', '.join(_LINE_FAULTS.get(bit, f'flag {bit}') for bit in bits)


def _why_refused(read: Callable[[str], int], before: int | None) -> tuple[int, str]:
    """Find out why a write was answered by NAK [M0 §6.1.5]; clear nothing but our own error."""
    status = read(INV_ST)
    # a serial fault that was not active just before: the write is its cause
    if status == _SERIAL_FAULT and before not in (None, _SERIAL_FAULT):
        flags = read(_SIO_ERR)
        why = _in_words(flags) or 'it does not say why'
        text = f'the drive refused: {why}; its serial fault (Sio Fail) by this is cleared (NAK)'
        code = _ADDRESS if flags & _ADDRESS_FLAGS else _FAILURE
        return _VALUE if flags & _VALUE_FLAG else code, text
    if status == _SERIAL_FAULT:
        text = 'a serial fault (Sio Fail) is active: until it is acknowledged nothing can be done'
        return _FAILURE, f'{text} (NAK)'
    if status in _FAULTS:
        text = f'a fault is active (InvSt {status}): until it is acknowledged nothing can be done'
        return _FAILURE, f'{text} (NAK)'
    text = 'the drive does not accept this value, or not in its present state'
    return _VALUE, f'{text} (NAK, InvSt {status})'


class _G2(ControlMethod):
    """What both control methods share."""

    def holder(self) -> Steps[Holder]:
        """Tell who has control of the drive."""
        return words.HOLDERS.get((yield Read(MODE)), Holder.UNKNOWN)

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """
        Write set-point 0 in the unit of a control mode, and read it back.

        :raises NotPossible: the drive keeps another value, or takes none in this control mode.
        """
        if control_mode not in _SETPOINTS:
            raise NotPossible(
                f'the drive takes no set-point over the bus in control mode {control_mode or "?"}'
            )
        yield from _SETPOINTS[control_mode].set_to_zero()

    def _targets(self, control_mode: str) -> Sequence[SetpointTarget]:
        """Return where a set-point may stand that the motor would follow."""
        return [target for mode, target in _SETPOINTS.items() if mode == control_mode]

    def _clear_line_faults(self) -> Steps[str]:
        """Clear SioErr, which only Classic has; return why there was a serial fault, in words."""
        if not self._reaches(_SIO_ERR):
            return ''
        flags = int((yield Acknowledge(_SIO_ERR)))
        # that a fault kept a message, such as a stop, from being carried out is no reason of it
        return _in_words(flags & ~1)


class ModeScmd(_G2):
    """Control through MODE and SCMD; the run command says where the reference comes from."""

    means = 'SCMD'
    references = tuple(_COMMANDS)
    coasts = True
    procedures = words.PROCEDURES
    #: The parameter that takes the run command.
    _command: ClassVar[str] = 'fieldbus.scmd'
    #: What releases the motor soonest; SCMD = Stop would let it ramp down.
    _soonest: ClassVar[Write] = Write(MODE, Mode.STOP)

    def in_control(self) -> Steps[bool]:
        """Return whether the bus has control, taken by this session or an earlier one."""
        mode: int = yield Read(MODE)
        return mode == Mode.BUS

    def take_control(self) -> Steps[None]:
        """
        Put the drive under bus control with no run command standing.

        No manual says that a drive forgets the run command of an earlier session when control is
        taken, so the stop is the very next frame.

        :raises NotPossible: MODE is Inhibit.
        """
        mode = yield Read(MODE)
        if mode == Mode.INHIBIT:
            raise NotPossible(_NOT_NOW)
        stop = Write(self._command, Scmd.STOP, head=True)
        if mode != Mode.BUS:
            yield Write(MODE, Mode.BUS)
            try:
                yield stop
                return
            except Refusal:
                # too soon for it, as it seems
                yield Until(lambda status: status.from_bus)
        yield stop

    def run(self) -> Steps[None]:
        """Give the run command; once, for the state before a second one would be unknown."""
        yield Write(self._command, _COMMANDS[self._reference], retry=False)

    def stop(self, control_mode: str) -> Steps[None]:
        """
        Remove the run command and write set-point 0; each is tried even if the other fails [C126].

        Does nothing to a drive that is under the control of its keypad or terminals. Refused
        although the bus has control or, under Inhibit, nothing reports which: it may be tuning
        [C101].
        """
        zeroes = (target.zero(retry=False) for target in self._targets(control_mode))
        yield from self._stop_by(one_step(Write(self._command, Scmd.STOP, retry=False)), *zeroes)

    def perhaps_in_control(self) -> Steps[bool]:
        """Return whether the bus may have control: under Inhibit nothing reports."""
        try:
            return (yield Read(MODE)) in (Mode.INHIBIT, Mode.BUS)
        except Refusal:
            return True

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Release the motor at once, as <Stop> on the keypad does; control is given back."""
        # a drive may well refuse a set-point while the bus has no control
        zeroes = (target.zero(retry=True) for target in self._targets(control_mode))
        yield from self._stop_by(one_step(Write(MODE, Mode.STOP)), *zeroes)

    def release(self) -> Steps[None]:
        """Give control back; never by MODE = Ext, which can start the motor [C43]."""
        if (yield from self.in_control()):
            yield Write(MODE, Mode.STOP)

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Write SCMD = Stop, set-point 0 and MODE = Stop, and read back what can be read."""
        command = yield from try_steps(one_step(Write(self._command, Scmd.STOP)))
        setpoint = yield from self._remove_setpoint(control_mode)
        command |= yield from self._remove_control()
        if command:
            return Removal.COMMAND
        return Removal.SETPOINT if setpoint else Removal.NOTHING

    def _remove_setpoint(self, control_mode: str) -> Steps[bool]:
        """Write set-point 0 wherever the motor would follow one; return whether it is."""
        zeroes: list[bool] = []
        for target in self._targets(control_mode):
            zeroes.append((yield from try_steps(target.set_to_zero())))
        return bool(zeroes) and all(zeroes)

    def _remove_control(self) -> Steps[bool]:
        """Write MODE = Stop, with which no run command stands; return whether it is."""
        obeyed = yield from try_steps(one_step(Write(MODE, Mode.STOP)))
        return obeyed and not (yield from self.perhaps_in_control())

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault: a serial one by MODE = Stop, else by reading SioErr ([C42], [C99]).

        Any other by reading the status that acknowledges, once nothing is left that could turn the
        motor. If the drive lets go of nothing, what releases it soonest is the very next frame.

        :raises NotPossible: a serial fault is left, for keypad or terminals keep the control that
            MODE = Stop would take from them.
        """
        if Meaning.SERIAL_FAILURE not in shown.meanings:
            yield from self._acknowledge_by_reading(control_mode)
            return ''
        elsewhere = yield from self._controlled_elsewhere()
        if not elsewhere:
            yield from self._remove_control()
        why = ''
        if (yield Read(INV_ST)) == shown.code:
            # older firmware obeys no MODE that is for it alone while the fault is active [C9]
            why = yield from self._clear_line_faults()
        if (yield Read(INV_ST)) == shown.code:
            yield from self._acknowledge_by_reading(control_mode)
            if elsewhere and (yield Read(INV_ST)) == shown.code:
                raise NotPossible(_CONTROLLED_ELSEWHERE)
        return why

    def _controlled_elsewhere(self) -> Steps[bool]:
        """Return whether keypad or terminals have control, which MODE = Stop would take."""
        mode: int = yield Read(MODE)
        return mode == Mode.EXT

    def _acknowledge_by_reading(self, control_mode: str) -> Steps[None]:
        ours = yield from self.in_control()
        if ours and (yield from self.remove(control_mode)) is not Removal.COMMAND:
            # refused while the cause of the fault lasts: the status will tell
            with contextlib.suppress(Refusal):
                yield AcknowledgeThenWrite(INV_ST_WITH_ACK, self._soonest)
        else:
            yield Acknowledge(INV_ST_WITH_ACK)


class DriveControl(_G2):
    """
    Control through DriveControl and DriveStatus.

    The G2 is switched on and then enabled, the Optimal enabled and then switched on [C54].
    """

    means = 'control word'
    references = ('fieldbus', 'terminal')
    coasts = True
    older = False
    needs = (CONTROL_WORD, STATUS_WORD)

    def __init__(self, reference: str, reaches: Callable[[str], bool]) -> None:
        super().__init__(reference, reaches)
        # without NetRef the reference is the drive's own, not the one from the bus
        self._ready = _READY | ControlWord.NET_REF if reference == 'fieldbus' else _READY

    def in_control(self) -> Steps[bool]:
        """Return whether the network has control, taken by this session or an earlier one."""
        return bool(int((yield Read(STATUS_WORD))) & words.Status.CTRL_FROM_NET)

    def take_control(self) -> Steps[None]:
        """
        Request control with bit 0 low, so that a run command is an edge later [C35].

        :raises NotPossible: MODE is Inhibit.
        """
        if (yield Read(MODE)) == Mode.INHIBIT:
            raise NotPossible(_NOT_NOW)
        yield Write(CONTROL_WORD, self._ready)

    def run(self) -> Steps[None]:
        """
        Switch on, then give the direction, each when the drive shows a state before it.

        From a motor that is still on its way to a stop bit 0 leads back to OPERATION_ENABLED, and
        without a direction from there to DISABLE, which shows as SHUTDOWN does ([M0 table 16],
        [C37]).
        """
        startable = (State.READY_TO_SWITCH_ON, State.STOPPING)
        yield Until(
            lambda status: status.state in startable
            and bool((status.word or 0) & words.Status.CTRL_FROM_NET)
        )
        switched_on = self._ready | ControlWord.SWITCH_ON
        yield Write(CONTROL_WORD, switched_on, retry=False)
        yield Until(lambda status: status.state in (State.SWITCHED_ON, State.STOPPING))
        # both direction bits at once mean no change [C36]
        yield Write(CONTROL_WORD, switched_on | ControlWord.ENABLE_OP, retry=False)

    def setpoint_target(self, target: SetpointTarget) -> SetpointTarget:
        """
        Return where sizes go, with the direction by bits 3 and 13, in one write [M0 table 14].

        That a sign reverses is printed for MODE and SCMD alone [C120]. A process value has one.
        """
        if target is _SETPOINTS['PI-Reg']:
            return target
        if self._reaches(_MASK):
            forward = _masked(~_DIRECTIONS, ControlWord.ENABLE_OP)
            reverse = _masked(~_DIRECTIONS, ControlWord.ENABLE_REV_OP)
            return with_direction(target, _MASK, forward, reverse)
        on = self._ready | ControlWord.SWITCH_ON
        forward, reverse = int(on | ControlWord.ENABLE_OP), int(on | ControlWord.ENABLE_REV_OP)
        return with_direction(target, CONTROL_WORD, forward, reverse)

    def stop(self, control_mode: str) -> Steps[None]:
        """
        Remove the run command, so that the drive goes to SHUTDOWN, and write set-point 0.

        Each is tried even if the other fails [C126]. Does nothing to a drive that is not under bus
        control: who has control stays as it is.
        """
        zeroes = (target.zero(retry=False) for target in self._targets(control_mode))
        yield from self._stop_by(self._change_or_write(~_RUN, ControlWord(0)), *zeroes)

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Go to QUICK_STOP, which coasts [C96]; control is kept."""
        coast = ~(_RUN | ControlWord.DISABLE_QUICK_STOP)
        zeroes = (target.zero(retry=True) for target in self._targets(control_mode))
        change = self._change_or_write(coast, ControlWord.OVERRIDE_COAST, retry=True)
        yield from self._stop_by(change, *zeroes)

    def force_stop(self, control_mode: str) -> Steps[bool]:
        """Remove run bits and set-point, quick stop, and take control away by MODE = Stop."""
        obeyed = yield from super().force_stop(control_mode)
        return (yield from try_steps(one_step(Write(MODE, Mode.STOP)))) or obeyed

    def release(self) -> Steps[None]:
        """
        Give control back by MODE = Stop, once the motor stands.

        Resetting NetCtrl would hand control to whatever is local, which may be a RUN input that is
        active.
        """
        if (yield from self.in_control()):
            yield Write(MODE, Mode.STOP)

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Reset the run bits; where that is refused, write set-point 0 and MODE = Stop."""
        if (yield from try_steps(self._change_or_write(~_RUN, ControlWord(0), retry=True))):
            return Removal.COMMAND
        released = yield from try_steps(one_step(Write(MODE, Mode.STOP)))
        if released and not (yield from self.perhaps_in_control()):
            return Removal.COMMAND
        if (yield from try_steps(self.zero_setpoint(control_mode))):
            return Removal.SETPOINT
        return Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault by one rising edge of bit 7, under any control [M0 table 16].

        A serial fault by MODE = Stop alone first, else by reading SioErr [C99]. Over Classic
        nothing can be written while any fault is active, so that reading has to do [M0 §6.1.5]; the
        run bits that stand then lead nowhere without a new edge [M0 table 16].

        :raises NotPossible: a serial fault is left, for keypad or terminals keep the control that
            MODE = Stop would take from them.
        """
        why, elsewhere = '', False
        if Meaning.SERIAL_FAILURE in shown.meanings:
            elsewhere = (yield Read(MODE)) == Mode.EXT
            if not elsewhere:
                with contextlib.suppress(Refusal):
                    yield Write(MODE, Mode.STOP)
            why = yield from self._clear_line_faults()
        try:
            for add in (ControlWord(0), ControlWord.RESET_MALFUNCTION, ControlWord(0)):
                yield from self._change(~(_RUN | ControlWord.RESET_MALFUNCTION), add)
                if add:
                    yield FAULT_GONE
        except Refusal:
            if (yield from self.remove(control_mode)) is not Removal.COMMAND:
                # refused while the cause of the fault lasts: the status will tell
                with contextlib.suppress(Refusal):
                    stop = Write(CONTROL_WORD, self._ready)
                    yield AcknowledgeThenWrite(INV_ST_WITH_ACK, stop)
            else:
                yield Acknowledge(INV_ST_WITH_ACK)
        if elsewhere and (yield Read(INV_ST)) == shown.code:
            raise NotPossible(_CONTROLLED_ELSEWHERE)
        return why

    def _change(self, keep: ControlWord, add: ControlWord, *, retry: bool = False) -> Steps[None]:
        """Change some bits of the control word and leave the others to who has control."""
        if self._reaches(_MASK):
            yield Write(_MASK, _masked(keep, add), retry=retry)
            return
        word = ControlWord(int((yield Read(CONTROL_WORD))))
        yield Write(CONTROL_WORD, word & keep | add, retry=retry)

    def _change_or_write(
        self, keep: ControlWord, add: ControlWord, *, retry: bool = False
    ) -> Steps[None]:
        """Change some bits of the control word for a stop, in whatever way the drive takes it."""
        masked = self._reaches(_MASK)
        if masked and (yield from try_steps(self._change(keep, add, retry=retry))):
            return
        word = self._ready
        try:
            word = ControlWord(int((yield Read(CONTROL_WORD, retry=retry))))
        except Refusal:
            # then what the driver wrote last, but never while keypad or terminals have control
            if not (yield from self.perhaps_in_control()):
                raise
        yield Write(CONTROL_WORD, word & keep | add, retry=retry)


def _active_method(status: Status | None) -> Steps[str]:
    """Return by which control method the bus has control; MODE and SCMD where it has none."""
    # older firmware has no more to ask for
    if status is None or not status.from_bus:
        return 'mode_scmd'
    return 'mode_scmd' if (yield Read(MODE)) == Mode.BUS else 'drive_control'


PROFILE = Profile(
    title='NFO Sinus G2',
    enable_input='RUN input (DIN1)',
    status_word=words.STATUS_WORD,
    holders=words.HOLDERS,
    methods={
        'mode_scmd': ModeScmd,
        'drive_control': DriveControl,
        'ds402': Ds402,
        'telegram1': G2Telegram1,
    },
    setpoints=_SETPOINTS,
    measured=(
        'status.frq_set',
        'status.spd_set',
        'status.trq_set',
        'status.reg_set',
        'status.reg_act',
    ),
    bit_fields=words.BIT_FIELDS,
    active_method=_active_method,
    # it works even on drives with a serial fault ([M0 §6.1.5], [C9])
    broadcast_stop=Write(MODE, Mode.STOP),
    # functions 43, 17 and 23 ([M0 §6.2.3], [C57]); its vendor is object 00h of 43 [M0 §6.2.4]
    names_itself=True,
    vendor='NFO',
    identified_by='fieldbus.sw_ver',
    writes_and_reads=True,
    releases='Release',
    # the v5.0 dialect [M2]; from 4.28 on [M0] describes the protocol [C3]. There an unknown
    # parameter is a serial fault, by which it stops while the bus has control [C21]
    older=OlderDialect(
        'classic',
        'v5.0',
        before=4.28,
        harmless=frozenset((Holder.NOBODY, Holder.LOCAL)),
        # one decimal [C115]
        factors={'status.trq_act': Fraction(1, 10)},
    ),
    most=MOST,
    # with OFF the motor runs on, whatever SioTot is ([M0 §5.3.5], [C91])
    timeout_conditions={'serial.auto_stop': (True,)},
    # in the tables of both firmwares ([M0 tables 2, 3], [M2 tables 1, 2])
    resync_reads={'classic': (INV_ST, MODE, 'control.mode', 'motor.f_nom')},
    why_refused=_why_refused,
    # a module with a drive profile need not have them [M0 §7]
    may_lack={'canopen': DriveControl.needs},
    # before it code 1 is another format ([C3], [C5])
    uncertain={'serial.si_prot': 4.28},
    # [C93]
    line_check=dict.fromkeys(
        ('modbus_rtu', 'modbus_ascii', 'modbus_tcp', 'classic'),
        'BusType in the drive (NFO, which is classic, is the factory setting; MbusRtu or MbusAsc '
        'for Modbus), jumper S5 (RS232 or RS485), the address, baud rate and parity',
    ),
    narrow=words.NARROW,
    inhibited=words.INHIBITED,
    line_words=words.LINE_WORDS,
    # [M0 §5.3.1]
    cuts_off={'serial.bus_type': 'None'},
    # [M0 §6.4]
    holds_control={
        'canopen': 'the CANopen module holds the drive in bus mode from the first request on, '
        'until the drive is switched off',
    },
)
