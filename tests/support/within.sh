#!/usr/bin/env bash
# Run a command under a bound that its own hang can't outlast: tests/support/within.sh 40m pytest ...
# At the bound it is aborted, on which Python's faulthandler says where every thread is even if none
# runs Python any more, and killed if that doesn't end it.
set -uo pipefail
bound=$1
shift
ulimit -c 0
timeout --foreground --signal=ABRT --kill-after=20s "$bound" "$@"
status=$?
if [[ $status == 124 || $status == 137 ]]; then
    echo "tests/support/within.sh: HANGS: not done after $bound, killed: $*" >&2
fi
exit "$status"
