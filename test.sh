#!/usr/bin/env bash
# Everything that has to hold, in the order of cost; stops at the first failure.
# Run as `uv run ./test.sh`; arguments go to pytest, e.g. `uv run ./test.sh -m 'not system'`, `-n 0`
# without workers, or `-m 'not wall_clock'` on a machine that others keep busy. Without any, what needs
# a kernel with CAN runs as well, in a guest if there is a tool for one.
set -euo pipefail
cd "$(dirname "$0")"
ruff format --check .
ruff check .
mypy
lint-imports
# Both take minutes; a hang ends red long before CI's patience does.
tests/support/within.sh 40m pytest -n 2 --dist worksteal "$@"
if [[ $# -eq 0 ]]; then
    tests/support/within.sh 30m tests/socketcan/in_guest.sh
fi
