"""What the launcher makes of roles that somebody else started."""

from bridge.network.reports import Report
from fleetloop.launch.child import CRASHED, GAVE_UP
from fleetloop.launch.remote_roles import GRACE_S, RemoteRoles

R2 = "agent/r2"


def test_who_has_not_come_is_absent() -> None:
    far = RemoteRoles([R2, "agent/r3"])
    far.note_token(R2, 0.0, there=True)
    far.note_token("plant", 0.0, there=True)
    assert far.absent() == ["agent/r3"]
    assert not far.ended(9.0)


def test_without_roles_elsewhere_nobody_is_missed() -> None:
    nobody = RemoteRoles([])
    assert nobody.ended(0.0)
    assert nobody.absent() == []
    assert nobody.failure(1e9) is None


def test_a_report_is_an_end_and_its_failure_the_runs() -> None:
    far = RemoteRoles([R2])
    far.note_token(R2, 0.0, there=True)
    far.note_report(R2, Report())
    assert far.ended(9.0)
    assert far.failure(1.0) is None
    far.note_report(R2, Report(failure="r2: lost its bus"))
    failure = far.failure(1.0)
    assert (failure.rank, failure.name, failure.text) == (GAVE_UP, R2, "r2: lost its bus")


def test_a_token_that_goes_without_a_report_is_a_loss_after_a_grace() -> None:
    far = RemoteRoles([R2])
    far.note_token(R2, 0.0, there=True)
    far.note_token(R2, 1.0, there=False)
    assert far.failure(1.0 + 0.9 * GRACE_S) is None
    failure = far.failure(1.0 + 1.1 * GRACE_S)
    assert failure.rank == CRASHED
    assert failure.text.startswith("agent/r2: lost")


def test_a_token_that_comes_back_is_no_loss() -> None:
    far = RemoteRoles([R2])
    far.note_token(R2, 0.0, there=True)
    far.note_token(R2, 1.0, there=False)
    far.note_token(R2, 1.2, there=True)
    assert far.failure(9.0) is None
    assert not far.ended(9.0)


def test_who_may_rejoin_is_named_once_and_lost_only_after_that_time() -> None:
    far = RemoteRoles([R2], rejoin_s=5.0)
    far.note_token(R2, 0.0, there=True)
    far.note_token(R2, 1.0, there=False)
    assert far.newly_cut_off(1.0 + 0.9 * GRACE_S) == []
    assert far.newly_cut_off(1.0 + 1.1 * GRACE_S) == [R2]
    assert far.newly_cut_off(3.0) == []
    assert far.failure(5.9) is None
    assert not far.ended(5.9)
    assert far.note_token(R2, 5.9, there=True) == 5.9 - 1.0
    assert far.failure(99.0) is None
    far.note_token(R2, 100.0, there=False)
    assert far.failure(105.1).rank == CRASHED
    assert far.ended(105.1)


def test_who_has_said_its_last_word_is_not_cut_off() -> None:
    far = RemoteRoles([R2], rejoin_s=5.0)
    far.note_token(R2, 0.0, there=True)
    far.note_report(R2, Report())
    far.note_token(R2, 1.0, there=False)
    assert far.newly_cut_off(4.0) == []
    assert far.ended(1.0)
