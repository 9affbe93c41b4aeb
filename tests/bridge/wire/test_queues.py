"""Transmit queues and the receive FIFO."""

import pytest

from bridge.frame import Frame
from bridge.wire.bits import arbitration_key, frame_bits
from bridge.wire.queues import Entry, Fifo, Mailboxes, Queue


def filled(queue: Queue, *can_ids: int) -> list[bool]:
    taken = []
    for number, can_id in enumerate(can_ids):
        frame = Frame(can_id, bytes([number]))
        entry = Entry(arbitration_key(can_id), number, frame, frame_bits(frame))
        taken.append(queue.push(entry))
    return taken


def order(queue: Queue) -> list[int]:
    return [entry.frame.can_id for entry in queue.entries]


def test_a_host_sends_in_its_own_order_whatever_the_identifiers() -> None:
    queue = Fifo(3)
    assert filled(queue, 0x30, 0x10, 0x20, 0x01) == [True, True, True, False]
    assert order(queue) == [0x30, 0x10, 0x20]


def test_mailboxes_send_the_lowest_identifier_first_and_equal_ones_in_order() -> None:
    queue = Mailboxes(3)
    assert filled(queue, 0x30, 0x10, 0x30) == [True, True, True]
    assert order(queue) == [0x10, 0x30, 0x30]
    assert [entry.number for entry in queue.entries] == [1, 0, 2]


def test_a_newer_frame_never_replaces_a_pending_one() -> None:
    queue = Mailboxes(3)
    assert filled(queue, 9, 9, 9, 9) == [True, True, True, False]
    assert [entry.frame.data[0] for entry in queue.entries] == [0, 1, 2]


@pytest.mark.parametrize("kind", [Fifo, Mailboxes])
def test_a_queue_without_room_for_one_frame_is_refused(kind: type) -> None:
    with pytest.raises(ValueError, match="1 or more"):
        kind(0)
