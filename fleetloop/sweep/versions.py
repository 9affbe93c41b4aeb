"""What must be the same in all processes that compute cases: a dataset is of one program.

Of Fleetloop it is the digest of its sources, too: a checkout has a version for a long time.
"""

import platform
from collections.abc import Mapping
from functools import lru_cache
from hashlib import blake2b
from importlib.metadata import PackageNotFoundError, version

from fleetloop.packages import HOME, NAMES

_PACKAGES = ("fleetloop", "distributed", "numpy", "numba", "pyarrow")
_DIGITS = 12
ABSENT = "absent"

Versions = Mapping[str, str]


@lru_cache(maxsize=1)
def versions_here() -> dict[str, str]:
    """Of this process."""
    found = {"python": platform.python_version(), "sources": _digest()}
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = ABSENT
    return found


def mismatch(ours: Versions, theirs: Versions) -> str:
    """How others differ, in words; "" if they don't."""
    differing = [
        f"{name} {theirs.get(name, ABSENT)}, here {ours.get(name, ABSENT)}"
        for name in sorted({*ours, *theirs})
        if ours.get(name) != theirs.get(name)
    ]
    return "; ".join(differing)


def _digest() -> str:
    found = blake2b(digest_size=_DIGITS // 2)
    for package in ("fleetloop", *NAMES):
        for path in sorted((HOME / package).rglob("*.py")):
            found.update(str(path.relative_to(HOME)).encode())
            found.update(path.read_bytes())
    return found.hexdigest()
