"""Both ends of a robot's drives as the classes of `bridge.drives.interface`, whoever made them.

Controllers and plant call these classes directly. What a protocol of a user's own makes only has to
have their methods, or derives from them; it is wrapped: numbers may be of any type, what it shows
in attributes is copied after each call that may change it, and what it raises, or answers that is
none, ends the run with an error that names protocol, robot and method.
"""

from collections.abc import Callable, Sequence
from math import isfinite
from operator import index
from typing import Any, TypeVar

from bridge.drives import protocol
from bridge.drives.interface import DriveClient, DriveMeasurements, DriveNode, Motion
from bridge.frame import Frame, flaw
from configs.brief import DriveLink, DriveModel
from configs.errors import FleetloopError, InfrastructureError
from configs.plugins import Plugin, raised

T = TypeVar("T")
_SHIPPED = "bridge.drives."


def client_of(link: DriveLink, robot: str) -> DriveClient:
    """The controller's end of the drives of a robot.

    Raises:
        InfrastructureError: the protocol is a user's own, and its client can't be made.
    """
    own = Own(link.choice.plugin, f"client of {robot}")
    made = own.ask("constructor", protocol(link.choice.plugin).client, _any, link)
    return made if own.is_shipped else WrappedClient(made, own)


def node_of(model: DriveModel, node: int, serial_number: int, robot: str) -> DriveNode:
    """The emulated drive of one wheel of a robot.

    Raises:
        InfrastructureError: the protocol is a user's own, and its node can't be made.
    """
    own = Own(model.choice.plugin, f"node {node} of {robot}")
    make = protocol(model.choice.plugin).node
    made = own.ask("constructor", make, _any, model, node, serial_number)
    return made if own.is_shipped else WrappedNode(made, own)


class Own:
    """One end of a protocol, in the words of its errors; those of a shipped one are bugs, and stay.

    Args:
        plugin: where the protocol is.
        end: of it, in words.
    """

    def __init__(self, plugin: Plugin, end: str) -> None:
        self._of = f"drive protocol {plugin.name}, {end}"
        self.is_shipped = plugin.target.startswith(_SHIPPED)
        """Whether it is Fleetloop's, and makes the classes themselves."""

    def ask(
        self, what: str, method: Callable[..., Any], answer: Callable[[Any], T], *arguments: Any
    ) -> T:
        """What a method, or a function of the row, answers.

        Raises:
            InfrastructureError: it raises, or what it returns is no such answer.
        """
        try:
            returned = method(*arguments)
        except (Exception, SystemExit) as error:
            if self.is_shipped or isinstance(error, FleetloopError):
                raise
            raise InfrastructureError(f"{self._of}: {what} failed: {raised(error)}") from error
        return self.taken(what, answer, returned)

    def taken(self, what: str, answer: Callable[[Any], T], returned: object) -> T:
        """An answer, or the value of an attribute.

        Raises:
            InfrastructureError: it is none.
        """
        try:
            return answer(returned)
        except (TypeError, ValueError, AttributeError, LookupError, OverflowError) as error:
            if self.is_shipped:
                raise
            raise InfrastructureError(
                f"{self._of}: {what} gave {returned!r:.80}: {error}"
            ) from error

    def attribute(self, of: object, name: str, answer: Callable[[Any], T]) -> T:
        """The value of an attribute.

        Raises:
            InfrastructureError: it isn't there, or is no such value.
        """
        try:
            value = getattr(of, name)
        except AttributeError as error:
            raise InfrastructureError(f"{self._of}: {name}: {error}") from error
        except Exception as error:
            raise InfrastructureError(f"{self._of}: {name} failed: {raised(error)}") from error
        return self.taken(name, answer, value)


# --- what answers have to be ----------------------------------------------------------------------


def _any(value: Any) -> Any:
    if value is None:
        raise TypeError("nothing was made")
    return value


def _nothing(_: Any) -> None:
    return None


def _finite(value: Any) -> float:
    number = float(value)
    if not isfinite(number):
        raise ValueError("must be finite")
    return number


def _motion(value: Any) -> Motion | None:
    if value is None:
        return None
    right_rad, left_rad, right_rad_s, left_rad_s = map(_finite, value)
    return right_rad, left_rad, right_rad_s, left_rad_s


def _pair(value: Any) -> tuple[float, float]:
    right, left = map(float, value)
    return right, left


def _reason(value: Any) -> str | None:
    if value is None or isinstance(value, str):
        return value
    raise TypeError("must be a text, or None")


def _text(value: Any) -> str:
    if isinstance(value, str):
        return value
    raise TypeError("must be a text")


def _texts(value: Any) -> tuple[str, ...]:
    return tuple(map(_text, value))


def _time_ns(value: Any) -> int:
    return value if isinstance(value, int) else round(value)


def _frame(value: Any) -> Frame:
    can_id, data = index(value.can_id), bytes(memoryview(value.data))
    if wrong := flaw(can_id, len(data)):
        raise ValueError(wrong)
    return Frame(can_id, data)


def _frames(value: Any) -> Sequence[Frame]:
    return [_frame(one) for one in value]


# --- the two ends ---------------------------------------------------------------------------------


class WrappedClient(DriveClient):
    """Another client, as it is."""

    def __init__(self, client: Any, own: Own) -> None:
        self._client, self._own = client, own
        self._copy()

    def _copy(self) -> None:
        self.armed = self._own.attribute(self._client, "armed", bool)
        self.sent_wheel_N_m = self._own.attribute(self._client, "sent_wheel_N_m", _pair)

    def _ask(self, name: str, answer: Callable[[Any], T], *arguments: Any) -> T:
        """What a method answers; what may have changed is copied."""
        method = self._own.attribute(self._client, name, _any)
        answered = self._own.ask(name, method, answer, *arguments)
        self._copy()
        return answered

    @property
    def notices(self) -> tuple[str, ...]:
        """As `DriveClient.notices`."""
        return self._own.attribute(self._client, "notices", _texts)

    def on_frame(self, can_id: int, data: bytes | bytearray, now_ns: int) -> None:
        """As `DriveClient.on_frame`."""
        self._ask("on_frame", _nothing, can_id, data, now_ns)

    def feedback_since(self, bus_ns: int) -> bool:
        """As `DriveClient.feedback_since`."""
        return self._ask("feedback_since", bool, bus_ns)

    def motion(self) -> Motion | None:
        """As `DriveClient.motion`."""
        return self._ask("motion", _motion)

    def arm(self, now_ns: int) -> Sequence[Frame]:
        """As `DriveClient.arm`."""
        return self._ask("arm", _frames, now_ns)

    def missing(self, now_ns: int) -> str:
        """As `DriveClient.missing`."""
        return self._ask("missing", _text, now_ns)

    def obstacle(self, now_ns: int) -> str | None:
        """As `DriveClient.obstacle`."""
        return self._ask("obstacle", _reason, now_ns)

    def refusal(self) -> str | None:
        """As `DriveClient.refusal`."""
        return self._ask("refusal", _reason)

    def fault(self, now_ns: int) -> str | None:
        """As `DriveClient.fault`."""
        return self._ask("fault", _reason, now_ns)

    def torque(self, right_wheel_N_m: float, left_wheel_N_m: float) -> Sequence[Frame]:
        """As `DriveClient.torque`."""
        return self._ask("torque", _frames, right_wheel_N_m, left_wheel_N_m)

    def rest(self, now_ns: int) -> Sequence[Frame]:
        """As `DriveClient.rest`."""
        return self._ask("rest", _frames, now_ns)

    def disarm(self) -> Sequence[Frame]:
        """As `DriveClient.disarm`."""
        return self._ask("disarm", _frames)

    def estop(self) -> Sequence[Frame]:
        """As `DriveClient.estop`."""
        return self._ask("estop", _frames)


class WrappedNode(DriveNode):
    """Another node, as it is."""

    def __init__(self, node: Any, own: Own) -> None:
        self._node, self._own = node, own
        self._copy()

    def _copy(self) -> None:
        take = self._own.attribute
        self.fed_ns = take(self._node, "fed_ns", _time_ns)
        self.setpoint_id = take(self._node, "setpoint_id", index)
        self.ignored = take(self._node, "ignored", index)
        self.input_torque_shaft = take(self._node, "input_torque_shaft", float)

    def _ask(self, name: str, answer: Callable[[Any], T], *arguments: Any) -> T:
        """What a method answers; what may have changed is copied."""
        method = self._own.attribute(self._node, name, _any)
        answered = self._own.ask(name, method, answer, *arguments)
        self._copy()
        return answered

    def update_encoder(self, revolutions: float, rev_s: float) -> None:
        """As `DriveNode.update_encoder`."""
        self._ask("update_encoder", _nothing, revolutions, rev_s)

    def lose_estimate(self) -> None:
        """As `DriveNode.lose_estimate`."""
        self._ask("lose_estimate", _nothing)

    def due(self, now_ns: int) -> Sequence[Frame]:
        """As `DriveNode.due`."""
        return self._ask("due", _frames, now_ns)

    def feedback(self, now_ns: int) -> Frame:
        """As `DriveNode.feedback`."""
        return self._ask("feedback", _frame, now_ns)

    def on_frame(self, frame: Frame, now_ns: int) -> Sequence[Frame]:
        """As `DriveNode.on_frame`."""
        return self._ask("on_frame", _frames, frame, now_ns)

    @property
    def state_in_words(self) -> str:
        """As `DriveNode.state_in_words`."""
        return self._own.attribute(self._node, "state_in_words", _text)

    @property
    def next_due_ns(self) -> int:
        """As `DriveNode.next_due_ns`."""
        return self._own.attribute(self._node, "next_due_ns", _time_ns)

    def update_measurements(self, measurements: DriveMeasurements) -> None:
        """As `DriveNode.update_measurements`."""
        self._ask("update_measurements", _nothing, measurements)

    def torque_demand_shaft(self, dt_s: float) -> float:
        """As `DriveNode.torque_demand_shaft`."""
        return self._ask("torque_demand_shaft", _finite, dt_s)

    def estop(self) -> None:
        """As `DriveNode.estop`."""
        self._ask("estop", _nothing)

    def expire_watchdog(self) -> None:
        """As `DriveNode.expire_watchdog`."""
        self._ask("expire_watchdog", _nothing)

    def reboot(self, now_ns: int) -> None:
        """As `DriveNode.reboot`."""
        self._ask("reboot", _nothing, now_ns)

    def trip(self, error: str | None) -> None:
        """As `DriveNode.trip`."""
        self._ask("trip", _nothing, error)
