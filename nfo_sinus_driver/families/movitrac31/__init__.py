# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
SEW MOVITRAC 31.. on its serial line [M4].

The groups of its parameters are the manual's chapters: ``setpoint`` and ``ramp`` (P100 to P185),
``frequency``, ``motor``, ``reference``, ``monitoring`` (P500 to P572), ``terminal``, ``control``
(P710 to P779), ``special`` (P800 to P891), ``ipos``, and ``status`` for all that is only shown.
Apart from them stand

- ``serial``: what ends or disturbs the communication (P841 to P843, P870, P880), and the PC
  time-out;
- ``fieldbus``: function bits, remote set-point and status word, and what acts when it is written:
  factory setting (P830), loading and saving IPOS programs, and their start. None of it is a
  setting.

What can be negative is only read, for the coding of a sign in packed digits is not known [C105];
so is what has eight bytes. A setting whose column ``option`` names cards is there, or does
something, only with one of them.
"""
