"""The mistakes that can be made in a source file, of six kinds.

sign        `+` for `-`, `+=` for `-=`, a unary minus too many or too few
weight      `*` for `/`, `*=` for `/=`, a factor twice as large
wrap        an angle that is not wrapped
norm        a root, a square, an absolute value or a normalisation forgotten
bound       `<` for `<=` or `>`, `min` for `max`, `&&` for `||`, a negation forgotten
off-by-one  an integer, an index, the end of a range or the length of a part moved by one
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from .rust import Function, Source

KINDS = ("sign", "weight", "wrap", "norm", "bound", "off-by-one")

SIGNS = {"+": "-", "-": "+", "+=": "-=", "-=": "+="}
WEIGHTS = {"*": "/", "/": "*", "*=": "/=", "/=": "*="}
BOUNDS = {
    "<": ("<=", ">"),
    ">": (">=", "<"),
    "<=": ("<", ">="),
    ">=": (">", "<="),
    "&&": ("||",),
    "||": ("&&",),
}
EXTREMES = {"min": "max", "fmin": "fmax", "min_by": "max_by", "min_by_key": "max_by_key"}
EXTREMES |= {largest: least for least, largest in EXTREMES.items()}
# Moduli of remainders that wrap an angle.
TURN = re.compile(r"\b(TAU|PI|360\.0|180\.0)\b")
# Methods with their replacements, empty where the call is left out.
NORMS = {"abs": "", "sqrt": "", "normalize": "", "norm": "norm_squared", "norm_squared": "norm"}
DECIMAL = re.compile(r"(?P<digits>\d(?:_?\d)*)(?P<suffix>(?:_?[iu]\w+)?)")
NORM_FUNCTIONS = {"sqrt", "fabs", "abs"}
PARTS = {"skip", "take", "nth", "step_by", "chunks", "windows"}
# Macros whose arguments are ordinary code; the others assert, print or write texts.
CODE_MACROS = {"vec", "matches"}
# A wrong capacity changes nothing but the use of memory.
CAPACITIES = {"with_capacity", "reserve"}
ITEMS = {"const", "static", "use", "type"}


@dataclass(frozen=True, slots=True)
class Edit:
    """One way to spoil a span of a file."""

    kind: str
    start: int
    end: int
    new: str


@dataclass(frozen=True, slots=True)
class Mistake:
    """An edit, with everything that identifies it in another revision and to a reader."""

    package: str
    file: str
    function: str
    kind: str
    line: int
    # The lines that hold the edit, without and with the mistake, with single spaces.
    right: str
    wrong: str
    # The number among the edits of functions of this name with the same lines, from 1.
    occurrence: int
    start: int
    end: int
    new: str
    # The span that is written twice, once with the mistake.
    scope: tuple[int, int]

    @property
    def identity(self) -> str:
        """The line by which a list of equivalent mistakes and another revision know the mistake."""
        again = f" ({self.occurrence})" if self.occurrence > 1 else ""
        return f"{self.file} {self.function}{again}: {self.right} -> {self.wrong}"


def mistakes_of(package: str, file: str, source: Source) -> list[list[Mistake]]:
    """All mistakes of a file, in one list for each place."""
    found = []
    seen: Counter[tuple[str, str, str]] = Counter()
    for function in source.functions:
        places: dict[tuple[str, int, int], list[Mistake]] = defaultdict(list)
        for edit in sorted(_edits(source, function, file), key=lambda edit: (edit.start, edit.end)):
            scope = _scope(source, function, edit.start)
            if scope is None:
                continue
            first, last = source.lines_around(edit.start, edit.end)
            right = source.text[first:last]
            wrong = right[: edit.start - first] + edit.new + right[edit.end - first :]
            lines = (" ".join(right.split()), " ".join(wrong.split()))
            seen[function.name, *lines] += 1
            mistake = Mistake(
                package=package,
                file=file,
                function=function.name,
                kind=edit.kind,
                line=source.line_of(edit.start),
                right=lines[0],
                wrong=lines[1],
                occurrence=seen[function.name, *lines],
                start=edit.start,
                end=edit.end,
                new=edit.new,
                scope=scope,
            )
            places[edit.kind, edit.start, edit.end].append(mistake)
        found += places.values()
    return found


def _edits(source: Source, function: Function, file: str) -> Iterator[Edit]:
    tokens = source.tokens
    index = function.open + 1
    while index < function.close:
        behind = _left_out(source, index)
        if behind is not None:
            index = behind
            continue
        token = tokens[index]
        if token.kind == "punct":
            yield from _of_punctuation(source, index)
        elif token.kind == "ident":
            yield from _of_name(source, index, file)
        elif token.kind == "float":
            yield from _of_float(source, index)
        elif token.kind == "integer":
            yield from _of_integer(source, index)
        index += 1


def _left_out(source: Source, index: int) -> int | None:
    """The index behind code in which no mistake is planted, if such code begins at a token."""
    tokens = source.tokens
    token = tokens[index]
    if token.text == "#" and tokens[index + 1].text == "[":
        closer = source.partner[index + 1]
        attribute = source.text[token.start : tokens[closer].end]
        # The code below it may not be compiled.
        return closer + 1 if "cfg(" not in attribute else _statement_end(source, closer + 1)
    opener = source.macro(index)
    if opener is not None and token.text not in CODE_MACROS:
        return source.partner[opener] + 1
    if token.text in CAPACITIES and tokens[index + 1].text == "(":
        return source.partner[index + 1] + 1
    # `*const` is a type.
    if token.text in ITEMS and tokens[index - 1].text != "*":
        return _statement_end(source, index)
    closer = source.generics(index)
    return None if closer is None else closer + 1


def _statement_end(source: Source, index: int) -> int:
    while source.tokens[index].text not in (";", "}"):
        opens = source.tokens[index].text in ("(", "[", "{")
        braces = source.tokens[index].text == "{"
        index = source.partner[index] + 1 if opens else index + 1
        if braces and source.tokens[index].text not in (";", "."):
            return index
    return index


def _of_punctuation(source: Source, index: int) -> Iterator[Edit]:
    tokens = source.tokens
    token, following = tokens[index], tokens[index + 1]
    text = token.text
    binary = source.is_operand_end(index - 1) and source.spaced(index)

    def instead(kind: str, new: str) -> Edit:
        return Edit(kind, token.start, token.end, new)

    if binary and text in SIGNS:
        yield instead("sign", SIGNS[text])
    if binary and text in WEIGHTS:
        yield instead("weight", WEIGHTS[text])
        if following.kind in ("float", "ident") or following.text == "(":
            yield Edit("sign", following.start, following.start, "-")
    if binary and text in BOUNDS:
        for new in BOUNDS[text]:
            yield instead("bound", new)
    prefix = not source.is_operand_end(index - 1) and source.adjoins(index)
    if text == "-" and prefix:
        yield instead("sign", "")
    if text == "!" and prefix and following.text not in ("[", "="):
        yield instead("bound", "")
    if text in ("..", "..=") and _is_bounded_range(source, index):
        yield instead("off-by-one", "..=" if text == ".." else "..")
    if text == "[" and source.is_operand_end(index - 1) and source.partner[index] == index + 2:
        if tokens[index - 1].end == token.start and following.kind == "ident":
            yield Edit("off-by-one", following.end, following.end, " + 1")


def _is_bounded_range(source: Source, index: int) -> bool:
    """Returns true if a range has an end, unlike the rest of a pattern or of a struct."""
    begins = source.is_operand_end(index - 1) or source.tokens[index - 1].text in ("[", "(")
    return begins and source.adjoins(index) and source.tokens[index + 1].text not in (")", "]", "}", ",")


def _of_name(source: Source, index: int, file: str) -> Iterator[Edit]:
    tokens = source.tokens
    token = tokens[index]
    before, following = tokens[index - 1].text, tokens[index + 1].text
    if token.text in EXTREMES and (before == "::" or (before == "." and following == "(")):
        yield Edit("bound", token.start, token.end, EXTREMES[token.text])
    if following != "(":
        return
    closer = source.partner[index + 1]
    arguments = source.text[tokens[index + 1].end : tokens[closer].start].strip().removesuffix(",")
    if before == ".":
        yield from _of_method(source, index, closer, arguments)
        return
    first = _path_start(source, index)
    start, end = tokens[first].start, tokens[closer].end
    path = source.text[start : token.start]
    if token.text == "wrap" and before != "fn":
        yield Edit("wrap", start, end, f"({arguments})")
    if token.text == "remainder" and path == "libm::":
        yield Edit("wrap", start, end, f"({_split(source, index + 1)[0]})")
    in_angle = path.endswith("angle::") or file == "core/src/angle.rs" and path == ""
    if token.text == "distance" and in_angle and before != "fn":
        one, other = _split(source, index + 1)
        yield Edit("wrap", start, end, f"f64::abs(({one}) - ({other}))")
    if token.text in NORM_FUNCTIONS and path in ("libm::", "f64::"):
        yield Edit("norm", start, end, f"({arguments})")


def _of_method(source: Source, index: int, closer: int, arguments: str) -> Iterator[Edit]:
    tokens = source.tokens
    token = tokens[index]
    # From the dot on.
    start, end = tokens[index - 1].start, tokens[closer].end
    if token.text == "rem_euclid" and TURN.search(arguments):
        yield Edit("wrap", start, end, "")
    if token.text in NORMS and not arguments:
        new = NORMS[token.text]
        yield Edit("norm", start, end, f".{new}()" if new else "")
    if token.text == "powi" and arguments == "2":
        yield Edit("norm", start, end, "")
    counted = token.text in PARTS and len(_split(source, index + 1)) == 1
    if counted and tokens[index + 2].kind != "integer":
        yield Edit("off-by-one", tokens[index + 1].end, tokens[closer].start, f"({arguments}) + 1")


def _path_start(source: Source, index: int) -> int:
    while source.tokens[index - 1].text == "::" and source.tokens[index - 2].kind == "ident":
        index -= 2
    return index


def _split(source: Source, opener: int) -> list[str]:
    """The arguments of a call, by the commas between them."""
    tokens = source.tokens
    arguments = []
    first = index = opener + 1
    while index <= source.partner[opener]:
        if index == source.partner[opener] or tokens[index].text == ",":
            if first < index:
                arguments.append(source.text[tokens[first].start : tokens[index - 1].end])
            first = index + 1
        elif tokens[index].text in ("(", "[", "{"):
            index = source.partner[index]
        index += 1
    return arguments


def _of_float(source: Source, index: int) -> Iterator[Edit]:
    tokens = source.tokens
    token = tokens[index]
    digits = token.text.replace("_", "").removesuffix("f64").removesuffix("f32")
    neighbours = [at for at in (index - 1, index + 1) if tokens[at].text in ("*", "/")]
    factor = any(source.spaced(at) and source.is_operand_end(at - 1) for at in neighbours)
    if factor and float(digits) != 0.0:
        yield Edit("weight", token.start, token.end, f"(2.0 * {token.text})")


def _of_integer(source: Source, index: int) -> Iterator[Edit]:
    tokens = source.tokens
    token = tokens[index]
    decimal = DECIMAL.fullmatch(token.text)
    # The length of an array is part of its type.
    if not decimal or (tokens[index - 1].text == ";" and tokens[index + 1].text == "]"):
        return
    value = int(decimal["digits"])
    for other in (value + 1, value - 1):
        if other >= 0:
            yield Edit("off-by-one", token.start, token.end, f"{other}{decimal['suffix']}")


def _scope(source: Source, function: Function, offset: int) -> tuple[int, int] | None:
    """The span that is written twice: the body, or a closure if the type of the result has no name."""
    if not function.opaque:
        return source.body(function)
    scopes = [span for span in _closures(source, function) if span[0] <= offset < span[1]]
    return max(scopes, default=None)


def _closures(source: Source, function: Function) -> Iterator[tuple[int, int]]:
    """The bodies of the closures of a function."""
    tokens = source.tokens
    for index in range(function.open + 1, function.close):
        text = tokens[index].text
        if text not in ("|", "||") or source.is_operand_end(index - 1):
            continue
        first = index + 1
        if text == "|":
            while tokens[first].text != "|":
                first = source.partner[first] + 1 if tokens[first].text in ("(", "[") else first + 1
            first += 1
        if tokens[first].text in ("{", "->"):
            while tokens[first].text != "{":
                first += 1
            yield tokens[first].end, tokens[source.partner[first]].start
            continue
        last = first
        while tokens[last].text not in (",", ";", ")", "]", "}"):
            inner = source.generics(last)
            if inner is None and tokens[last].text in ("(", "[", "{"):
                inner = source.partner[last]
            last = (inner or last) + 1
        yield tokens[first].start, tokens[last - 1].end
