"""The packages that only sweeps need: extra `sweep`."""

from functools import lru_cache
from importlib.util import find_spec

from configs.errors import ScenarioError

PACKAGES = ("distributed", "pyarrow", "scipy")


@lru_cache(maxsize=16)
def require(*packages: str) -> None:
    """Refuse to go on without these.

    Raises:
        ScenarioError: one isn't installed; the text says what to do.
    """
    missing = [package for package in packages if find_spec(package) is None]
    if missing:
        raise ScenarioError(
            f"fleetloop sweep needs {' and '.join(missing)}: pip install 'fleetloop[sweep]'"
        )
