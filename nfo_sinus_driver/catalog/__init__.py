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

"""What the manuals say: tables and pure functions on them. No I/O beyond that, no ROS."""

from nfo_sinus_driver.catalog.dialect import Dialect
from nfo_sinus_driver.catalog.dialect import Fact
from nfo_sinus_driver.catalog.error_log import ERROR_LOG
from nfo_sinus_driver.catalog.error_log import ErrorLogArea
from nfo_sinus_driver.catalog.inv_st import InvStCode
from nfo_sinus_driver.catalog.inv_st import Kind
from nfo_sinus_driver.catalog.model import MODELS
from nfo_sinus_driver.catalog.model import Model
from nfo_sinus_driver.catalog.model import load_model
from nfo_sinus_driver.catalog.parameter import DEFAULT_SCALING
from nfo_sinus_driver.catalog.parameter import Access
from nfo_sinus_driver.catalog.parameter import Parameter
from nfo_sinus_driver.catalog.parameter import Place
from nfo_sinus_driver.catalog.parameter import Protocol
from nfo_sinus_driver.catalog.parameter import RawType
from nfo_sinus_driver.catalog.parameter import Scaling
from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.words import Control
from nfo_sinus_driver.catalog.words import Mode
from nfo_sinus_driver.catalog.words import Scmd
from nfo_sinus_driver.catalog.words import State
from nfo_sinus_driver.catalog.words import Status
from nfo_sinus_driver.catalog.words import state_of

__all__ = [
    'DEFAULT_SCALING',
    'ERROR_LOG',
    'MODELS',
    'Access',
    'Control',
    'Dialect',
    'ErrorLogArea',
    'Fact',
    'InvStCode',
    'Kind',
    'Mode',
    'Model',
    'Parameter',
    'Place',
    'Protocol',
    'RawType',
    'Scaling',
    'Scmd',
    'State',
    'Status',
    'Value',
    'load_model',
    'state_of',
]
