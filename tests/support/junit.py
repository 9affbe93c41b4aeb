"""The rules of junit-10.xsd of Jenkins' xUnit plug-in: elements, children and attributes."""

import re
from xml.etree import ElementTree as ET

_RESULT = ((), {"type", "message"}, set())
_RULES: dict[str, tuple[tuple[str, ...], set[str], set[str]]] = {
    "testsuites": (("testsuite",), {"name", "time", "tests", "failures", "errors"}, set()),
    "testsuite": (
        ("testsuite", "properties", "testcase", "system-out", "system-err"),
        {
            "group",
            "time",
            "skipped",
            "timestamp",
            "hostname",
            "id",
            "package",
            "file",
            "log",
            "url",
        },
        {"name", "tests", "failures", "errors"},
    ),
    "properties": (("property",), set(), set()),
    "property": ((), set(), {"name", "value"}),
    "testcase": (
        ("skipped", "error", "failure", "system-out", "system-err"),
        {"time", "classname", "group"},
        {"name"},
    ),
    "failure": _RESULT,
    "error": _RESULT,
    "skipped": _RESULT,
}
_TIME = re.compile(r"(([0-9]{0,3},)*[0-9]{3}|[0-9]{0,3})*(\.[0-9]*)?")


def valid(data: bytes) -> ET.Element:
    """The root of a report that keeps the rules; its counts are those of its cases."""
    root = ET.fromstring(data)
    assert root.tag == "testsuites"
    for element in root.iter():
        children, optional, required = _RULES[element.tag]
        assert {child.tag for child in element} <= set(children), element.tag
        assert required <= set(element.keys()), element.tag
        assert set(element.keys()) <= optional | required, element.tag
        if element.tag in ("testsuites", "testsuite"):
            assert _TIME.fullmatch(element.attrib["time"])
            cases = element.findall(".//testcase")
            assert int(element.attrib["tests"]) == len(cases)
            for attribute, tag in (("failures", "failure"), ("errors", "error")):
                count = sum(case.find(tag) is not None for case in cases)
                assert int(element.attrib[attribute]) == count
    return root
