#!/usr/bin/env bash
# The documentation site into dist/site; a wrong link or anchor ends it with an error.
# What it needs is in an environment of its own, which the one of the code doesn't see. Without a
# package index and without these packages in uv's cache nothing is built, which only CI minds.
set -euo pipefail
cd "$(dirname "$0")/../.."
site=(timeout --foreground 300 uv run --isolated --quiet --only-group docs)
if ! "${site[@]}" python -c 'import mkdocs'; then
    echo "docs: the packages of group docs can't be had; the site is not built" >&2
    [[ -z ${CI:-} ]]
    exit
fi
NO_MKDOCS_2_WARNING=1 "${site[@]}" mkdocs build --strict --quiet
