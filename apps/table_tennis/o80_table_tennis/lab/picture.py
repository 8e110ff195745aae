"""Draws the processes of the lab and what flows between them: docs/lab.svg.

python -m o80_table_tennis.lab.picture docs/lab.svg
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .parts import (
    ARM,
    CAMERAS,
    COUNTERPARTS,
    ENVIRONMENT,
    LAUNCHER,
    MOTION_CAPTURE,
    RATES,
    RECORDER,
    TRACKER,
    VIEW,
    WORLD,
)

WIDTH, HEIGHT = 180, 62
BLUE, AMBER, GREEN = ("#e8f0fe", "#3f6fb5"), ("#fff6e5", "#c98a1b"), ("#e9f5ec", "#3b8752")
GREY = ("#f3f4f6", "#7a8794")


@dataclass(frozen=True)
class Box:
    """A process in the picture."""

    x: int
    y: int
    colour: tuple[str, str]
    text: str

    def side(self, name: str) -> tuple[int, int]:
        """Middle of a side: left, right, top or bottom."""
        return {
            "left": (self.x, self.y + HEIGHT // 2),
            "right": (self.x + WIDTH, self.y + HEIGHT // 2),
            "top": (self.x + WIDTH // 2, self.y),
            "bottom": (self.x + WIDTH // 2, self.y + HEIGHT),
        }[name]


BOXES = {
    ARM: Box(30, 60, GREEN, "pneumatic muscles"),
    MOTION_CAPTURE: Box(30, 190, AMBER, "poses"),
    COUNTERPARTS: Box(30, 320, GREY, "fakes of the hardware"),
    ENVIRONMENT: Box(300, 60, BLUE, "policy"),
    LAUNCHER: Box(300, 320, AMBER, "angles, motors, launches"),
    WORLD: Box(570, 60, GREEN, "MuJoCo, bursting"),
    TRACKER: Box(570, 190, AMBER, "position, velocity, spin"),
    CAMERAS: Box(570, 320, AMBER, "four, 640 x 480"),
    RECORDER: Box(800, 60, BLUE, "all rows: run.mcap"),
    VIEW: Box(800, 190, BLUE, "3D and curves"),
}
ARROWS = (
    (ENVIRONMENT, "left", ARM, "right", "pressures", "both"),
    (ENVIRONMENT, "right", WORLD, "left", "arm's rows", "both"),
    (CAMERAS, "top", TRACKER, "bottom", "images", "one"),
    (LAUNCHER, "left", COUNTERPARTS, "right", "ZeroMQ", "both"),
    (COUNTERPARTS, "top", MOTION_CAPTURE, "bottom", "TCP", "one"),
)
"""From, to, the words beside them."""


def drawn() -> str:
    """The picture, as SVG."""
    lines = [
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1010 430" '
        'font-family="Helvetica, Arial, sans-serif" font-size="14">',
        '  <defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" '
        'markerHeight="7" orient="auto-start-reverse">'
        '<path d="M 0 0 L 10 5 L 0 10 z" fill="#37474f"/></marker></defs>',
        '  <rect width="1010" height="430" fill="#ffffff"/>',
    ]
    lines += [_box(name, box) for name, box in BOXES.items()]
    lines += [_arrow(*arrow) for arrow in ARROWS]
    lines += [
        _path("M 750 91 L 775 91 L 775 351 L 750 351", "one"),
        _text(783, 282, "true ball", "start"),
        _path("M 570 221 L 430 221 L 430 124", "one"),
        _text(500, 214, "tracked ball", "middle"),
        _path("M 350 122 L 350 318", "one"),
        _text(358, 286, "launch", "start"),
        _path("M 28 91 L 14 91 L 14 351 L 28 351", "one"),
        _text(20, 282, "true pose", "start"),
        _text(505, 412, "Recorder and view read the rows of all others but the images.", "middle"),
    ]
    return "\n".join(lines) + "\n</svg>\n"


def _box(name: str, box: Box) -> str:
    fill, stroke = box.colour
    rate = f"{RATES[name]:g} Hz" if name in RATES else ""
    what = f"{box.text}, {rate}" if rate and len(box.text) < 16 else box.text
    title = name.replace("_", " ")
    title += f", {rate}" if rate and what == box.text else ""
    middle = box.x + WIDTH // 2
    return (
        f'  <rect x="{box.x}" y="{box.y}" width="{WIDTH}" height="{HEIGHT}" rx="8" fill="{fill}" '
        f'stroke="{stroke}" stroke-width="1.5"/>\n'
        f'  <text x="{middle}" y="{box.y + 27}" text-anchor="middle" font-weight="bold" '
        f'fill="#1f2d3d">{title}</text>\n'
        f'  <text x="{middle}" y="{box.y + 47}" text-anchor="middle" font-size="12" '
        f'fill="#1f2d3d">{what}</text>'
    )


def _arrow(begin: str, out: str, end: str, into: str, words: str, ways: str) -> str:
    (x, y), (u, v) = BOXES[begin].side(out), BOXES[end].side(into)
    across = y == v
    label = (
        _text((x + u) // 2, y - 7, words, "middle")
        if across
        else _text(x + 8, (y + v) // 2 + 4, words, "start")
    )
    return _path(f"M {x} {y} L {u} {v}", ways) + "\n" + label


def _path(path: str, ways: str) -> str:
    start = ' marker-start="url(#tip)"' if ways == "both" else ""
    return (
        f'  <path d="{path}" fill="none" stroke="#37474f" stroke-width="1.5"{start} '
        'marker-end="url(#tip)"/>'
    )


def _text(x: int, y: int, words: str, anchor: str) -> str:
    return (
        f'  <text x="{x}" y="{y}" text-anchor="{anchor}" font-size="12" fill="#37474f">'
        f"{words}</text>"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m o80_table_tennis.lab.picture")
    parser.add_argument("file", type=Path)
    parser.parse_args(arguments).file.write_text(drawn())


if __name__ == "__main__":
    main()
