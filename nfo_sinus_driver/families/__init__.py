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


"""What the makers' manuals say: a folder for each drive family, which the catalog reads."""

#: The family of a drive of which nobody says what it is.
USUAL = 'sinus_g2'
#: A setting of such a drive, and a value, for help and documentation.
EXAMPLE = ('control.accel', 5.0)
