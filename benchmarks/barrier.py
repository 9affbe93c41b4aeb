"""The reference for lockstep in Python: a full barrier over Unix sockets, and nothing else.

One process sends 4 doubles to each of N others and waits for 2 doubles from each: a round. No law,
no physics, no CAN, no network, no record.
"""

import os
import select
import socket
import struct
import time

OUT, BACK = struct.Struct("<4d"), struct.Struct("<2d")


def rounds_per_second(n: int, seconds: float, *, pinned: bool) -> float:
    """Rounds per second with N answering processes, on one core or as the scheduler likes."""
    before = os.sched_getaffinity(0)
    if pinned:
        os.sched_setaffinity(0, {min(before)})
    ends = [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(n)]
    children = [_start(ends, k) for k in range(n)]
    try:
        for _, theirs in ends:
            theirs.close()
        ours = [end for end, _ in ends]
        _rounds(ours, 200)
        count, began = 0, time.perf_counter()
        while time.perf_counter() - began < seconds:
            _rounds(ours, 200)
            count += 200
        return count / (time.perf_counter() - began)
    finally:
        for end, _ in ends:
            end.close()
        for child in children:
            os.waitpid(child, 0)
        os.sched_setaffinity(0, before)


def _start(ends: list[tuple[socket.socket, socket.socket]], k: int) -> int:
    child = os.fork()
    if child:
        return child
    for n, (ours, theirs) in enumerate(ends):
        ours.close()
        if n != k:
            theirs.close()
    mine = ends[k][1]
    while data := mine.recv(64):
        a, b, _, _ = OUT.unpack(data)
        mine.send(BACK.pack(a + b, a - b))
    os._exit(0)


def _rounds(ours: list[socket.socket], count: int) -> None:
    poller = select.epoll()
    by_fd = {end.fileno(): end for end in ours}
    for fd in by_fd:
        poller.register(fd, select.EPOLLIN)
    message = OUT.pack(1.0, 2.0, 3.0, 4.0)
    for _ in range(count):
        for end in ours:
            end.send(message)
        waiting = len(ours)
        while waiting:
            for fd, _ in poller.poll():
                BACK.unpack(by_fd[fd].recv(64))
                waiting -= 1
    poller.close()
