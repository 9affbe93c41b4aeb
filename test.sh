#!/usr/bin/env bash
# Everything that has to hold, in the order of cost; stops at the first failure.
# Run as `uv run --group dev ./test.sh`; arguments go to pytest, e.g. `-m 'not system'`, or
# `-m 'not wall_clock'` on a machine that others keep busy. Without any, what needs a kernel with CAN
# runs as well, in a guest if there is a tool for one.
set -euo pipefail
cd "$(dirname "$0")"
ruff format --check .
ruff check .
mypy
lint-imports
docs/site/build.sh || [[ $? == 69 ]] # where its packages can't be had, it says so
# The browser of the live page's tests, where it may be installed; they are skipped without.
if ! command -v chromium >/dev/null && [[ $EUID -eq 0 ]] && command -v apt-get >/dev/null; then
    timeout 180 apt-get install -qq -y --no-install-recommends chromium >/dev/null 2>&1 || true
fi
# A hang ends red long before CI's patience does.
if [[ $# -gt 0 ]]; then
    tests/support/within.sh 60m pytest "$@"
    exit
fi
# What starts processes or promises something about time runs one test at a time: two at once keep
# each other from it. All else, with a worker for each of two processors.
tests/support/within.sh 30m pytest -n 2 -m 'not system and not wall_clock'
tests/support/within.sh 40m pytest -n 0 -m 'system or wall_clock'
tests/support/within.sh 30m tests/socketcan/in_guest.sh
