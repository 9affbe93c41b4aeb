"""The process of one job: it takes the job from standard input and tells of it on a pipe."""

import sys
from multiprocessing.connection import Connection

from bridge.process.lifecycle import Stop, serve
from fleetloop.jobs.job import Brief, Done

NAME = "job"


def main() -> int:
    """Do the job; its exit status."""
    return serve(Brief, _work, name=NAME)


def _work(brief: Brief, stop: Stop) -> str | None:
    with Connection(brief.tell_fd, readable=False) as pipe:
        done = brief.job.work(pipe.send, stop)
        if not stop.requested:
            pipe.send(Done(done))
    return None


if __name__ == "__main__":
    sys.exit(main())
