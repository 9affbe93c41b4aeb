"""Patterns of texts in scenario, deployment and study files, with their remedies."""

NAME = r"^[a-z][a-z0-9_]*$"
FIRMWARE = r"^0\.6\.[0-9]{1,2}$"
ROUTER = r"^(tcp|tls|unixsock-stream)/.+"
ENDPOINT = r"^(tcp|tls)/.+:\d+$"
COLUMN = r"^[A-Za-z][A-Za-z0-9_]*$"
RUN = r"^[A-Za-z0-9][A-Za-z0-9_.+-]*$"

WORDS = {
    NAME: "must be of lower-case letters, digits and _, with a letter first, for example r1",
    FIRMWARE: "must be a firmware 0.6.x, for example 0.6.10",
    ROUTER: "must be tcp/HOST:PORT, tls/HOST:PORT or unixsock-stream/PATH",
    ENDPOINT: "must be tcp/HOST:PORT or tls/HOST:PORT, for example tcp/192.168.1.2:7447",
    COLUMN: "must be of letters, digits and _, with a letter first, for example body_mass_kg",
    RUN: "must be of letters, digits and _.+-, with a letter or digit first, for example lab",
}
