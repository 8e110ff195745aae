"""Reports of the runners are read, and a skip that another run made good is no gap."""

from pathlib import Path

import pytest

from outcomes import Outcomes

CTEST = """<testsuite>
  <testcase name="robot.Loop.Runs" status="run"><system-out>fine</system-out></testcase>
  <testcase name="robot.RealTime.Locks" status="notrun">
    <skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/>
    <system-out>[ RUN      ] RealTime.Locks
run_test.cpp:144: Skipped
no user may be given
a real-time priority here

[  SKIPPED ] RealTime.Locks (0 ms)
</system-out>
  </testcase>
  <testcase name="robot.Loop.Breaks" status="fail"><failure/></testcase>
</testsuite>"""
PYTEST = """<testsuites><testsuite>
  <testcase classname="tests.python.test_a" name="test_passes"/>
  <testcase classname="tests.python.test_a" name="test_skips">
    <skipped message="no strace"/>
  </testcase>
  <testcase classname="tests.python.test_a" name="test_fails"><failure message="x"/></testcase>
</testsuite></testsuites>"""


@pytest.fixture
def found(tmp_path: Path) -> Outcomes:
    found = Outcomes()
    for text in (CTEST, PYTEST):
        (tmp_path / "report").write_text(text)
        found.read_report(tmp_path / "report")
    return found


def test_reports_tell_what_passed_and_why_a_test_was_skipped(found: Outcomes) -> None:
    assert found.passed == {"robot.Loop.Runs", "tests.python.test_a.test_passes"}
    assert found.failed == ["robot.Loop.Breaks", "tests.python.test_a.test_fails"]
    assert found.skipped == {
        "robot.RealTime.Locks": "no user may be given a real-time priority here",
        "tests.python.test_a.test_skips": "no strace",
    }


def test_a_skip_is_a_gap_unless_another_run_passed_that_test(found: Outcomes) -> None:
    found.passed.add("robot.RealTime.Locks")
    assert found.gaps() == ["tests.python.test_a.test_skips"]
    found.skipped["tests.python.test_a.test_skips"] = "no real-time class here; make rt runs it"
    assert not found.gaps()


def test_a_step_that_says_it_was_skipped_is_a_gap(tmp_path: Path) -> None:
    log, found = tmp_path / "log", Outcomes()
    log.write_text("all held\n")
    assert not found.read_log("rt", log)
    log.write_text("building\nskipped: apt knows no kernel\n")
    assert found.read_log("rt", log)
    assert found.left_out() == {"rt": "apt knows no kernel"}
