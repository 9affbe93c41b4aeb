#!/usr/bin/env bash
# The documentation site into dist/site; a wrong link or anchor ends it with an error.
# What it needs is in an environment of its own, which the one of the code doesn't see. Without a
# package index and without these packages in uv's cache nothing is built: status 69, unavailable.
set -euo pipefail
cd "$(dirname "$0")/../.."
# Under `uv run`, UV is that uv, which needn't be on the PATH.
site=(timeout --foreground 300 "${UV:-uv}" run --isolated --quiet --only-group docs)
if ! "${site[@]}" python -c 'import mkdocs'; then
    echo "docs: the packages of group docs can't be had; the site is not built" >&2
    exit 69
fi
NO_MKDOCS_2_WARNING=1 "${site[@]}" mkdocs build --strict --quiet
