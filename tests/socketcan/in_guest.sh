#!/usr/bin/env bash
# tests/socketcan where the kernel has no CAN: in a guest that has.
#
# Needs a program that runs a command in such a guest, as `TOOL --engine uml|qemu --timeout S -- COMMAND`:
# FLEETLOOP_CAN_GUEST names it, else it is looked for beside the checkout. Debian packages that it
# needs are installed if this user may. What is missing is said in one line and skipped; a test that
# fails in the guest fails this script.
set -euo pipefail
cd "$(dirname "$0")/../.."

tool=${FLEETLOOP_CAN_GUEST:-$(compgen -G '../*/tools/can_vm.py' | head -n 1 || true)}
skip() { echo "tests/socketcan skipped: $*"; }
if [[ ! -x $tool ]]; then
    skip "no tool for a guest with CAN (FLEETLOOP_CAN_GUEST)"
    exit 0
fi
if [[ $(id -u) != 0 ]]; then
    skip "only root starts the guest"
    exit 0
fi
# The guest has to keep real time.
urgent=()
if nice -n -10 true 2>/dev/null; then urgent=(nice -n -10); fi

missing() { for program in "$@"; do command -v "$program" >/dev/null || echo "$program"; done; }

# engine, test file
run_in() {
    # Its root is the host's, read-only; memory is where temporary files can be.
    "${urgent[@]}" "$tool" --engine "$1" --timeout 420 -- \
        env TMPDIR=/dev/shm "$(command -v python)" -m pytest -p no:cacheprovider "$2"
}

# engine, test file, programs, Debian packages
in_guest() {
    local engine=$1 tests=$2 programs=$3 packages=$4 lacking
    # shellcheck disable=SC2086 # lists
    if [[ -n $(missing $programs) ]] && command -v apt-get >/dev/null; then
        timeout 300 bash -c "apt-get update -q && apt-get install -yq --no-install-recommends $packages" \
            >/dev/null 2>&1 || true
    fi
    # shellcheck disable=SC2086
    lacking=$(missing $programs | xargs)
    if [[ -n $lacking ]]; then
        skip "$tests: no $lacking"
    elif ! "${urgent[@]}" "$tool" --engine "$engine" --timeout 120 -- true >/dev/null 2>&1; then
        skip "$tests: the $engine guest does not start here"
    else
        run_in "$engine" "$tests" || {
            echo "$tests: once more: a guest that its host starves keeps no time"
            run_in "$engine" "$tests"
        }
    fi
}

in_guest uml tests/socketcan/test_vcan.py "linux.uml gcc candump cansend ip modprobe" \
    "user-mode-linux gcc libc6-dev can-utils iproute2 kmod"
in_guest qemu tests/socketcan/test_controllers.py "qemu-system-x86_64 busybox cpio candump ip modprobe" \
    "qemu-system-x86 busybox-static can-utils iproute2 kmod cpio"
