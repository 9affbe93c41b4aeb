"""`fleetloop init`: write the commented starter scenario that the package ships."""

from importlib import resources
from pathlib import Path

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.terminal import say


def write_starter(file: Path) -> None:
    """Write the starter scenario to `file`.

    Raises:
        ScenarioError: the file exists already.
        InfrastructureError: it can't be written.
    """
    text = resources.files("configs").joinpath("starter.toml").read_text("utf-8")
    try:
        with file.open("x", encoding="utf-8") as stream:
            stream.write(text)
    except FileExistsError as error:
        raise ScenarioError(f"{file}: exists already; name a new file") from error
    except OSError as error:
        raise InfrastructureError(f"can't write {file}: {error.strerror}") from error
    say(f"wrote {file}\nnext: fleetloop check {file}\n      fleetloop run {file}")
