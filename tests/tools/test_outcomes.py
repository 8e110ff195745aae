"""Reports of the runners are read, and a skip that another run made good is no gap."""

from pathlib import Path

from outcomes import Outcomes, of_ctest, of_log, of_pytest

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


def written(folder: Path, text: str) -> Path:
    file = folder / "report"
    file.write_text(text)
    return file


def test_ctest_tells_what_passed_and_why_a_test_was_skipped(tmp_path: Path) -> None:
    found = of_ctest(written(tmp_path, CTEST))

    assert found.passed == {"robot.Loop.Runs"}
    reason = "no user may be given a real-time priority here"
    assert found.skipped == {"robot.RealTime.Locks": reason}


def test_pytest_tells_what_passed_and_why_a_test_was_skipped(tmp_path: Path) -> None:
    found = of_pytest(written(tmp_path, PYTEST))

    assert found.passed == {"tests.python.test_a.test_passes"}
    assert found.skipped == {"tests.python.test_a.test_skips": "no strace"}


def test_a_skip_is_a_gap_unless_another_run_passed_that_test(tmp_path: Path) -> None:
    found = of_ctest(written(tmp_path, CTEST))
    assert list(found.gaps()) == ["robot.RealTime.Locks"]

    found.add(Outcomes(passed={"robot.RealTime.Locks"}))
    assert found.gaps() == {}


def test_a_step_that_says_it_was_skipped_is_a_gap(tmp_path: Path) -> None:
    log = written(tmp_path, "building\nskipped: apt knows no kernel\n")
    assert of_log("rt", log).gaps() == {"rt": "apt knows no kernel"}
    assert of_log("rt", written(tmp_path, "all held\n")).gaps() == {}
