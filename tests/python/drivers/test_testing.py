"""`check_robot` passes right robots, and says what is wrong with others."""

from pathlib import Path

import pytest
from cart import written

import o80
from o80.testing import check_robot


@pytest.mark.parametrize("seed", range(2))
def test_a_right_robot_passes(tmp_path: Path, seed: int) -> None:
    assert check_robot(written(tmp_path, f"right_cart_{seed}"), seed=seed) == []


def test_two_joints_pass() -> None:
    assert check_robot("two_joints") == []


def test_a_robot_without_requests_is_checked_as_far_as_it_goes(tmp_path: Path) -> None:
    plain = written(tmp_path, "plain_cart", ("    requests = {", "    requests = {} and {"))
    assert check_robot(plain) == [
        "a replay: the robot does not serve snapshot and restore",
        "seeds of resets: the robot does not serve reset",
        "snapshots: the robot does not serve snapshot and restore",
    ]


def test_a_robot_of_the_world_is_not_moved(tmp_path: Path) -> None:
    real = written(tmp_path, "real_cart", ("simulated = True", "simulated = False"))
    with pytest.raises(o80.InvalidArgument, match=r"not start 'cart': .*schema\.simulated"):
        check_robot(real)


WRONG: dict[str, tuple[str, list[tuple[str, str]]]] = {
    "begins_outside": (
        r"observed\.x is 2 in row 0, outside its limits from -1 to 1",
        [("self.past = 0.0,", "self.past = 2.0,")],
    ),
    "loses_a_number": (
        r"extended\.force is NaN or infinite in row \d+",
        [
            ("made = 0", "made = 0\n    extended = {'force': float}"),
            (
                "= self.x\n",
                "= self.x\n"
                "        reading.extended = {'force': np.nan if self.past > 1.0 else 0.0}\n",
            ),
        ],
    ),
    "differs_by_instance": (
        "a run is not repeated by its replay",
        [("= self.x\n", "= self.x + 1e-3 * type(self).made\n")],
    ),
    "resets_in_part": (
        r"observed\.x is .* after two resets with the same seed",
        [("uniform(-1, 1), 0.0", "uniform(-1, 1), self.speed")],
    ),
    "keeps_a_part": (
        r"observed\.x is .* after the same snapshot was restored twice",
        [
            ("= (self.x, self.speed)", "= (self.x, 0.0)"),
            ("self.x, self.speed = self.kept", "self.x, _ = self.kept"),
        ],
    ),
    "shares_between_copies": (
        "in copy . of a group and in a single robot",
        [
            (
                "self.speed += 0.1",
                "type(self).made += 1\n        self.speed += 1e-3 * self.made + 0.1",
            ),
            ("requests = {", "requests = {} and {"),
        ],
    ),
    "stops_late": (
        r"its process took .* s to stop",
        [("def on_reset", "def stop(self):\n        time.sleep(0.2)\n\n    def on_reset")],
    ),
}


def test_a_robot_that_halts_when_it_is_moved_is_told(tmp_path: Path) -> None:
    limits = ("maximum=1.0)", "maximum=1.0, error=1e-3)")
    with pytest.raises(o80.BackendHalted, match="further apart than its error limit"):
        check_robot(written(tmp_path, "halting_cart", limits))


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said(tmp_path: Path, name: str) -> None:
    said, changes = WRONG[name]
    wrong = written(tmp_path, name, *changes)
    with pytest.raises(AssertionError, match=said):
        check_robot(wrong, stops_within=0.1 if name == "stops_late" else 30.0)
