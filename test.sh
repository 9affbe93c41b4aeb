#!/usr/bin/env bash
# Everything that has to hold, in the order of cost; stops at the first failure.
# Run as `uv run ./test.sh`; arguments go to pytest, e.g. `uv run ./test.sh -m 'not system'`.
set -euo pipefail
cd "$(dirname "$0")"
ruff format --check .
ruff check .
mypy
lint-imports
pytest "$@"
