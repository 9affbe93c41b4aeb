"""`fleetloop` with a launcher that tells a test the logins of its run; else as users start it."""

import json
import os
import sys
from pathlib import Path

from bridge.network.access import AccessPlan
from fleetloop.cli import main
from fleetloop.launch import placement

made = placement.access_plan


def telling(scenario, deployment, run: str) -> AccessPlan:
    plan = made(scenario, deployment, run)
    told = Path(os.environ["FLEETLOOP_TEST_LOGINS"])
    told.with_suffix(".new").write_text(json.dumps([run, dict(plan.passwords)]))
    told.with_suffix(".new").rename(told)
    return plan


placement.access_plan = telling
sys.exit(main())
