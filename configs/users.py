"""Files of passwords: lines identity:password, readable by their owner alone."""

from pathlib import Path
from typing import TYPE_CHECKING

from configs.errors import ScenarioError

if TYPE_CHECKING:
    from configs.deployment import NetworkSection


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


def passwords(network: "NetworkSection | None", identities: tuple[str, ...]) -> dict[str, str]:
    """The passwords of these identities from the deployment's file.

    With certificates of another authority they prove the identity: the password is the name again.

    Raises:
        ScenarioError: the file can't be read, is readable by others, or lacks an identity.
    """
    if network is None or not identities:
        return {}
    if network.tls is not None:
        return {identity: identity for identity in identities}
    path = network.users
    if path is None:
        raise ScenarioError(
            "network.users = (missing): name a file with a line identity:password for each of"
            f" {', '.join(identities)}, or give network.certificates"
        )
    known = read_users(path, "network.users")
    if absent := [identity for identity in identities if not known.get(identity)]:
        raise ScenarioError(f"network.users = {path}: no line {absent[0]}:<password>")
    return {identity: known[identity] for identity in identities}
