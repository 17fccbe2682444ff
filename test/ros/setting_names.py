# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The names and types of the 120 settings of the G2, which are fixed: files of users hold them."""

from __future__ import annotations

#: Group, name as the manual prints it, name and type of the ROS parameter.
SETTINGS = """
Motor,P-Nom,motor.p_nom,double
Motor,U-Nom,motor.u_nom,integer
Motor,f-Nom,motor.f_nom,integer
Motor,N-nom,motor.n_nom,integer
Motor,I-nom,motor.i_nom,double
Motor,cos-φ,motor.cos_phi,double
Motor,R-stat,motor.r_stat,double
Motor,R-rot,motor.r_rot,double
Motor,L-main,motor.l_main,double
Motor,Sigma,motor.sigma,double
Motor,I-magn,motor.i_magn,double
Motor,I-limt,motor.i_limt,double
Control,Mode,control.mode,string
Control,Accel,control.accel,double
Control,Retard,control.retard,double
Control,RunDly,control.run_dly,integer
Control,DC-Brk,control.dc_brk,integer
Control,AinSet,control.ain_set,string
Control,AutoStart,control.auto_start,bool
Control,EnergySave,control.energy_save,bool
Control,StMode,control.st_mode,string
Control,Kp-spd,control.kp_spd,double
Control,Ti-spd,control.ti_spd,double
Control,FSleep,control.f_sleep,double
Control,Byp-fr,control.byp_fr,double
Control,Byp-bw,control.byp_bw,double
Control,AnyBus,control.any_bus,string
Freque,OpMode,freque.op_mode,string
Freque,F-fix1,freque.f_fix1,double
Freque,F-fix2,freque.f_fix2,double
Freque,F-fix3,freque.f_fix3,double
Freque,F-fix4,freque.f_fix4,double
Freque,F-fix5,freque.f_fix5,double
Freque,F-fix6,freque.f_fix6,double
Freque,F-fix7,freque.f_fix7,double
Freque,Fr-min,freque.fr_min,double
Freque,Fr-max,freque.fr_max,double
Speed,OpMode,speed.op_mode,string
Speed,C-fix1,speed.c_fix1,double
Speed,C-fix2,speed.c_fix2,double
Speed,C-fix3,speed.c_fix3,double
Speed,C-fix4,speed.c_fix4,double
Speed,C-fix5,speed.c_fix5,double
Speed,C-fix6,speed.c_fix6,double
Speed,C-fix7,speed.c_fix7,double
Speed,Sp-min,speed.sp_min,double
Speed,Sp-max,speed.sp_max,double
Torque,OpMode,torque.op_mode,string
Torque,T-fix1,torque.t_fix1,double
Torque,T-fix2,torque.t_fix2,double
Torque,T-fix3,torque.t_fix3,double
Torque,T-fix4,torque.t_fix4,double
Torque,T-fix5,torque.t_fix5,double
Torque,T-fix6,torque.t_fix6,double
Torque,T-fix7,torque.t_fix7,double
Torque,Tq-min,torque.tq_min,double
Torque,Tq-max,torque.tq_max,double
Torque,Max-fr,torque.max_fr,double
PI Reg,OpMode,pi_reg.op_mode,string
PI Reg,R-fix1,pi_reg.r_fix1,double
PI Reg,R-fix2,pi_reg.r_fix2,double
PI Reg,R-fix3,pi_reg.r_fix3,double
PI Reg,R-fix4,pi_reg.r_fix4,double
PI Reg,R-fix5,pi_reg.r_fix5,double
PI Reg,R-fix6,pi_reg.r_fix6,double
PI Reg,R-fix7,pi_reg.r_fix7,double
PI Reg,Setmin,pi_reg.setmin,double
PI Reg,Setmax,pi_reg.setmax,double
PI Reg,Actmin,pi_reg.actmin,double
PI Reg,Actmax,pi_reg.actmax,double
PI Reg,T-min,pi_reg.t_min,integer
PI Reg,T-max,pi_reg.t_max,integer
PI Reg,RegAmp,pi_reg.reg_amp,integer
PI Reg,RegKp,pi_reg.reg_kp,double
PI Reg,RegTi,pi_reg.reg_ti,double
PI Reg,Min-fr,pi_reg.min_fr,double
PI Reg,Max-fr,pi_reg.max_fr,double
PI Reg,Unit,pi_reg.unit,string
PI Reg,AinAct,pi_reg.ain_act,string
Output,ReMode,output.re_mode,string
Output,ReFreq,output.re_freq,double
Output,V-Out,output.v_out,string
Output,V-Max,output.v_max,double
Output,F-Out,output.f_out,string
Output,F-Max,output.f_max,integer
Serial,BusType,serial.bus_type,string
Serial,Address,serial.address,integer
Serial,SiBaud,serial.si_baud,string
Serial,SiProt,serial.si_prot,string
Serial,SioTot,serial.sio_tot,double
Serial,AutoReset,serial.auto_reset,bool
Serial,AutoStop,serial.auto_stop,bool
Error,RstDly,error.rst_dly,integer
Error,TrTime,error.tr_time,integer
Error,AC Fail/AC Err,error.ac_fail_mode,string
Error,AC Fail/Delay,error.ac_fail_delay,double
Error,AC Fail/ErrCnt,error.ac_fail_err_cnt,integer
Error,AC Fail/IT-Gnd,error.ac_fail_it_gnd,bool
Error,Temp Hi/ErrCnt,error.temp_hi_err_cnt,integer
Error,PTC Temp/PTCTmp,error.ptc_temp_mode,string
Error,PTC Temp/ErrCnt,error.ptc_temp_err_cnt,integer
Error,OverLoad/OverLd,error.overload_mode,string
Error,OverLoad/ErrCnt,error.overload_err_cnt,integer
Error,OverLoad/F-Cool,error.overload_f_cool,integer
Error,OverLoad/S-Temp,error.overload_s_temp,integer
Error,Ain Fail/AinErr,error.ain_fail_mode,string
Error,AinFail/ErrCnt,error.ain_fail_err_cnt,integer
Error,DC Low/ErrCnt,error.dc_low_err_cnt,integer
Error,DC High/ErrCnt,error.dc_high_err_cnt,integer
Error,GND Fail/GndErr,error.gnd_fail_mode,string
Error,Short C/ErrCnt,error.short_c_err_cnt,integer
Error,ImagnLow/ImagLow,error.imagn_low_mode,string
Error,ImagnLow/ErrCnt,error.imagn_low_err_cnt,integer
Error,Cur Low/Cur Low,error.cur_low_mode,string
Error,Cur Low/ErrCnt,error.cur_low_err_cnt,integer
Error,Cur High/CurHigh,error.cur_high_mode,string
Error,Cur High/Delay,error.cur_high_delay,double
Error,Cur High/ErrCnt,error.cur_high_err_cnt,integer
Error,Run Fail/RunFail,error.run_fail_mode,string
Error,Run Fail/ErrCnt,error.run_fail_err_cnt,integer
"""
