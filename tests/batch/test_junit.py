"""JUnit XML: what CI systems read, for any name."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from aobake.batch.junit import write_junit
from aobake.batch.tasks import Entry
from tests.batch.made_up import HOSTILE, entries, entry, facts

# What the schemas of Jenkins (junit-10.xsd) and of Apache Ant allow.
SUITE = {"name", "tests", "failures", "errors", "skipped", "time", "timestamp"}
INSIDE = {"failure": {"message", "type"}, "error": {"message", "type"}, "skipped": {"message"}}


def written(tmp_path: Path, *jobs: Entry) -> ET.Element:
    path = tmp_path / "junit.xml"
    write_junit(path, facts(0), jobs)
    return ET.parse(path).getroot()


def test_counts_are_those_of_the_cases(tmp_path: Path) -> None:
    count = 60
    path = tmp_path / "junit.xml"
    write_junit(path, facts(count), entries(count))
    (suite,) = ET.parse(path).getroot()
    assert set(suite.keys()) == SUITE
    cases = suite.findall("testcase")
    assert int(suite.attrib["tests"]) == len(cases) == count
    for name, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        assert int(suite.attrib[name]) == len(suite.findall(f"testcase/{tag}")) > 0, name
    for case in cases:
        assert set(case.keys()) == {"classname", "name", "time"}
        for element in case:
            assert set(element.keys()) == INSIDE.get(element.tag, set()), element.tag


def test_cases_of_a_batch_are_told_apart(tmp_path: Path) -> None:
    count = 60
    path = tmp_path / "junit.xml"
    write_junit(path, facts(count), entries(count))
    cases = ET.parse(path).getroot().iter("testcase")
    assert len({(case.attrib["classname"], case.attrib["name"]) for case in cases}) == count


@pytest.mark.parametrize(
    ("state", "tag"),
    [
        ("failed", "failure"),
        ("crashed", "error"),
        ("memory", "error"),
        ("timeout", "error"),
        ("stopped", "skipped"),
    ],
)
def test_what_gave_nothing_says_why(tmp_path: Path, state: str, tag: str) -> None:
    case = written(tmp_path, entry("props/a.glb", state))[0][0]
    assert case.attrib["classname"] == "props"
    assert case.attrib["name"] == "a.glb (vertex)"
    assert case[0].tag == tag
    assert case[0].attrib["message"] == "props/a.glb: it is broken. Export it anew."


@pytest.mark.parametrize("state", ["baked", "unchanged", "moved"])
def test_what_stands_passes(tmp_path: Path, state: str) -> None:
    case = written(tmp_path, entry("a.glb", state))[0][0]
    assert {element.tag for element in case} <= {"system-out"}
    assert float(case.attrib["time"]) == (1.5 if state == "baked" else 0.0)


def test_warnings_are_in_the_output(tmp_path: Path) -> None:
    case = written(tmp_path, entry("a.glb", report={"warnings": ["one <b>", "two"]}))[0][0]
    assert case.findtext("system-out") == "one <b>\ntwo"


@pytest.mark.parametrize("name", HOSTILE)
def test_any_name_is_read_back(tmp_path: Path, name: str) -> None:
    """What XML can hold comes back as it was; what it cannot hold, not even escaped, is spelled."""
    case = written(tmp_path, entry(name, "failed"))[0][0]
    spelled = name.rpartition("/")[2]
    for letter, shown in (("\x00", "\\x00"), ("\x1b", "\\x1b"), ("\udcff", "\\udcff")):
        spelled = spelled.replace(letter, shown)
    assert case.attrib["name"] == f"{spelled} (vertex)"
    assert spelled in (case[0].text or "")
