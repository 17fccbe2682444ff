# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
ROS 2 and nothing else: parameters, topics, services, action, diagnostics, lifecycle.

**A motor must stop whatever rclpy does.** Nothing that stops a motor waits for ROS: the bus worker
runs in its own thread, a signal is taken before ROS is loaded, and a publisher that blocks, a full
pipe of the terminal or a dead disk delays no transaction. When the worker, the publish queue, the
set-point subscriber or an executor ends unexpectedly, the process stops the motors and ends.

**What callbacks may do.** A set-point is stored, not sent; its subscriber has a thread of its own,
for a service that waits must not delay it. A service calls a method of
:class:`~nfo_sinus_driver.drive.Drive` and waits for its future in a pool of threads, in a group
that waits for nothing else. A stop never waits for an enable.

Each of these has a file for it:

- A call costs more the more entities its executor has: one executor for each node.
- Publishing may block on a slow subscriber: all of it, and all that is periodic, runs in
  :mod:`.ros.publish_queue`, which keeps the newest ten of a stream.
- A terminal that is not read blocks the process that writes to it: :mod:`.ros.nonblocking_stdio`.
- rclpy accepts a field of a wrong type and ends the process in C: the check in Python is turned on
  (below).
- What rclpy does not promise but is needed stands in :mod:`.ros.rclpy_internals` alone.
- Requests may overtake each other in the middleware: an enable that was requested before a
  confirmed stop is refused (``requested_at``).

**Nothing is half-done.** A change of a parameter is checked, written, read back and only then
accepted; a refused one leaves node and drive as they were. A node that cannot be configured says
which parameter, why, and what to set.

Requests and answers of services are those of :class:`~nfo_sinus_driver.drive.Drive`; what each
guarantees stands there. Sentences are made here and in ``cli/``, where it is known what the user
calls or types.
"""

import os

# A field of a wrong type would end the whole process by an assertion in C, with the motors
# running; checked in Python it is an exception. It is read when the messages are imported.
os.environ.setdefault('ROS_PYTHON_CHECK_FIELDS', '1')
