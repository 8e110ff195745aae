"""Writes the reference of the site from the installed packages and headers."""

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from typer.main import get_command

from o80.base import installation
from o80.cli import app

MODULES = (
    *("o80", "o80.robots", "o80.drivers", "o80.learning", "o80.learning.training"),
    *("o80.learning.rollouts", "o80.hybrid", "o80.testing", "o80.plot", "o80.difference"),
    *("o80.datasets.episodes", "o80.datasets.lerobot", "o80.datasets.minari"),
    *("o80_mujoco", "o80_mujoco.balls", "o80_arms", "o80_arms.fakes", "o80_pam"),
    *("o80_devices.motion_capture", "o80_devices.ball_tracking", "o80_devices.ball_launcher"),
    *("o80_devices.clock", "o80_table_tennis", "lerobot_robot_o80"),
)
Function = ast.FunctionDef | ast.AsyncFunctionDef
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
Node = ast.ClassDef | Function | ast.Assign | ast.AnnAssign


class Found(NamedTuple):
    """A definition, and the module that holds it."""

    module: str
    node: Node
    text: str  #: docstring, also that below an attribute or in its `#:` comment


@cache
def file_of(module: str) -> Path | None:
    """The source of an installed module, or the stub of a compiled one."""
    top, *rest = module.split(".")
    spec = find_spec(top)
    for folder in (spec.submodule_search_locations if spec else None) or ():
        path = Path(folder, *rest)
        for file in (path / "__init__.py", path.with_suffix(".py"), path.with_suffix(".pyi")):
            if file.exists():
                return file
    return None


def statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """The statements of a body, those below `if TYPE_CHECKING` included."""
    for node in body:
        if isinstance(node, ast.If):
            yield from statements(node.body)
        else:
            yield node


def definitions(module: str, body: list[ast.stmt]) -> Iterator[tuple[str, Found]]:
    """All definitions of a body by name; an overloaded name comes several times."""
    file = file_of(module)
    lines = file.read_text().splitlines() if file else []
    for node, following in pairwise([*statements(body), None]):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, Found(module, node, ast.get_docstring(node) or "")
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            target = node.target if isinstance(node, ast.AnnAssign) else node.targets[0]
            text = re.findall(r"#: (.*)", lines[node.lineno - 1])
            above = lines[: node.lineno - 1]
            while above and above[-1].strip().startswith("#: "):
                text.insert(0, above.pop().strip()[3:])
            match following:
                case ast.Expr(value=ast.Constant(value=str(below))):
                    text = [inspect.cleandoc(below)]
            for name in re.findall(r"\w+", ast.unparse(target)):  # of BEGIN, END = ... both
                yield name, Found(module, node, "\n".join(text))


@cache
def tree(module: str) -> ast.Module:
    file = file_of(module)
    return ast.parse(file.read_text() if file else "")


@cache
def top_level(module: str) -> list[tuple[str, Found]]:
    return [*definitions(module, tree(module).body)]


def find(module: str, name: str) -> list[Found]:
    """Definitions of a name, wherever the module has it from."""
    if here := [found for key, found in top_level(module) if key == name]:
        return here
    first, _, rest = name.partition(".")
    for node in statements(tree(module).body):
        for alias in node.names if isinstance(node, (ast.Import, ast.ImportFrom)) else ():
            if first != (alias.asname or alias.name):
                continue
            within = getattr(node, "module", None)
            if rest:
                return find(f"{within}.{alias.name}" if within else alias.name, rest)
            if within and not file_of(f"{within}.{alias.name}"):
                return find(within, alias.name)
    return []


def public_names(module: str) -> list[str]:
    """The names of `__all__`, or those that the module defines or passes on."""
    names: list[str] = []
    for node in statements(tree(module).body):
        match node:
            case ast.Assign(targets=[ast.Name(id="__all__")], value=ast.List(elts=elements)):
                return [ast.literal_eval(each) for each in elements]
            case ast.ImportFrom(names=aliases):
                names += [each.name for each in aliases if each.asname == each.name]
    described = ast.ClassDef, *FUNCTIONS  # values only if a text says what they are
    names += [n for n, each in top_level(module) if each.text or isinstance(each.node, described)]
    return [*(["__version__"] if module == "o80" else []), *(n for n in names if n[0] != "_")]


# ------------------------------------------------------------------------------------- text


def escaped(text: str) -> str:
    """A text as reStructuredText: `code` stays code, docs/page.md becomes a link."""

    def part(match: re.Match[str]) -> str:
        code, page, section, plain = match.groups()
        if page:
            return f":doc:`{page}.md{section} </{page}>`"
        return f"``{code}``" if code else re.sub(r"([*_|\\`])", r"\\\1", plain)

    parts = r"`{1,2}([^`]+)`{1,2}|\b(docs/[\w/]+)\.md((?:#[\w-]+)?)|(.)"
    return re.sub(parts, part, text, flags=re.DOTALL)


def is_code(text: str) -> bool:
    try:
        return bool(set("(=") & set(text)) and bool(ast.parse(textwrap.dedent(text)).body)
    except SyntaxError:
        return False


def prose(text: str) -> list[str]:
    """A docstring as reStructuredText: lines "name: text" are items, programs are blocks."""
    lines: list[str] = []
    code = False
    for paragraph in text.split("\n\n"):
        begun, code = code, is_code(paragraph) or (code and paragraph[:1] == " ")
        if code:
            lines += [] if begun else [".. code-block:: python", ""]
            lines += [*(f"   {each}" for each in paragraph.splitlines()), ""]
            continue
        item = False
        for line in paragraph.splitlines():
            match = re.match(r"(- |[a-z_*]\w*(?:, [a-z_*]\w*)*: )(.*)", line)
            if match and (item or not lines or lines[-1][-1:] in ("", ".", ":")):
                begin = "" if match[1] == "- " else f"``{match[1][:-2]}``: "
                lines += ["", f"- {begin}{escaped(match[2])}"]
                item = True
            elif item and line[:1] == " ":
                lines.append(f"  {escaped(line.strip())}")
            else:
                lines += ["", escaped(line.strip())] if item else [escaped(line.strip())]
                item = False
        lines.append("")
    return lines


def first_sentence(text: str) -> str:
    return escaped(re.split(r"(?<=\.) |\n\n", " ".join(text.split("\n\n")[0].split()))[0])


class _Unquoted(ast.NodeTransformer):
    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        try:
            return ast.parse(node.value, mode="eval").body if isinstance(node.value, str) else node
        except SyntaxError:
            return node


def annotation(node: ast.expr | None) -> str:
    return "" if node is None else ast.unparse(_Unquoted().visit(node))


# ----------------------------------------------------------------------------------- Python


def signature(name: str, node: Function, *, method: bool) -> str:
    arguments = node.args
    decorators = [ast.unparse(each) for each in node.decorator_list]
    if method and "staticmethod" not in decorators:
        (arguments.posonlyargs or arguments.args)[:1] = []
    for each in ast.walk(arguments):
        if isinstance(each, ast.arg) and each.annotation:
            each.annotation = _Unquoted().visit(each.annotation)
    returned = annotation(node.returns)
    return f"{name}({ast.unparse(arguments)})" + (f" -> {returned}" if returned else "")


def bases(found: Found) -> list[Found]:
    """The classes of ours that a class inherits, itself first."""
    assert isinstance(found.node, ast.ClassDef)
    classes = [found]
    for base in found.node.bases:
        plain = base.value if isinstance(base, ast.Subscript) else base
        for each in find(found.module, ast.unparse(plain))[:1]:
            if isinstance(each.node, ast.ClassDef):
                classes += bases(each)
    return classes


def members(found: Found) -> dict[str, list[Found]]:
    named: dict[str, list[Found]] = {}
    for base in bases(found):
        assert isinstance(base.node, ast.ClassDef)
        own: dict[str, list[Found]] = {}
        for name, member in definitions(base.module, base.node.body):
            own.setdefault(name, []).append(member)
        named |= {name: several for name, several in own.items() if name not in named}
    return named


def entry(kind: str, signatures: list[str], text: str, *options: str) -> list[str]:
    begin = f".. py:{kind}:: "
    more = [" " * len(begin) + each for each in signatures[1:]]
    head = [begin + signatures[0], *more, *(f"   {option}" for option in options), ""]
    return [*head, *(f"   {line}" if line else "" for line in prose(text)), ""]


def describe(name: str, several: list[Found], *, method: bool = False) -> list[str]:
    """The entry of a function, a class with its members, or a value."""
    node = several[0].node
    text = next((found.text for found in reversed(several) if found.text), "")
    if isinstance(node, ast.ClassDef):
        inside = members(several[0])
        maker = next((inside[each] for each in ("__init__", "__new__") if each in inside), None)
        made = name
        if maker and isinstance(maker[0].node, FUNCTIONS):
            made = signature(name, maker[0].node, method=True).partition(" -> ")[0]
        lines = entry("class", [made], text)
        derived = ", ".join(ast.unparse(base) for base in node.bases)
        if several[0].module == "o80.base.errors" and derived:
            lines += [f"   Derived from ``{derived}``.", ""]
        for key, member in inside.items():
            if key[0] != "_":
                lines += [
                    f"   {line}" if line else "" for line in describe(key, member, method=True)
                ]
        return lines
    if isinstance(node, (ast.Assign, ast.AnnAssign)):
        value = ast.unparse(node.value) if node.value else ""
        options = [f":value: {value}"] if 0 < len(value) < 200 else []
        if isinstance(node, ast.AnnAssign):
            options.append(f":type: {annotation(node.annotation)}")
        return entry("attribute" if method else "data", [name], text, *options)
    functions = [found.node for found in several if isinstance(found.node, FUNCTIONS)]
    decorators = [{ast.unparse(each) for each in each.decorator_list} for each in functions]
    if decorators[0] & {"property", "cached", "cached_property"}:
        return entry("property", [name], text, f":type: {annotation(functions[0].returns)}")
    if any("overload" in each for each in decorators):
        functions = [f for f, each in zip(functions, decorators, strict=True) if "overload" in each]
    options = [f":{each}:" for each in ("classmethod", "staticmethod") if each in decorators[0]]
    options += [":async:"] if isinstance(functions[0], ast.AsyncFunctionDef) else []
    shown = [signature(name, each, method=method) for each in functions]
    return entry("method" if method else "function", shown, text, *options)


def titled(title: str) -> list[str]:
    return [title, "=" * len(title), ""]


def head(page: str) -> list[str]:
    """Title and text of a module's page; of a room of o80 one sentence, as the rest is on files."""
    text = ast.get_docstring(tree(page)) or ""
    text = text if page in MODULES else text.split("\n\n")[0]
    module = [] if page == "o80" else [f".. py:module:: {page}", ""]
    return [*titled(page), *module, *prose(text)]


def python_pages() -> dict[str, list[str]]:
    """Lines by page; the names of o80 stand on a page for each of its rooms."""
    pages = {"index": [*titled("Python"), ".. py:module:: o80", ""]}
    written: set[tuple[str, str]] = set()  # module and name of definitions: each is told once
    for module in MODULES:
        for name in public_names(module):
            several = find(module, name)
            key = (several[0].module, getattr(several[0].node, "name", name)) if several else None
            if key is None or key in written:  # a module, or it stands elsewhere
                continue
            written.add(key)
            room = key[0].removeprefix("o80.").partition(".")[0].replace("_core", "frontend")
            room = "errors" if key[0] == "o80.base.errors" else room
            page = f"o80.{room}" if module == "o80" != room else module
            lines = pages.setdefault(page, head(page))
            lines += [f".. py:currentmodule:: {module}", "", *describe(name, several)]
            pages["index"].append(f"- :py:obj:`{module}.{name}`: {first_sentence(several[0].text)}")
    return pages


# --------------------------------------------------------------------------- the command line


def plain(text: str | None) -> str:
    """The help of a command as reStructuredText."""
    return escaped(re.sub(r"\[bold\](.*?)\[/bold\]", r"`\1`", inspect.cleandoc(text or "")))


def command_page() -> list[str]:
    """Each command with its arguments and options, as `--help` shows them."""
    for name in [*app.COMMANDS, *installation.announced("o80.commands")]:
        app.register(name)
    return [*titled("Commands"), *command("o80", get_command(app.app))]


def command(name: str, found: Any) -> list[str]:
    lines = [name, "-" * len(name), "", f".. program:: {name}", ""] if " " in name else []
    for paragraph in inspect.cleandoc(found.help or "").split("\n\n"):
        lines += [plain(paragraph), ""]
    for each in found.params:
        if each.name == "help":
            continue
        shown = each.human_readable_name if each.param_type_name == "argument" else None
        choices = "|".join(str(getattr(c, "value", c)) for c in getattr(each.type, "choices", ()))
        word = "" if getattr(each, "is_flag", False) else f" <{choices or each.type.name}>"
        lines += [f".. option:: {shown or ', '.join(option + word for option in each.opts)}", ""]
        default = each.default
        known = default not in (None, False, "", ()) and not callable(default)
        after = [f"Default: ``{default}``."] * known + ["Required."] * each.required
        lines += ["   " + " ".join([plain(getattr(each, "help", "") or ""), *after]).strip(), ""]
    for key, below in getattr(found, "commands", {}).items():
        lines += command(f"{name} {key}", below)
    return lines


# ---------------------------------------------------------------------------------------- C++

NAMED = re.compile(
    r"^#define (\w+)|^O80_ERROR\((\w+)|^(?:enum class|class|struct|enum|concept|using) (\w+)"
    r"|^(?:inline )?constexpr [^(]*?(\w+)(?: =|\{)|(operator\W+|\w+)\("
)


def entities(text: str) -> Iterator[tuple[str, list[str]]]:
    """Name and lines of what a header declares in the namespace o80, comments included."""
    lines: list[str] = []
    inner = ""
    # of a macro the first line
    text = re.sub(r"^(#define .*?) *\\\n(?:.*\\\n)*.*", r"\1", text, flags=re.MULTILINE)
    for line in text.splitlines():
        if inner or re.match(r"namespace (?!o80 \{)", line):
            inner = "" if inner and line.startswith(inner) else inner or "}  // namespace"
            continue
        begun = any(each[:1] != "/" for each in lines)
        if re.match(r"#(?!define O80)|namespace|}  // namespace|static_assert|$", line):
            lines = [*lines, line] if begun and not line else []
            continue
        lines.append(line)
        inside = line[0] == " " and any(each[-1:] == "{" for each in lines)
        if inside or line.startswith(("//", "template", "requires")):
            continue
        if line.partition(" //")[0].rstrip()[-1] in ";}" or line[0] == "#":
            head = [each for each in lines if not re.match(r"(/|template|requires|  )", each)]
            match = next(filter(None, map(NAMED.search, head)), None)
            forward = re.match(r"(enum )?(class|struct) [\w :]+;|friend", head[0])
            elsewhere = re.match(r".*\w::~?\w+$", head[0].partition("(")[0])  # of a class above
            private = forward or elsewhere or (line[0] == "#" and lines[0][0] == "#")
            if match and not private:
                yield next(filter(None, match.groups())).strip(), lines
            lines = []


def shown(lines: list[str]) -> list[str]:
    """A declaration without private members and bodies of functions."""
    kept: list[str] = []
    end = ""
    for line in lines:
        if end:
            end = "" if line.startswith(end) or (end == " public" and line == "};") else end
            if end or line != "};":
                continue
        indent = line[: len(line) - len(line.lstrip())]
        if re.match(r" (private|protected):", line):
            end = " public"
            continue
        if re.match(r"\s+: \w+[({]", line):  # the begin of a list of initialisers
            kept[-1] += ";" if line[-1] in "{}" else ""
            end = f"{indent[4:]}}}" if line[-1] == "{" else ""
        elif ")" in line and line.endswith("{"):
            kept.append(re.sub(r"\) : \w+[({].*", ")", line[:-2]) + ";")
            outer = next((each for each in reversed(kept) if not each.startswith(indent + " ")), "")
            end = outer[: len(outer) - len(outer.lstrip())] + "}"
        else:
            kept.append(re.sub(r"(\).*?) \{.*\}$", r"\1;", line))
    return kept


def header_page(folder: Path, seen: set[str]) -> list[str]:
    """One page of a folder of headers. seen: names that have their address."""
    lines = titled(f"o80/{folder.name}")
    for header in sorted(folder.glob("*.hpp")):
        title = f"o80/{folder.name}/{header.name}"
        lines += [title, "-" * len(title), ""]
        for name, text in entities(header.read_text()):
            comment = [each[4:] for each in text if each.startswith("///")]
            again = ["   :no-index:"] if name in seen else []
            seen.add(name)
            code = shown([each for each in text if not each.startswith("///")])
            lines += [f".. declaration:: {name}", *again, ""]
            lines += [f"   {line}" for line in prose("\n".join(comment))]
            lines += ["   .. code-block:: cpp", "", *(f"      {line}" for line in code), ""]
    return lines


def write_reference(folder: Path) -> None:
    """Writes all pages of the reference below a folder."""
    pages = {f"python/{name}": lines for name, lines in python_pages().items()}
    pages["commands"] = command_page()
    seen: set[str] = set()
    include = Path(installation.prefix()) / "include" / "o80"
    for each in sorted(path for path in include.iterdir() if path.is_dir()):
        pages[f"cpp/{each.name}"] = header_page(each, seen)
    for name, lines in pages.items():
        file = folder / f"{name}.rst"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("\n".join(lines) + "\n")
