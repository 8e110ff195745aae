"""How a backend was started, in lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

from o80.base.screen import plain, style

if TYPE_CHECKING:
    from o80.rows.provenance import Provenance


def started_with(provenance: Provenance) -> list[str]:
    """Library, options and versions, in lines."""
    lines = []
    if provenance.library:
        built = f"  {style(plain(provenance.built_with), 'dim')}" if provenance.built_with else ""
        lines.append(f"library  {plain(provenance.library)}{built}")
    if provenance.options:
        lines.append(f"options  {_assignments(provenance.options)}")
    lines.append(f"loop     {_assignments(provenance.run_options)}")
    for file in provenance.files:
        hashed = f"sha256 {file.sha256[:12]}" if file.sha256 else "not read"
        lines.append(f"file     {plain(file.path)}  {style(hashed, 'dim')}")
    version = (
        f"{provenance.version}, sources {provenance.source_hash[:12]}, "
        f"motion rules {provenance.motion_rules}"
    )
    return [*lines, f"o80      {plain(version)}"]


def _assignments(options: dict[str, str]) -> str:
    return ", ".join(f"{plain(name)}={plain(text)}" for name, text in options.items())
