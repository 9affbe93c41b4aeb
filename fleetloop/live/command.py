"""`fleetloop live [RUN]`: asks a run through its door for its page."""

import webbrowser

from configs.errors import InfrastructureError
from fleetloop.door.client import open_run
from fleetloop.terminal import say, say_json


def open_page(run: str, *, show: bool, as_json: bool) -> None:
    """Print the address of a run's page; `show`: in a browser, too.

    Raises:
        ScenarioError: there is no such run, or it can have no page.
        InfrastructureError: it doesn't answer, or there is no browser.
    """
    with open_run(run) as client:
        url: str = client.ask("live.open")["url"]
        name = client.run
    if as_json:
        say_json({"run": name, "url": url})
    else:
        say(url)
    if show and not webbrowser.open(url):
        raise InfrastructureError("no browser is found on this machine")
