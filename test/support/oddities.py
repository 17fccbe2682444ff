# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Made-up files that describe drives: a plain one, and in what others differ from it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

PLAIN: dict[str, Any] = yaml.safe_load("""
vfd: 1
title: Odd
source: made up
control:
  run: [{register: 10, value: 1}]
  stop: [{register: 10, value: 0}]
  reset: [{register: 10, value: 8}, {register: 10, value: 0}]
setpoint: {register: 11, type: int16, factor: 0.1, unit: Hz, most: 60, signed: true}
status:
  register: 20
  running: {bit: 0}
  fault: {bit: 3}
measured:
  actual_frequency: {register: 22, type: int16, factor: 0.1}
faults:
  register: 21
  codes: {1: {text: hot, remedy: Let it cool}, 195: {text: odd}}
parameters:
  ramp.accel: {register: 30, factor: 0.1, unit: s, minimum: 0.1, maximum: 60, default: 5}
  ramp.decel: {register: 31, factor: 0.1, unit: s, minimum: 0.1, maximum: 60, default: 5}
simulated: {accel: ramp.accel, decel: ramp.decel}
""")

ODD: dict[str, dict[str, Any]] = {
    'plain': {},
    'coils': {
        'control': {
            'run': [{'coil': 2, 'on': True}],
            'stop': [{'coil': 2, 'on': False}],
            'reset': [{'coil': 3, 'on': True}, {'coil': 3, 'on': False}],
        },
        'setpoint': {
            'register': 11, 'factor': 0.1, 'unit': 'Hz', 'most': 60,
            'direction': {'coil': 4, 'forward': 0, 'reverse': 1},
        },
        'status': {'running': {'coil': 16}, 'fault': {'coil': 19}, 'reverse': {'coil': 20}},
        'faults': {},
        'measured': {'actual_frequency': {'register': 22, 'factor': 0.1}},
    },
    'edges': {
        'control': {
            'run': [{'coil': 2, 'on': True}, {'coil': 2, 'on': False}],
            'stop': [{'coil': 3, 'on': True}, {'coil': 3, 'on': False}],
            'reset': [{'coil': 4, 'on': True}, {'coil': 4, 'on': False}],
        },
    },
    'bits of a kept word': {
        'control': {
            'run': [{'register': 10, 'set': 1}],
            'stop': [{'register': 10, 'clear': 1}],
            'reset': [{'register': 10, 'set': 8}, {'register': 10, 'clear': 8}],
        },
    },
    'several in one message': {
        'control': {
            'run': [{'register': 9, 'values': [7, 1]}],
            'stop': [{'register': 9, 'values': [7, 0]}],
            'coast': [{'register': 9, 'values': [0, 2]}],
            'reset': [{'register': 10, 'value': 8}, {'register': 10, 'value': 0}],
        },
    },
    'steps that wait': {
        'control': {
            'prepare': [{'register': 10, 'value': 6}],
            'run': [
                {'register': 10, 'value': 6}, {'until': {'bits': [4, 6], 'value': 1}},
                {'register': 10, 'value': 7}, {'until': {'bits': [4, 6], 'value': 3}},
                {'wait': 0.2}, {'register': 10, 'value': 15},
            ],
            'stop': [{'register': 10, 'value': 6}],
            'reset': [
                {'register': 10, 'value': 128}, {'until': {'bit': 3, 'is': 0}, 'within': 0.5},
                {'register': 10, 'value': 0},
            ],
        },
    },
    'a run that writes settings, too': {
        'control': {
            'run': [
                {'parameter': 'motor.fan', 'to': 'Up'}, {'parameter': 'motor.level', 'to': 70000},
                {'register': 10, 'value': 1},
            ],
            'stop': [{'register': 10, 'value': 0}],
            'reset': [{'register': 10, 'value': 8}, {'register': 10, 'value': 0}],
        },
        'parameters': {
            **PLAIN['parameters'],
            'motor.fan': {'coil': 3, 'choices': {0: 'Down', 1: 'Up'}},
            'motor.level': {'register': 34, 'type': 'uint32'},
        },
    },
    'function 16 alone': {'line': {'write': 16}},
    'function 06 alone': {'line': {'write': 6, 'most_registers': 2}},
    'input registers': {
        'measured': {
            'actual_frequency': {'register': 22, 'type': 'int16', 'factor': 0.1, 'table': 'input'},
        },
    },
    'two registers, the low one first': {
        'measured': {
            'actual_frequency': {
                'register': 22, 'type': 'int32', 'order': 'low_first', 'factor': 0.001,
            },
        },
        'setpoint': {
            'register': 11, 'type': 'int32', 'order': 'low_first', 'factor': 0.001, 'unit': 'Hz',
            'most': 60, 'signed': True,
        },
    },
    'a status of input registers': {'status': {**PLAIN['status'], 'table': 'input'}},
    'a fault far away': {'faults': {'register': 900, 'codes': {1: {'text': 'hot'}}}},
    'faults as bits': {
        'faults': {
            'flags': [
                {'register': 21, 'bit': 0, 'text': 'hot'}, {'register': 21, 'bit': 1, 'text': 'ov'},
            ],
        },
    },
    'a block with more': {
        'status': {
            'register': 20, 'running': {'bit': 0}, 'fault': {'register': 24, 'bit': 3},
            'block': {'register': 20, 'count': 5},
        },
        'faults': {},
        'measured': {},
    },
    'rpm': {
        'setpoint': {
            'register': 11, 'type': 'int16', 'factor': 1, 'unit': 'rpm', 'most': 1800,
            'signed': True,
        },
        'measured': {
            'actual_speed': {'register': 23, 'type': 'int16'},
            'actual_frequency': {'register': 22, 'type': 'int16', 'factor': 0.1},
        },
    },
    'a set-point that is not read': {
        'setpoint': {
            'register': 11, 'type': 'int16', 'factor': 0.1, 'unit': 'Hz', 'most': 60,
            'signed': True, 'access': 'w',
        },
    },
    'a set-point that is read elsewhere': {
        'setpoint': {
            'register': 11, 'type': 'int16', 'factor': 0.1, 'unit': 'Hz', 'most': 60,
            'signed': True, 'read_register': 12,
        },
    },
    'in parts of a parameter': {
        'setpoint': {
            'register': 11, 'type': 'int16', 'factor': '1/10000', 'scaled_by': 'limit.maximum',
            'limit': 'limit.maximum', 'unit': 'Hz', 'most': 60, 'signed': True,
        },
        'parameters': {
            **PLAIN['parameters'],
            'limit.maximum': {'register': 40, 'factor': 0.1, 'unit': 'Hz', 'default': 55},
        },
    },
    'a size in parts of a parameter': {
        'setpoint': {
            'register': 11, 'factor': '1/10000', 'scaled_by': 'limit.maximum',
            'limit': 'limit.maximum', 'unit': 'Hz', 'most': 60,
            'direction': {'register': 12, 'forward': 1, 'reverse': 2},
        },
        'status': {**PLAIN['status'], 'reverse': {'bit': 1}},
        'measured': {
            'actual_frequency': {'register': 22, 'factor': '1/10000', 'scaled_by': 'limit.maximum'},
        },
        'parameters': {
            **PLAIN['parameters'],
            'limit.maximum': {'register': 40, 'factor': 0.1, 'unit': 'Hz', 'default': 55},
        },
    },
    'a parameter tells who has control': {
        'control': {
            **PLAIN['control'],
            'holder': {'parameter': 'source.command', 'bus': ['Bus', 'Both']},
            'requires': [{'parameter': 'source.command', 'value': 'Bus', 'write': True}],
        },
        'parameters': {
            **PLAIN['parameters'],
            'source.command': {
                'register': 41, 'choices': {0: 'Keypad', 1: 'Bus', 2: 'Both'}, 'default': 'Keypad',
            },
        },
    },
    'the status tells who has control': {
        'status': {
            'register': 20, 'running': {'bit': 0}, 'fault': {'bit': 3}, 'local': {'bit': 9},
            'alarm': {'bit': 7}, 'stopping': {'bit': 4},
        },
    },
    'pulses of coils': {
        'control': {
            'run': [{'pulse': 73}],
            'stop': [{'pulse': 75}],
            'reset': [{'pulse': 80}],
        },
        'setpoint': {
            'register': 11, 'factor': 0.1, 'unit': 'Hz', 'most': 60,
            'direction': {'pulse': True, 'forward': 73, 'reverse': 74},
        },
        'status': {**PLAIN['status'], 'reverse': {'bit': 1}},
        'measured': {'actual_frequency': {'register': 22, 'factor': 0.1}},
    },
    'two words to one register': {
        'control': {
            'run': [{'register': 10, 'value': 8}],
            'stop': [{'register': 10, 'value': 4}],
            'reset': [{'register': 10, 'value': 1}],
        },
        'setpoint': {
            'register': 11, 'factor': 0.1, 'unit': 'Hz', 'most': 60,
            'direction': {'register': 10, 'forward': 0x80, 'reverse': 0x40, 'alone': True},
        },
        'status': {**PLAIN['status'], 'reverse': {'bit': 1}},
        'measured': {'actual_frequency': {'register': 22, 'factor': 0.1}},
    },
    'a set-point that is the command': {
        'control': {'run_by': 'setpoint', 'reset': [{'register': 10, 'value': 8}]},
    },
    'terminals that start': {
        'control': {'run_by': 'terminals', 'reset': [{'register': 10, 'value': 8}]},
    },
    'printed from 40001': {
        'line': {'numbering': 40001},
        'control': {
            'run': [{'register': 40011, 'value': 1}],
            'stop': [{'register': 40011, 'value': 0}],
            'reset': [{'register': 40011, 'value': 8}, {'register': 40011, 'value': 0}],
        },
        'setpoint': {
            'register': 40012, 'type': 'int16', 'factor': 0.1, 'unit': 'Hz', 'most': 60,
            'signed': True,
        },
        'status': {'register': 40021, 'running': {'bit': 0}, 'fault': {'bit': 3}},
        'measured': {'actual_frequency': {'register': 40023, 'type': 'int16', 'factor': 0.1}},
        'faults': {}, 'simulated': {},
        'parameters': {'motor.speed': {'register': 40031}},
    },
}


def described(tmp_path: Path, **otherwise: Any) -> Path:
    """Return the file of a drive."""
    path = tmp_path / 'odd.vfd.yaml'
    path.write_text(yaml.safe_dump({**PLAIN, **otherwise}), encoding='utf-8')
    return path
