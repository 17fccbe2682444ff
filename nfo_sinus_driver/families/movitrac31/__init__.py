# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


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
