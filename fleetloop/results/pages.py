"""The pages that Fleetloop writes: one head, one style, two themes, and nothing that is fetched.

Whatever a user named is escaped here: callers hand texts, or HTML that this module made.
"""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from string import Template

from fleetloop.results.palette import theme_css

_PAGE = Template("""\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
$style
</style>
$head
</head>
<body>
<header><h1>$title</h1>
<button id="theme" type="button" title="dark or light">◐ theme</button></header>
<p>$subtitle</p>
$body
<script>$script</script>
</body>
</html>
""")


def page(title: str, subtitle: str, body: str, *, style: str = "", head: str = "") -> str:
    """A page.

    Args:
        title: text.
        subtitle: text.
        body: HTML.
        style: CSS beside that of all pages.
        head: HTML.
    """
    return _PAGE.substitute(
        title=escape(title),
        subtitle=escape(subtitle),
        body=body,
        style="\n".join((theme_css(), resource("pages.css"), style)),
        head=head,
        script=resource("pages.js"),
    )


def resource(name: str) -> str:
    """A file beside this module."""
    return resources.files("fleetloop.results").joinpath(name).read_text("utf-8")


def table_tag(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; one of two columns is text."""
    css = ' class="text"' if len(header) == 2 else ""
    head = "".join(f"<th{css}>{escape(cell)}</th>" for cell in header)
    lines = ("".join(f"<td{css}>{escape(cell)}</td>" for cell in row) for row in rows)
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def figure_tag(caption: str, png: bytes, *, across: bool = False, narrow: bool = False) -> str:
    """A picture with its caption; on paper one `across` is as wide as the page.

    One that is `narrow`, as wide as a column, has the same scale on a screen as wider ones.
    """
    text = escape(caption)
    source = f"data:image/png;base64,{base64.b64encode(png).decode()}"
    names = " ".join(name for name, is_so in (("across", across), ("narrow", narrow)) if is_so)
    css = f' class="{names}"' if names else ""
    return f'<figure{css}><img alt="{text}" src="{source}"><figcaption>{text}</figcaption></figure>'


def list_tag(lines: Iterable[str], css: str = "") -> str:
    """A list of texts; nothing without any."""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<ul class="{css}">{items}</ul>' if items else ""
