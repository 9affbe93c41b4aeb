"""`python -m fleetloop` is `fleetloop`."""

from fleetloop.cli import main

main()
