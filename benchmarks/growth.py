"""Costs against sizes: a table with a verdict a curve, and a picture, in build/growth/."""

import argparse
import json
import math
import statistics
import subprocess
from collections import defaultdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).resolve().parent.parent
SLACK = 0.2  # of a slope: caches end, allocators grow

# the curves, and whether their work stays the same (0) or grows with the size (1)
PANELS: dict[str, dict[str, int]] = {
    "number of actuators": {
        "iteration, at rest": 1,
        "iteration, all moving": 1,
        "pulse, one command each": 1,
    },
    "readers": {"iteration, n readers": 0},
    "queued commands": {
        "iteration, n queued": 0,
        "pulse of one more": 0,
        "iteration that takes one more": 0,
        "iteration that drops n": 0,
        "pulse of n commands": 1,
        "taking n commands": 1,
        "telling the ends of n": 1,
    },
    "rows of history": {
        "publish, history of n": 0,
        "latest, history of n": 0,
        "100 rows, history of n": 0,
        "attach, history of n": 0,
        "reading n rows": 0,
    },
    "iterations of a burst": {"burst(n)": 1},
}

RATIOS = {"reading n rows"}  # of a memcpy of the same bytes
Curve = dict[int, float]  # size => median [ns]


def measure(program: Path, rounds: int) -> dict[str, Curve]:
    ended = subprocess.run(
        [str(program), str(rounds)], capture_output=True, text=True, timeout=900, check=True
    )
    samples: dict[str, dict[int, list[float]]] = defaultdict(lambda: defaultdict(list))
    for line in ended.stdout.splitlines():
        name, _, size, value = line.split("\t")
        samples[name][int(size)].append(float(value))
    return {
        name: {size: statistics.median(values) for size, values in sorted(curve.items())}
        for name, curve in samples.items()
    }


def slope_of(curve: Curve) -> float:
    """Of the upper half of the sizes, both axes logarithmic: fixed costs lie below."""
    sizes = list(curve)
    upper = sizes[len(sizes) // 2 - 1 :] if len(sizes) > 3 else sizes
    x = [math.log(size) for size in upper]
    y = [math.log(curve[size]) for size in upper]
    return statistics.linear_regression(x, y).slope


def draw(curves: dict[str, Curve], path: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 3, figsize=(16, 9))
    for axis, (title, names) in zip(axes.flat, PANELS.items(), strict=False):
        for name, work in names.items():
            curve = curves[name]
            (line,) = axis.loglog(
                list(curve), list(curve.values()), "o-" if work == 0 else "s-", label=name
            )
            if work == 1:
                size = max(curve)
                axis.loglog(
                    list(curve), [curve[size] * x / size for x in curve],
                    ":", color=line.get_color(), linewidth=0.8,
                )  # fmt: skip
        bottom, top = axis.get_ylim()
        axis.set_ylim(bottom / 2, top * 2)  # small differences look small
        axis.set_xlabel(title)
        axis.set_ylabel("[ns]")
        axis.legend(fontsize=8)
        axis.grid(True, which="major", alpha=0.3)
    axes.flat[-1].axis("off")
    key = "squares: work grows with the size\ndotted: exactly as the size"
    axes.flat[-1].text(0.0, 0.6, f"{key}\ncircles: work stays the same")
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5, help="repetitions of each (default: 5)")
    parser.add_argument("--built", type=Path, default=ROOT / "build" / "release", metavar="FOLDER",
                        help="where the programs were built (default: build/release)")  # fmt: skip
    asked = parser.parse_args()
    console = Console(width=None if Console().is_terminal else 120)
    curves = measure(asked.built.resolve() / "bin" / "o80-bench-growth", asked.rounds)
    folder = ROOT / "build" / "growth"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "growth.json").write_text(json.dumps(curves, indent=2) + "\n")
    draw(curves, folder / "growth.png")

    table = Table(title="Growth (medians; slopes of the upper half, both axes logarithmic)")
    for title in ("against", "curve", "smallest", "largest", "slope", "work", "no faster"):
        table.add_column(title)
    worse = 0
    for title, names in PANELS.items():
        for name, work in names.items():
            curve = curves[name]
            slope = slope_of(curve)
            good = slope <= work + SLACK
            worse += not good
            low, high = min(curve), max(curve)
            unit = "x memcpy" if name in RATIOS else "ns"
            table.add_row(
                title, name, f"{low}: {curve[low]:.3g} {unit}", f"{high}: {curve[high]:.3g} {unit}",
                f"{slope:.2f}", str(work), "yes" if good else "[red]NO",
            )  # fmt: skip
    console.print(table)
    console.print(f"picture and figures in {folder.relative_to(ROOT)}")
    return 1 if worse else 0


if __name__ == "__main__":
    raise SystemExit(main())
