"""Completion of names inside the strings of a call, in IPython and Jupyter.

`import o80` enables it if IPython was imported before; otherwise run `%load_ext o80.notebook`.
"""

import inspect
import re
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from o80.frontend.segments import segments

_ACTUATORS = {  # the argument that names actuators
    "add_command": 0,
    "add_purge": 0,
    "add_trajectory": 1,
    "interrupt": 0,
    "move_to": 0,
    "prepared_burst": 1,
    "preview": 0,
    "purge": 0,
}
_REQUESTS = (
    "add_request",
    "end_request",
    "on",
    "prepared_request",
    "progress",
    "request",
    "running",
)
_SEGMENTS = ("Frontend", "clean", "halt", "stop")
_NAMES = ("actuator", "actuators", "segment", "name")  # keywords that give such an argument


def enable() -> None:
    """Completes names in the IPython of this process, if there is one."""
    ip = sys.modules["IPython"].get_ipython()
    if ip is not None:
        load_ipython_extension(ip)


def load_ipython_extension(ip: Any) -> None:
    """Called by ``%load_ext``."""
    try:
        from IPython.core.completer import SimpleCompletion, context_matcher
    except ImportError:  # before IPython 8.6
        return
    matchers = ip.Completer.custom_matchers
    if any(getattr(each, "matcher_identifier", "") == __name__ for each in matchers):
        return

    @context_matcher(identifier=__name__)  # type: ignore[untyped-decorator]
    def matcher(context: Any) -> dict[str, Any]:
        lines = context.full_text.split("\n")[: context.cursor_line]
        found = names_at("\n".join([*lines, context.text_until_cursor]), ip.user_ns)
        if found is None:
            return {"completions": []}
        names, begun = found
        return {
            "completions": [SimpleCompletion(text=name, type="o80") for name in names],
            "matched_fragment": begun,
            "suppress": bool(names),
        }

    matchers.append(matcher)


def names_at(text: str, namespace: dict[str, Any]) -> tuple[list[str], str] | None:
    """Completions for the string that is open at the end of `text`, and the part that is typed.

    None if the string names nothing of o80.
    """
    opened = re.search(r"""(["'])([\w.\-\[\]]*)$""", text)
    if opened is None or text.rpartition("\n")[2].count(opened[1]) % 2 == 0:
        return None
    before, begun = text[: opened.start()], opened[2]
    if subscript := re.search(r"([A-Za-z_][\w.]*)\[\s*$", before):
        names: Iterable[str] | None = _keys(_resolved(subscript[1].split("."), namespace))
    else:
        names = _arguments(*_call_around(before), namespace)
    return None if names is None else ([name for name in names if name.startswith(begun)], begun)


def _call_around(text: str) -> tuple[str, int, str | None]:
    """Name of the function whose call is open at the end of `text` (empty: none), place of the
    argument, and its keyword if it has one.
    """
    depth, commas, begin = 0, 0, len(text)
    for i in range(len(text) - 1, -1, -1):
        character = text[i]
        if character in ")]}":
            depth += 1
        elif character in "([{" and depth:
            depth -= 1
        elif character in "[{":  # the string is in a list
            commas, begin = 0, i
        elif character == "(":
            callee = re.search(r"[A-Za-z_][\w.]*$", text[:i])
            keyword = re.match(r"\s*(\w+)\s*=", text[(begin if commas else i) + 1 :])
            return callee[0] if callee else "", commas, keyword[1] if keyword else None
        elif character == "," and not depth:
            commas += 1
            begin = i if commas == 1 else begin
    return "", 0, None


def _is_ours(found: Any) -> bool:
    return any(each.__module__.startswith("o80.") for each in type(found).__mro__)


def _resolved(path: list[str], namespace: dict[str, Any]) -> Any:
    """The object of a name, or None. No property of the user's objects is called."""
    found = namespace.get(path[0])
    for name in path[1:]:
        if _is_ours(found) or found is sys.modules["o80"]:
            found = getattr(found, name, None)
        else:
            found = inspect.getattr_static(found, name, None)
    return found


def _keys(found: Any) -> Sequence[str] | None:
    """Completions of a subscript: of a record, or of the structured array of a row."""
    names = getattr(found, "keys", None) if _is_ours(found) else None
    return names() if callable(names) else getattr(getattr(found, "dtype", None), "names", None)


def _arguments(
    path: str, place: int, keyword: str | None, namespace: dict[str, Any]
) -> Iterable[str] | None:
    """The names that an argument of a call may have."""
    if not path or keyword not in (None, *_NAMES):
        return None
    *owner, verb = path.split(".")
    found = _resolved(owner or [verb], namespace)
    is_first = keyword is not None or place == 0
    if inspect.ismodule(found) and found.__name__ == "o80.robots":
        if verb != "load" or not is_first:
            return None
        from o80.robots.robot import list as all_robots

        return (each.name for each in all_robots())
    if found is sys.modules["o80"] or (
        not owner and getattr(found, "__module__", "").startswith("o80.")
    ):
        is_segment = verb in _SEGMENTS and is_first
        return (each.name for each in segments()) if is_segment else None
    layout = getattr(found, "_layout", None) if _is_ours(found) else None
    if layout is None or not owner:
        return None
    if verb in _ACTUATORS and (keyword is not None or place == _ACTUATORS[verb]):
        return (each["name"] for each in layout.schema["actuators"])
    if verb in _REQUESTS and is_first:
        return (each["name"] for each in layout.schema["requests"])
    return None
