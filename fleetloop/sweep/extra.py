"""The packages that only sweeps and tunings need: extra `sweep`."""

from functools import lru_cache
from importlib.util import find_spec

from configs.errors import ScenarioError

PACKAGES = ("distributed", "pyarrow", "scipy")


@lru_cache(maxsize=16)
def require(*packages: str, verb: str = "sweep") -> None:
    """Refuse to go on without these.

    Args:
        packages: by their modules' names.
        verb: that needs them.

    Raises:
        ScenarioError: one isn't installed; the text says what to do.
    """
    missing = [package for package in packages if find_spec(package) is None]
    if missing:
        raise ScenarioError(
            f"fleetloop {verb} needs {' and '.join(missing)}: pip install 'fleetloop[sweep]'"
        )
