"""News is said once."""

from plant.herald import Herald


def test_each_news_is_said_once_and_later_ones_too() -> None:
    happened: dict[str, str] = {}
    said: list[str] = []
    herald = Herald(lambda: happened, said.append)
    herald.look()
    happened["r1"] = "its motion diverged"
    herald.look()
    happened["bus r2"] = "went down"
    herald.look()
    herald.look()
    assert said == ["r1: its motion diverged", "bus r2: went down"]
