"""Messages of the product: one golden file a language, made to be read in one sitting.

A message is a text of the sources that is raised or thrown, or that states something. Values in it
are written as {name}, alternatives as [this|that]. After a change of a message write the files
anew, and read the difference:

    python tests/python/test_messages.py
"""

import ast
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
GOLDEN = ROOT / "tests" / "messages"
FOLDERS = ("apps", "devices", "gateways", "include", "python", "robots", "simulators", "src")
LEFT_OUT = {"build", "build_backend", "studies", "tests"}
VALUE = re.compile(r"\{[^{}]*\}")
WORD = re.compile(r"(?<![^\s(;`'\[|-])[A-Za-z]+(?![^\s,.:;)?`'|\]-])")
STATES = re.compile(  # words that the title of a plot and the name of a thing lack
    r"\b(is|are|was|were|has|have|had|must|cannot|can|could|do|does|did|not|no|none|nothing|needs?"
    r"|unknown|give|choose|start|holds?|lacks?|differ|ended|failed|stopped|refused|already)\b",
    re.IGNORECASE,
)

LITERAL = r'"((?:\\.|[^"\\])*)"'
COMMENT = re.compile(rf'//[^\n]*|/\*.*?\*/|#[^\n]*|R"(\w*)\(.*?\)\1"|({LITERAL})', re.DOTALL)
ROUND = r"(?:[^()]|\((?:[^()]|\((?:[^()]|\([^()]*\))*\))*\))*"
STEP = rf"(?:(?:\.|->|::)\w++|\[[\w.]+\]|<\w+>|\({ROUND}\))"
VALUE_OF = rf"(\b\w++{STEP}*+)"
UNNAMED = re.compile(r"\.(?:view|str|c_str|text|size|what|name)\(\)")
UNWANTED = re.compile(rf"(?<!`)O80_DESCRIBE\({ROUND}\)|nb::sig\({ROUND}\)|std::c(?:err|out) <<")
JOINED = [
    (re.compile(rf"\bstd::string(?:_view)?\({LITERAL}\)"), '"{0}"'),
    (re.compile(rf"{LITERAL}\s*\+?\s*{LITERAL}"), '"{0}{1}"'),
    (re.compile(rf'\([^()"?]*\?\s*{LITERAL}\s*:\s*{LITERAL}\)'), '"[{0}|{1}]"'),
    (re.compile(rf"{LITERAL}\s*\+\s*{VALUE_OF}"), '"{0}{1}"'),
    (re.compile(rf"{VALUE_OF}\s*\+\s*{LITERAL}"), '"{0}{1}"'),
]


def is_message(text: str, raised: bool) -> bool:
    said = VALUE.sub("{}", text)
    words = len(WORD.findall(said))
    told = raised or (words > 2 and bool(STATES.search(said)))
    return told and words > 1 and text.count("\n") < 2 and '="' not in text


def python_text(node: ast.AST) -> str:
    """Text of an expression; `{names}` for a value such as ', '.join(sorted(self.names))."""
    match node:
        case ast.Constant(value=str(text)):
            return text
        case ast.JoinedStr(values=parts):
            return "".join(map(python_text, parts))
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return python_text(left) + python_text(right)
        case ast.IfExp(body=one, orelse=other) | ast.BoolOp(values=[one, other]):
            return f"[{python_text(one)}|{python_text(other)}]"
        case ast.Attribute(attr=name) | ast.Subscript(slice=ast.Constant(value=str(name))):
            return f"{{{name}}}"
        case ast.Call(args=[of, *_]) if isinstance(of, (ast.Name, ast.Attribute, ast.Call)):
            return python_text(of)
        case ast.FormattedValue(value=of) | ast.Subscript(value=of) | ast.Call(func=of):
            return python_text(of)
    return f"{{{ast.unparse(node)}}}"


def python_messages(node: ast.AST, raised: bool = False) -> Iterator[str]:
    match node:
        case ast.Expr(value=ast.Constant()) | ast.Subscript() | ast.arg():
            return  # a docstring, an annotation
        case ast.Call(func=ast.Name(id="option")) | ast.keyword(arg="help" | "epilog" | "title"):
            return  # a description
        case ast.Constant() | ast.JoinedStr() | ast.IfExp() | ast.BinOp(op=ast.Add()):
            text = python_text(node)
            if VALUE.sub("", text).strip(" []|"):
                yield from [text] if is_message(text, raised) else []
                return
    for child in ast.iter_child_nodes(node):
        yield from python_messages(child, raised or isinstance(node, ast.Raise))


def joined(form: str, found: re.Match[str]) -> str:
    """Values between literals become `{name}`, such as std::string(row.name.view())."""
    parts = list(found.groups())
    for i, part in enumerate(parts):
        if found.string[found.start(i + 1) - 1] != '"':
            names = re.findall(r"\b[A-Za-z_]\w*", UNNAMED.sub("", part))
            parts[i] = f"{{{names[-1] if names else part}}}"
    return form.format(*parts)


def cpp_messages(code: str) -> Iterator[str]:
    code = code.replace("\\\n", "\n")
    code = UNWANTED.sub("", COMMENT.sub(lambda found: found[2] or "", code)).replace("<<", "+")
    code, before = re.sub(rf"\.add\(({ROUND})\)", r" + \1", code), ""
    while before != code:
        before = code
        for pattern, form in JOINED:
            code = pattern.sub(partial(joined, form), code)
    for found in re.finditer(LITERAL, code):
        text, thrown = found[1], re.search(r"\bthrow [\w:]+[({]\s*$", code[: found.start()])
        if is_message(text, bool(thrown)) and not (text[:1].isupper() and text.endswith(".")):
            yield text


def messages(language: str) -> str:
    """Text of a golden file: each source that has messages, and these in their order."""
    python = language == "python"
    texts = []
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py" if python else "*.[ch]pp")):
            place = path.relative_to(ROOT)
            if not LEFT_OUT & set(place.parts):
                code = path.read_text()
                found = python_messages(ast.parse(code)) if python else cpp_messages(code)
                lines = ["    " + text.strip().replace("\n", "\\n") for text in found]
                texts += ["", str(place), *lines] if lines else []
    return "\n".join([*texts[1:], ""])


@pytest.mark.parametrize("language", ["python", "cpp"])
def test_the_golden_file_holds_the_messages_of_the_sources(language: str) -> None:
    held = (GOLDEN / f"{language}.txt").read_text()

    assert messages(language) == held, "read the difference, then: python " + __file__


if __name__ == "__main__":
    for language in ("python", "cpp"):
        (GOLDEN / f"{language}.txt").write_text(messages(language))
