"""`fleetloop live [RUN]`: asks a run through its door for its page, or its Foxglove WebSocket."""

import webbrowser

from configs.errors import InfrastructureError, ScenarioError
from fleetloop.door.client import open_run
from fleetloop.launch.viewer import FOXGLOVE, PAGE
from fleetloop.terminal import say, say_json


def open_page(run: str, *, show: bool, as_json: bool) -> None:
    """Print the address of a run's page; `show`: in a browser, too.

    Raises:
        ScenarioError: there is no such run, or it can have no page.
        InfrastructureError: it doesn't answer, or there is no browser.
    """
    url = _open(run, PAGE, as_json=as_json)
    if show and not webbrowser.open(url):
        raise InfrastructureError("no browser is found on this machine")


def open_stream(run: str, *, show: bool, as_json: bool) -> None:
    """Print the address of a run's Foxglove WebSocket.

    Raises:
        ScenarioError: there is no such run, it can have none, or a browser is asked for.
        InfrastructureError: it doesn't answer.
    """
    if show:
        raise ScenarioError(
            "--open --foxglove: no browser shows it; open the address in Foxglove or Lichtblick"
        )
    _open(run, FOXGLOVE, as_json=as_json)


def _open(run: str, view: str, *, as_json: bool) -> str:
    """Print and return the address of a view of a run."""
    with open_run(run) as client:
        url: str = client.ask("live.open", view=view)["url"]
        name = client.run
    if as_json:
        say_json({"run": name, "url": url})
    else:
        say(url)
    return url
