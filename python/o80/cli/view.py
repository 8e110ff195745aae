"""``o80 view``: robots and recordings in the browser."""

from pathlib import Path
from typing import Annotated

import typer

from o80.base.screen import complain


def view(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Segments, patterns such as 'arm*', recordings (.mcap). Default: all segments."
        ),
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to listen on; 0.0.0.0 lets other computers in.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="0: any free one.")] = 0,
    control: Annotated[
        bool, typer.Option("--control", help="The page may also resume a halted robot.")
    ] = False,
    browser: Annotated[
        bool | None, typer.Option(help="Open the page (default: if there is a screen).")
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(
            "--html",
            help="Write recordings into this file, which any browser opens without o80; no server.",
        ),
    ] = None,
    model_files: Annotated[
        bool,
        typer.Option(
            "--model-files",
            help="Read the files (meshes) that models of recordings name; only if you trust them.",
        ),
    ] = False,
) -> None:
    """Show robots and recordings in the browser: in 3D, as curves, and back in time.

    The page can always halt a robot. Its address holds a secret token: share it with care.
    """
    if html is not None:
        from o80.view.page_file import write_page

        size = write_page(names or [], html, model_files=model_files)
        print(f"written to {html}, {size / 1e6:.1f} MB: open it in a browser")
        return
    from o80.view.browser import has_screen, open_browser
    from o80.view.guard import is_loopback
    from o80.view.serve import page_server, wait_for_end

    with page_server(
        names or [], host=host, port=port, control=control, model_files=model_files
    ) as server:
        print(server.url, flush=True)
        if not is_loopback(host):
            complain(
                "anyone on the network who learns this address can watch and halt the robots; "
                "the connection is not encrypted"
            )
        if has_screen() if browser is None else browser:
            open_browser(server.url)
        complain("serving; Ctrl-C ends it")
        wait_for_end(until_eof=False)
