"""The number of files that a run needs open at once, against this user's limit.

The launcher has two pipes and a network connection for each role; the plant has two sockets for
each bus, and one for every further client.
"""

import resource

from configs.errors import InfrastructureError

PER_ROLE, BESIDES = 3, 64
PLENTY = 65_536


def ensure(roles: int) -> None:
    """Raise this process's limit, which children inherit, as far as this user may.

    Raises:
        InfrastructureError: it is too low for that many roles.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = PLENTY if hard == resource.RLIM_INFINITY else hard
    if 0 <= soft < (limit := min(most, PLENTY)):
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))
    needed = PER_ROLE * roles + BESIDES
    if 0 <= hard < needed:
        raise InfrastructureError(
            f"{roles} processes need {needed} open files at once, the limit of this user is {hard}:"
            f" raise it (ulimit -n {needed}), or run fewer robots"
        )
