"""How a backend was started."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Self

from o80.base.finite import json_text
from o80.base.screen import html, plain, style

_TEXTS = ("robot", "version", "source_hash", "library", "library_sha256", "built_with")


@dataclass(frozen=True)
class ProvenanceFile:
    """A file that is named by an option of a robot."""

    option: str
    path: str  #: absolute
    sha256: str  #: SHA-256 of its content, in the form of ``sha256sum``; empty: not read


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """How a backend was started: all that is needed to start the same robot again.

    Texts of options have the form of flags of ``o80 run``.
    """

    robot: str  #: name, for `o80.robots.load`
    options: dict[str, str]  #: of the robot, with defaults and drawn seeds
    run_options: dict[str, str]  #: of the backend and its loop, with defaults
    version: str  #: of o80
    source_hash: str  #: hash of the sources of the o80 that ran it
    #: A row's time plus this is wall-clock time, in ns since 1970. As of the start: the clocks may
    #: drift apart, or be set, while the backend runs.
    wall_clock_offset: int
    library: str = ""  #: absolute path of the robot's library, program or FILE.py:Class
    library_sha256: str = ""  #: SHA-256 of the library
    built_with: str = ""  #: versions of the libraries that the robot was built with
    files: tuple[ProvenanceFile, ...] = ()  #: files that are named by the robot's options
    #: Version of the rules that compute desired states from commands; see `o80 replay`. Recordings
    #: without a version were made under version 1.
    motion_rules: int = 1

    def _repr_html_(self) -> str:
        """Makes a table for a notebook."""
        lines = [line.partition(" ") for line in started_with(self)]
        return html(("started with", ""), [(what, text.strip()) for what, _, text in lines])

    def as_json(self) -> str:
        """Converts to one line of JSON, which `from_json` reads. Pure ASCII."""

        return json_text(asdict(self), sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Parses the text of `as_json`; ignores fields of later versions.

        Raises ValueError, TypeError, KeyError, RecursionError if it is damaged.
        """
        import json

        found = json.loads(text)
        known = {field.name for field in fields(cls)}
        provenance = cls.from_fields({name: found[name] for name in found if name in known})
        pairs = (provenance.options, provenance.run_options, *map(vars, provenance.files))
        if not all(isinstance(each, dict) for each in pairs):
            raise TypeError("options are not a mapping")
        texts = [getattr(provenance, name) for name in _TEXTS]
        texts += [text for each in pairs for pair in each.items() for text in pair]
        numbers = provenance.wall_clock_offset, provenance.motion_rules
        if not all(isinstance(each, str) for each in texts):
            raise ValueError("a value is not a text")
        if not all(isinstance(each, int) for each in numbers):
            raise ValueError("a value is not a whole number")
        if not 0 <= provenance.motion_rules < 2**31:
            raise ValueError("the version of the motion rules is out of range")
        return provenance

    @classmethod
    def from_fields(cls, given: Mapping[str, Any]) -> Self:
        """Makes a provenance from a mapping of its fields; `files` as mappings or sequences."""
        files = tuple(
            ProvenanceFile(**file) if isinstance(file, Mapping) else ProvenanceFile(*file)
            for file in given.get("files", ())
        )
        return cls(**{**given, "files": files})


def started_with(provenance: Provenance) -> list[str]:
    """Formats library, options and versions as lines."""
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
    """Formats names and texts; of a text with several lines, as that of a face, only the first."""
    lines = {name: text.partition("\n") for name, text in options.items()}
    return ", ".join(
        f"{plain(name)}={plain(' '.join(first.split()) if more else first)}{'...' if more else ''}"
        for name, (first, more, _) in lines.items()
    )
