"""Filters of the frames of a bus: `BUS[,filter]*` in candump's syntax and with the kernel's rules.

    ID:MASK   frames with  received & MASK == ID & MASK
    ID~MASK   the others
    #MASK     error frames of these classes
    j         all filters must hold, instead of one of them

ID and MASK are hexadecimal. An ID of 8 digits is a 29-bit one (EFF bit set); MASK bits 80000000 and
40000000 compare the EFF and RTR bits, as in SocketCAN. Without a filter every frame passes, error
frames too (candump hides those); with any, error frames pass by `#MASK` alone.
"""

import re
from dataclasses import dataclass

from bridge.frame import EFF, ERR, ID_MASK_29
from configs.errors import ScenarioError

_RULE = re.compile(r"(?P<id>[0-9A-Fa-f]{1,8})(?P<kind>[:~])(?P<mask>[0-9A-Fa-f]{1,8})")
_ERRORS = re.compile(r"#(?P<mask>[0-9A-Fa-f]{1,8})")


@dataclass(frozen=True, slots=True)
class Rule:
    """One comparison of an identifier with its flags."""

    can_id: int
    mask: int
    inverted: bool = False

    def holds(self, can_id: int) -> bool:
        """Whether it lets a data or remote frame pass."""
        return ((can_id ^ self.can_id) & self.mask == 0) != self.inverted


@dataclass(frozen=True, slots=True)
class Filter:
    """The filters of one bus."""

    rules: tuple[Rule, ...] = ()
    joined: bool = False
    error_classes: int = ID_MASK_29

    def passes(self, can_id: int) -> bool:
        """Whether a frame with this identifier and flags is shown."""
        if can_id & ERR:
            # An error frame without a class is nobody's to select, and everybody's without filters.
            return bool(can_id & self.error_classes) or self.error_classes == ID_MASK_29
        if not self.rules:
            return True
        results = (rule.holds(can_id) for rule in self.rules)
        return all(results) if self.joined else any(results)


def parse(text: str) -> tuple[str, Filter]:
    """The bus and the filters of an argument `BUS[,filter]*`.

    Raises:
        ScenarioError: there is no bus, or a filter is none.
    """
    bus, *parts = text.split(",")
    if not bus:
        raise ScenarioError(f"{text!r} names no bus; right are r1 and r1,009:7FF")
    if not parts:
        return bus, Filter()
    rules: list[Rule] = []
    joined, error_classes = False, 0
    for part in parts:
        if rule := _RULE.fullmatch(part):
            extended = EFF if len(rule["id"]) == 8 else 0
            mask = int(rule["mask"], 16) & ~ERR
            rules.append(Rule(int(rule["id"], 16) | extended, mask, rule["kind"] == "~"))
        elif errors := _ERRORS.fullmatch(part):
            error_classes = int(errors["mask"], 16) & ID_MASK_29
        elif part in ("j", "J"):
            joined = True
        else:
            raise ScenarioError(
                f"filter {part!r} of {bus}: right are ID:MASK, ID~MASK, #ERRORMASK and j,"
                " hexadecimal, e.g. r1,009:7FF"
            )
    return bus, Filter(tuple(rules), joined, error_classes)
