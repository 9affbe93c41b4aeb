"""`fleetloop` on a machine whose wall clock is ahead: SHIFT_S ARGUMENTS..."""

import sys
import time

from bridge.process.clock import SystemClock

_shift_ns = round(float(sys.argv.pop(1)) * 1e9)
SystemClock.wall_ns = staticmethod(lambda: time.time_ns() + _shift_ns)

from fleetloop.cli import main  # noqa: E402

sys.exit(main())
