"""``o80 film``: a recording as a film, its robots side by side."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from o80.base.errors import InvalidArgument
from o80.cli.numbers import positive

if TYPE_CHECKING:
    from o80.view.source import Source


def film(
    recording: Annotated[Path, typer.Argument(help="A recording, or a folder of --split.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="NAME.mp4 or NAME.gif.")],
    segment: Annotated[
        list[str] | None,
        typer.Option(
            help="A robot to show, by its segment; from left to right (default: all with a model)."
        ),
    ] = None,
    begin: Annotated[float, typer.Option("--from", help="Seconds after its first row.")] = 0.0,
    end: Annotated[float | None, typer.Option("--to", help="Likewise; default: the last.")] = None,
    speed: Annotated[float, typer.Option(help="0.5: half as fast as recorded.")] = 1.0,
    rate: Annotated[
        float, typer.Option(min=1, max=120, callback=positive, help="Frames a second.")
    ] = 25.0,
    size: Annotated[tuple[int, int], typer.Option(help="Pixels of each robot.")] = (480, 360),
    camera: Annotated[
        str | None, typer.Option(help="Camera of the models: a name, or -1 from outside.")
    ] = None,
    model_files: Annotated[
        bool, typer.Option("--model-files", help="Read files that the recorded models name.")
    ] = False,
) -> None:
    """Draw the models of a recording's robots at the same times, side by side, into a film.

    Seconds are those of the first robot that is shown.
    """
    from o80.view.pictures import Pictures, write_film
    from o80.view.source_list import SourceList

    if output.suffix not in (".mp4", ".gif"):
        raise InvalidArgument(f"a film is NAME.mp4 or NAME.gif, got {output}")
    if output.suffix == ".gif" and rate > 50:
        raise InvalidArgument(f"browsers show at most 50 frames a second of a gif, got {rate:g}")
    if not output.parent.is_dir():
        raise InvalidArgument(f"there is no folder {output.parent} for {output.name}")
    if not (min(size) >= 16 and max(size) <= 4096):
        raise InvalidArgument(f"--size must be 16 to 4096 pixels each, got {size[0]} {size[1]}")
    if not 0.01 <= speed <= 1000:
        raise InvalidArgument(f"--speed must be 0.01 to 1000, got {speed:g}")
    size = (size[0] + size[0] % 2, size[1] + size[1] % 2)  # players want even ones
    sources = SourceList([str(recording)], model_files=model_files).now()
    runs = {source.label: source for source in sources}
    for name in segment or ():
        if name not in runs:
            there = ", ".join(runs)
            raise InvalidArgument(f"no segment '{name}' in {recording}; there are: {there}")
    shown = [runs[name] for name in segment or runs if segment or runs[name].model]
    if not shown:
        raise InvalidArgument(f"no robot in {recording} has a model that could be drawn")
    view = int(camera) if camera is not None and camera.lstrip("-").isdigit() else camera
    with ExitStack() as stack:
        painters = [
            stack.enter_context(Pictures(each, size=size, camera=view, model_files=model_files))
            for each in shown
        ]

        def pictures() -> Iterator[Any]:
            for rows in _rows(shown, begin, end, speed / rate):
                yield np.hstack([each.draw(row) for each, row in zip(painters, rows, strict=True)])

        try:
            count = write_film(output, pictures(), frames_per_second=rate)
        except OSError:
            raise InvalidArgument(f"{output} cannot be written: see ffmpeg's text") from None
    print(f"{output}: {count} frames")


def _rows(
    sources: list["Source"], begin: float, end: float | None, step: float
) -> Iterator[list[Any]]:
    """Yields the rows of all robots at the times of the first robot."""
    first = sources[0]
    last = first.seconds(first.extent()[1])
    end = last if end is None else min(end, last)
    if not 0 <= begin < end:
        raise InvalidArgument(
            f"'{first.label}' lasts from 0 to {last:.3f} s: give --from and --to within that"
        )
    for at in np.arange(begin, end, step):
        row = first.row(first.nanoseconds(float(at)))
        rows = [row]
        for other in sources[1:]:
            time = other.time_with(first, row)
            if time is None:
                names = f"'{first.label}' and '{other.label}'"
                raise InvalidArgument(f"{names} never ran at the same time: choose with --segment")
            rows.append(other.row(time))
        yield rows
