"""`fleetloop can dbc`: the frames of emulated drives as a CAN database (DBC) for other tools.

Written by rule: names of at most 32 letters, digits and underscores, ASCII texts, little-endian
signals (`@1`), float32 by `SIG_VALTYPE_`, multiplexed values, ranges, tables of values. Its content
is the drive protocol's own description of its frames (`DriveProtocol.formats`).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from bridge.drives import protocol
from bridge.drives.interface import DriveProtocol, MessageFormat, SignalFormat
from configs.drives import DEFAULT
from configs.errors import ExitStatus, InfrastructureError, ScenarioError
from configs.loading import load, loads
from configs.scenario import Scenario
from fleetloop.can.decoder import protocol_of
from fleetloop.record.reader import Record
from fleetloop.record.run_record import RECORD
from fleetloop.terminal import note, say

HOST = "Master"
MAX_NAME = 32
FLOAT32_MAX = 3.4028234663852886e38
_SECTIONS = (
    *("NS_DESC_", "CM_", "BA_DEF_", "BA_", "VAL_", "CAT_DEF_", "CAT_", "FILTER", "BA_DEF_DEF_"),
    *("EV_DATA_", "ENVVAR_DATA_", "SGTYPE_", "SGTYPE_VAL_", "BA_DEF_SGTYPE_", "BA_SGTYPE_"),
    *("SIG_TYPE_REF_", "VAL_TABLE_", "SIG_GROUP_", "SIG_VALTYPE_", "SIGTYPE_VALTYPE_"),
    *("BO_TX_BU_", "BA_DEF_REL_", "BA_REL_", "BA_DEF_DEF_REL_", "BU_SG_REL_", "BU_EV_REL_"),
    *("BU_BO_REL_", "SG_MUL_VAL_"),
)
_ASCII = str.maketrans({"·": "", "²": "^2", "°": "deg", "→": "->"})


def write_dbc(
    source: str | None,
    out: Path | None,
    *,
    bus: str | None = None,
    protocol_name: str | None = None,
) -> int:
    """Print the database, or write it to a file; return the exit status.

    Args:
        source: a scenario, a run's folder or its record; None: two drives with default addresses.
        out: the file; None: standard output.
        bus: only the drives on this bus.
        protocol_name: of the drives without a source.

    Raises:
        ScenarioError: no such scenario, run, bus or protocol, or one that doesn't describe frames.
        InfrastructureError: the file can't be written.
    """
    if source is None:
        if bus is not None:
            raise ScenarioError(f"--bus {bus}: name the scenario or the run whose bus it is")
        drives = protocol_of(protocol_name or DEFAULT)
        section = drives.section()
        wheels = {section.right_node: ["right wheel"], section.left_node: ["left wheel"]}
    else:
        if protocol_name is not None:
            raise ScenarioError(f"--protocol {protocol_name}: {source} says itself which it is")
        scenario = _scenario_of(source)
        drives = protocol(scenario.drive_choice.plugin)
        wheels = wheels_of(scenario, bus)
    text = database(drives, wheels)
    if out is None:
        say(text.rstrip())
        return ExitStatus.OK
    try:
        out.write_text(text, "ascii")
    except OSError as error:
        raise InfrastructureError(f"can't write {out}: {error.strerror or error}") from error
    note(f"{out}: nodes {', '.join(map(str, wheels))}")
    return ExitStatus.OK


def _scenario_of(source: str) -> Scenario:
    place = Path(source)
    record = place / RECORD if place.is_dir() else place
    if record.name != RECORD:
        return load(source)
    if not record.is_file():
        raise ScenarioError(f"{source}: no {RECORD} there; name a scenario, a run or its record")
    return loads(str(record), Record.open(record, damaged=True).scenario_toml, recorded=True)


def wheels_of(scenario: Scenario, bus: str | None = None) -> dict[int, list[str]]:
    """The drives of a scenario, or of one of its buses: what each node moves.

    Raises:
        ScenarioError: it has no such bus.
    """
    if bus is not None and bus not in scenario.buses:
        known = ", ".join(scenario.buses)
        raise ScenarioError(f"--bus {bus}: {scenario.name} has no such bus; there are {known}")
    wheels: dict[int, list[str]] = {}
    for robot in scenario.names:
        if bus in (None, scenario.bus_of(robot)):
            for node, side in zip(scenario.nodes_of(robot), ("right", "left"), strict=True):
                wheels.setdefault(node, []).append(f"{robot}: {side} wheel")
    return dict(sorted(wheels.items()))


def database(drives: DriveProtocol, wheels: Mapping[int, Sequence[str]]) -> str:
    """The text of the database of these nodes.

    Raises:
        ScenarioError: the protocol doesn't describe its frames.
    """
    if drives.formats is None:
        raise ScenarioError("this drive protocol does not describe its frames: it has no formats")
    messages = {node: drives.formats(node) for node in wheels}
    return "\n".join([*_head(wheels), *_messages(messages), *_about(messages, wheels), ""])


def _head(nodes: Iterable[int]) -> Iterator[str]:
    yield from ('VERSION ""', "", "NS_ :", *(f"\t{name}" for name in _SECTIONS), "", "BS_:", "")
    yield " ".join(["BU_:", HOST, *map(_ecu, nodes)])
    yield ""


def _messages(messages: Mapping[int, Sequence[MessageFormat]]) -> Iterator[str]:
    for node, message in _each(messages):
        sender, hearers = HOST, [_ecu(node)]
        if message.from_drive:
            hearers.append(HOST)
            if not message.from_host:
                sender = hearers.pop(0)
        yield f"BO_ {message.can_id} {_name(node, message)}: {message.length} {sender}"
        for signal in message.signals:
            yield f" SG_ {_layout(signal)} {','.join(hearers)}"
        yield ""
    for node, message in _each(messages):
        if message.from_drive and message.from_host:
            yield f"BO_TX_BU_ {message.can_id} : {HOST},{_ecu(node)};"


def _layout(signal: SignalFormat) -> str:
    least, most = limits(signal)
    chosen = f" m{signal.selected_by}" if signal.selected_by is not None else ""
    role = " M" if signal.selects else chosen
    sign = "-" if signal.signed or signal.is_float else "+"
    return (
        f"{_named(signal.name)}{role} : {signal.first_bit}|{signal.bits}@1{sign}"
        f" ({signal.scale:.17g},0) [{least:.17g}|{most:.17g}] {_text(signal.unit)}"
    )


def limits(signal: SignalFormat) -> tuple[float, float]:
    """Least and greatest value, in the signal's unit."""
    if signal.is_float:
        return -FLOAT32_MAX, FLOAT32_MAX
    if signal.signed:
        half = 1 << signal.bits - 1
        return -half * signal.scale, (half - 1) * signal.scale
    return 0.0, ((1 << signal.bits) - 1) * signal.scale


def _about(
    messages: Mapping[int, Sequence[MessageFormat]], wheels: Mapping[int, Sequence[str]]
) -> Iterator[str]:
    """Comments, the kind of bus, tables of values, types."""
    yield f"CM_ {_text('Drives of a Fleetloop emulation; torques, speeds: of the shafts')};"
    for node, moved in wheels.items():
        yield f"CM_ BU_ {_ecu(node)} {_text('; '.join(moved))};"
    signals = [(message.can_id, s) for _, message in _each(messages) for s in message.signals]
    for _, message in _each(messages):
        if message.comment:
            yield f"CM_ BO_ {message.can_id} {_text(message.comment)};"
    for can_id, signal in signals:
        if signal.comment:
            yield f"CM_ SG_ {can_id} {signal.name} {_text(signal.comment)};"
    yield 'BA_DEF_ "BusType" STRING ;'
    yield 'BA_DEF_DEF_ "BusType" "CAN";'
    yield 'BA_ "BusType" "CAN";'
    for can_id, signal in signals:
        if signal.values:
            table = " ".join(f"{value} {_text(word)}" for value, word in signal.values.items())
            yield f"VAL_ {can_id} {signal.name} {table} ;"
    for can_id, signal in signals:
        if signal.is_float:
            yield f"SIG_VALTYPE_ {can_id} {signal.name} : 1;"


def _each(
    messages: Mapping[int, Sequence[MessageFormat]],
) -> Iterator[tuple[int, MessageFormat]]:
    for node, described in messages.items():
        for message in described:
            yield node, message


def _ecu(node: int) -> str:
    return f"ODrive_Axis{node}"


def _name(node: int, message: MessageFormat) -> str:
    return _named(f"Axis{node}_{message.name}")


def _named(name: str) -> str:
    """A name as the format has it.

    Raises:
        ValueError: it is too long for tools that keep to the format.
    """
    if len(name) > MAX_NAME:
        raise ValueError(f"{name}: more than {MAX_NAME} characters")
    return name


def _text(text: str) -> str:
    """A quoted text."""
    plain = text.translate(_ASCII).replace('"', "'")
    return f'"{plain.encode("ascii", "replace").decode()}"'
