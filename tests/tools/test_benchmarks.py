"""Verdicts of `make bench`."""

from pathlib import Path
from runpy import run_path
from typing import Any

import pytest

RUN = run_path(str(Path(__file__).parents[2] / "benchmarks" / "run.py"))
ROW = {"row": "a burst", "budget": "a peer", "measured": "ours", "limit": "2"}


def verdict(samples: dict[str, tuple[str, list[float]]] | str, **row: str) -> dict[str, Any]:
    result: dict[str, Any] = RUN["result_of"]({"of": "", "plain": "", **ROW, **row}, samples)
    return result


def test_a_ratio_is_that_of_a_round_and_judged_by_its_lower_quartile() -> None:
    others = [1.0, 2.0, 1.0, 4.0, 1.0]
    ratios = [3.0, 1.5, 2.5, 9.0, 1.9]
    ours = [a * b for a, b in zip(ratios, others, strict=True)]
    result = verdict({"ours": ("us", ours), "peer": ("us", others)}, of="peer")

    assert (result["measured"], result["quartiles"], result["unit"]) == (2.5, [1.9, 3.0], "x")
    assert result["met"]
    assert not verdict({"ours": ("us", ours), "peer": ("us", others)}, of="peer", limit="1.8")[
        "met"
    ]


def test_a_fixed_limit_is_scaled_by_the_plain_loop() -> None:
    slow = 3 * RUN["USUAL"]["plain_cpp"]
    result = verdict({"ours": ("us", [5.0]), "plain_cpp": ("ns", [slow])}, plain="plain_cpp")

    assert result["limit"] == pytest.approx(6.0)
    assert result["met"]


def test_a_peer_that_is_not_installed_is_told() -> None:
    result = verdict({"ours": ("us", [5.0]), "peer": ("ruckig is not installed", [])}, of="peer")

    assert result["met"] is None
    assert "not measured: ruckig is not installed" in RUN["line_of"](result)
