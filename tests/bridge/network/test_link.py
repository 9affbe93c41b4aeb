"""What waits for a reader: in order, in bounded memory, each subscription by itself."""

import threading

from bridge.network.link import MOST_WAITING, Arrival, Dropped, Inbox, Mailbox, waiting


def put(inbox: Inbox, tag: str, payloads: list[bytes], room_bytes: int) -> None:
    mailbox = inbox.mailbox("key", tag, room_bytes)
    for payload in payloads:
        mailbox("key", lambda payload=payload: payload, len(payload))


def drain(inbox: Inbox) -> list[Arrival]:
    found = []
    while (arrival := inbox.receive(0.0)) is not None:
        found.append(arrival)
    return found


def test_who_floods_his_key_crowds_out_nobody_else() -> None:
    inbox = Inbox()
    put(inbox, "flood", [bytes(1000)] * 10_000, room_bytes=100_000)
    put(inbox, "quiet", [b"a", b"b"], room_bytes=100_000)
    found = drain(inbox)
    assert [arrival.payload for arrival in found if arrival.tag == "quiet"] == [b"a", b"b"]
    kept = [arrival for arrival in found if arrival.tag == "flood"]
    assert sum(len(arrival.payload) for arrival in kept) <= 100_000
    assert inbox.dropped() == [Dropped("flood", "key", 10_000 - len(kept))]


def test_room_comes_back_with_what_is_taken() -> None:
    inbox = Inbox()
    mailbox = inbox.mailbox("key", "tag", 2000)
    for n in range(100):
        mailbox("key", lambda n=n: bytes([n]) * 500, 500)
        arrival = inbox.receive(0.0)
        assert arrival is not None
        assert arrival.payload == bytes([n]) * 500
    assert inbox.dropped() == []


def test_little_messages_are_bounded_by_their_number() -> None:
    box = Mailbox(1 << 40)
    assert [box.admit(1) for _ in range(MOST_WAITING + 2)] == [True] * MOST_WAITING + [False] * 2
    box.release(1)
    assert box.admit(1)
    assert box.dropped == 2


def test_a_single_message_always_finds_room() -> None:
    box = Mailbox(10)
    assert box.admit(1_000_000)
    assert not box.admit(1)
    box.release(1_000_000)
    assert box.admit(1)


def test_who_drains_comes_to_an_end_however_fast_others_say_more() -> None:
    class Flood:
        def receive(self, _: float) -> Arrival:
            return Arrival("tag", "key", b"")

    assert sum(1 for _ in waiting(Flood(), 100)) == 100


def test_of_what_replaces_itself_only_the_last_waits() -> None:
    inbox = Inbox()
    for n in range(10_000):
        inbox.put_latest(Arrival("live", f"key {n % 2}", b"1" if n % 3 else b"0"))
    last = {f"key {n % 2}": b"1" if n % 3 else b"0" for n in (9998, 9999)}
    assert {arrival.key: arrival.payload for arrival in drain(inbox)} == last
    inbox.put_latest(Arrival("live", "key 0", b"0"))
    assert drain(inbox) == [Arrival("live", "key 0", b"0")]


def test_who_waits_is_woken_by_another_thread() -> None:
    inbox = Inbox()
    late = threading.Timer(0.01, put, (inbox, "tag", [b"x"], 1000))
    late.start()
    arrival = inbox.receive(10.0)
    late.join()
    assert arrival == Arrival("tag", "key", b"x")
