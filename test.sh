#!/usr/bin/env bash
# Everything that has to hold, in the order of cost; stops at the first failure.
# Run as `uv run ./test.sh`; arguments go to pytest, e.g. `uv run ./test.sh -m 'not system'`, `-n 2`
# with two workers, or `-m 'not wall_clock'` on a machine that others keep busy. Without any, what needs
# a kernel with CAN runs as well, in a guest if there is a tool for one.
set -euo pipefail
cd "$(dirname "$0")"
ruff format --check .
ruff check .
mypy
lint-imports
# Both take minutes; a hang ends red long before CI's patience does. One test at a time: many promise
# something about time, and two at once keep each other from it. What fails is tried once more, alone.
status=0
tests/support/within.sh 50m pytest -n 0 "$@" || status=$?
if [[ $status -eq 1 ]]; then
    echo "tried again: the tests that failed"
    tests/support/within.sh 20m pytest "$@" --last-failed -n 0
elif [[ $status -ne 0 ]]; then
    exit "$status"
fi
if [[ $# -eq 0 ]]; then
    tests/support/within.sh 30m tests/socketcan/in_guest.sh
fi
