"""Files of passwords: lines identity:password, readable by their owner alone."""

from pathlib import Path

from configs.errors import ScenarioError


def read_users(path: Path, what: str) -> dict[str, str]:
    """Passwords by identity; `what` names the setting in messages.

    Raises:
        ScenarioError: the file can't be read, or others may read it.
    """
    try:
        text = path.read_text("utf-8")
        mode = path.stat().st_mode
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScenarioError(f"{what} = {path}: {reason}") from error
    if mode & 0o077:
        raise ScenarioError(f"{what} = {path}: others may read it; chmod 600 {path}")
    rows = [row.partition(":") for row in text.splitlines() if ":" in row]
    # Zenoh takes no spaces around a password, and people put one behind a colon.
    return {identity.strip(): password.strip() for identity, _, password in rows}
