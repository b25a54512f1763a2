"""Tokens and functions of Rust sources, as far as planting mistakes needs them.

The reader knows strings, characters, lifetimes, comments and brackets; it has no grammar of
expressions. It relies on rustfmt instead: binary operators stand between spaces, unary ones and
generics do not.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field

TOKEN = re.compile(
    r"""
    (?P<space>\s+ | //[^\n]*)
  | (?P<comment>/\*)
  | (?P<string>[bc]?"(?:[^"\\]|\\.)*" | [bc]?r(?P<hashes>\#*)".*?"(?P=hashes))
  | (?P<char>b?'(?:[^'\\\n]|\\(?:u\{[^}]*\}|x[0-9a-fA-F]{2}|.))')
  | (?P<lifetime>'[A-Za-z_]\w*)
  | (?P<float>\d[\d_]*\.(?![.A-Za-z_])[\d_]*(?:[eE][+-]?\d[\d_]*)?(?:_?f(?:32|64))?
            | \d[\d_]*[eE][+-]?\d[\d_]*(?:_?f(?:32|64))? | \d[\d_]*f(?:32|64))
  | (?P<integer>0[xob][0-9a-fA-F_]+\w* | \d[\d_]*(?:[iu](?:8|16|32|64|128|size))?)
  | (?P<ident>(?:r\#)?[^\W\d]\w*)
  | (?P<punct>\.\.= | \.\.\. | \.\. | <<= | >>= | -> | => | :: | && | \|\| | == | != | <= | >=
            | \+= | -= | \*= | /= | %= | \^= | &= | \|= | << | >> | [^\w\s])
    """,
    re.VERBOSE | re.DOTALL,
)
INDEX = re.compile(r"\d+")
OPENERS = {"(": ")", "[": "]", "{": "}"}
KEYWORDS = frozenset(
    "as break const continue else enum extern fn for if impl in let loop match mod move mut pub ref "
    "return static struct trait type unsafe use where while async await dyn".split()
)
# Code that only tests see. The laws of `core` are oracles for tests, too.
TEST_CFG = re.compile(r'\bcfg\s*\((?!\s*not\b).*(\btest\b|"laws")')
# Tests are built with all features of a package: what stands for a missing one is left out.
ABSENT_CFG = re.compile(r"\bcfg\s*\(.*\bnot\s*\(")
# Texts for people; no test should hold their every detail.
FORMATTING = re.compile(r"\b(Display|Debug)\s+for\b")


@dataclass(frozen=True, slots=True)
class Token:
    """A token that is neither space nor comment, with its place in the text."""

    kind: str
    text: str
    start: int
    end: int


@dataclass
class Function:
    """A function with a body; its tokens `open` and `close` are the braces of the body."""

    name: str
    open: int
    close: int
    # Its result is `impl Trait`: two bodies would have two types.
    opaque: bool


@dataclass
class Source:
    """A file of Rust, its tokens and the outermost functions that mistakes may be planted in."""

    text: str
    tokens: list[Token] = field(default_factory=list)
    # Of each bracket the index of its partner.
    partner: dict[int, int] = field(default_factory=dict)
    functions: list[Function] = field(default_factory=list)
    # Modules in files of their own that only tests see.
    test_modules: list[str] = field(default_factory=list)
    _line_starts: list[int] = field(default_factory=list)

    @classmethod
    def read(cls, text: str) -> Source:
        """Reads a file; raises ValueError where its brackets do not match."""
        source = cls(text)
        source.tokens = list(_tokens(text))
        source._line_starts = [0, *(match.end() for match in re.finditer("\n", text))]
        source._pair()
        source._items(0, len(source.tokens), [])
        return source

    def line_of(self, offset: int) -> int:
        """The number of the line, from 1, that holds a place."""
        return bisect_right(self._line_starts, offset)

    def line_start(self, line: int) -> int:
        """The place at which a line begins."""
        return self._line_starts[line - 1]

    def lines_around(self, start: int, end: int) -> tuple[int, int]:
        """The span of the whole lines that hold a span, without the last line's end."""
        last = self.text.find("\n", max(start, end - 1))
        return self.line_start(self.line_of(start)), len(self.text) if last < 0 else last

    def body(self, function: Function) -> tuple[int, int]:
        """The span between the braces of a function."""
        return self.tokens[function.open].end, self.tokens[function.close].start

    def code_lines(self) -> int:
        """The number of lines with code in the functions."""
        return sum(
            len({self.line_of(token.start) for token in self.tokens[f.open + 1 : f.close]})
            for f in self.functions
        )

    def is_operand_end(self, index: int) -> bool:
        """Returns true if an operand may end with a token, so that an operator after it is binary."""
        if index < 0:
            return False
        token = self.tokens[index]
        if token.kind == "ident":
            return token.text not in KEYWORDS or token.text == "await"
        return token.kind in ("float", "integer", "index", "string", "char") or token.text in ")]}?"

    def spaced(self, index: int) -> bool:
        """Returns true if a token has space on both sides, as binary operators have."""
        before, token, after = self.tokens[index - 1 : index + 2]
        return before.end < token.start and token.end < after.start

    def adjoins(self, index: int) -> bool:
        """Returns true if no space lies between a token and the next one."""
        return self.tokens[index].end == self.tokens[index + 1].start

    def generics(self, index: int) -> int | None:
        """The index of the `>` that closes a list of generics opened at a token, if it does open one."""
        tokens = self.tokens
        if tokens[index].text != "<" or not self.adjoins(index):
            return None
        if index == 0 or tokens[index - 1].end != tokens[index].start:
            return None
        depth = 0
        while index < len(tokens):
            text = tokens[index].text
            if text in OPENERS:
                index = self.partner[index]
            elif text == "<":
                depth += 1
            elif text in (">", ">>"):
                depth -= len(text)
                if depth <= 0:
                    return index
            elif text in (";", ")", "]", "}"):
                return None
            index += 1
        return None

    def macro(self, index: int) -> int | None:
        """The index of the bracket that opens the arguments of a macro named at a token."""
        tokens = self.tokens
        if tokens[index].kind != "ident" or index + 2 >= len(tokens) or not self.adjoins(index):
            return None
        if tokens[index + 1].text != "!" or tokens[index + 2].text not in OPENERS:
            return None
        return index + 2

    def _pair(self) -> None:
        stack: list[int] = []
        for index, token in enumerate(self.tokens):
            if token.kind != "punct":
                continue
            if token.text in OPENERS:
                stack.append(index)
            elif token.text in OPENERS.values():
                opener = stack.pop() if stack else None
                if opener is None or OPENERS[self.tokens[opener].text] != token.text:
                    raise ValueError(f"line {self.line_of(token.start)}: `{token.text}` closes nothing")
                self.partner[opener] = index
                self.partner[index] = opener
        if stack:
            line = self.line_of(self.tokens[stack[-1]].start)
            raise ValueError(f"line {line}: a bracket is not closed")

    def _items(self, index: int, end: int, path: list[str]) -> None:
        """Collects the functions of the items between two tokens."""
        attributes = ""
        while index < end:
            token = self.tokens[index]
            if token.text == "#":
                opener = index + 1 + (self.tokens[index + 1].text == "!")
                closer = self.partner[opener]
                if opener == index + 1:
                    attributes += self.text[token.start : self.tokens[closer].end]
                index = closer + 1
                continue
            if token.text == "pub":
                index += 1
                if index < end and self.tokens[index].text == "(":
                    index = self.partner[index] + 1
                continue
            left_out = bool(TEST_CFG.search(attributes) or ABSENT_CFG.search(attributes))
            index = self._item(index, end, path, attributes, left_out)
            attributes = ""

    def _item(self, index: int, end: int, path: list[str], attributes: str, left_out: bool) -> int:
        """Reads an item; returns the index of the token behind it."""
        constant = False
        while self.tokens[index].text in ("const", "unsafe", "async", "extern", "default", "auto"):
            following = self.tokens[index + 1]
            if self.tokens[index].text == "const":
                if following.text not in ("fn", "unsafe", "async", "extern"):
                    return self._behind(index, end, braces_end=False)
                constant = True
            if self.tokens[index].text == "extern" and following.kind == "string":
                index += 1
            index += 1
        keyword = self.tokens[index].text
        if keyword == "fn":
            return self._function(index, end, path, left_out or constant)
        if keyword in ("mod", "impl", "trait"):
            brace = self._brace(index, end)
            if brace is None:
                if keyword == "mod" and TEST_CFG.search(attributes):
                    self.test_modules.append(self.tokens[index + 1].text)
                return self._behind(index, end, braces_end=True)
            header = self._header(index, brace)
            if not left_out and not (keyword == "impl" and FORMATTING.search(header)):
                self._items(brace + 1, self.partner[brace], [*path, header])
            return self.partner[brace] + 1
        braces_end = keyword not in ("static", "use", "type", "let")
        return self._behind(index, end, braces_end)

    def _function(self, index: int, end: int, path: list[str], left_out: bool) -> int:
        name = self.tokens[index + 1].text
        brace = self._brace(index, end)
        if brace is None:
            return self._behind(index, end, braces_end=True)
        close = self.partner[brace]
        signature = self.tokens[index:brace]
        arrows = [at for at, token in enumerate(signature) if token.text == "->"]
        opaque = bool(arrows) and any(token.text == "impl" for token in signature[arrows[-1] :])
        if not left_out:
            self.functions.append(Function("::".join([*path, name]), brace, close, opaque))
        return close + 1

    def _brace(self, index: int, end: int) -> int | None:
        """The brace that opens the body of an item; None if the item ends with a semicolon."""
        while index < end:
            text = self.tokens[index].text
            if text == "{":
                return index
            if text == ";":
                return None
            index = self.partner[index] + 1 if text in OPENERS else index + 1
        return None

    def _behind(self, index: int, end: int, braces_end: bool) -> int:
        """The index behind an item that ends with a semicolon, or with braces."""
        while index < end:
            text = self.tokens[index].text
            if text == ";":
                return index + 1
            if text in OPENERS:
                index = self.partner[index]
                if text == "{" and braces_end:
                    return index + 1
            index += 1
        return end

    def _header(self, index: int, brace: int) -> str:
        """The name of a module, a trait or an impl, without keyword, generics and bounds."""
        first = index + 1
        if self.tokens[index].text == "impl":
            first = (self.generics(first) or index) + 1
        else:
            return self.tokens[first].text
        last = brace
        for at in range(first, brace):
            if self.tokens[at].text == "where":
                last = at
                break
        return " ".join(self.text[self.tokens[first].start : self.tokens[last - 1].end].split())


def _tokens(text: str):
    offset = 0
    previous = ""
    while offset < len(text):
        # `self.0.1` has two indices, not a float.
        match = INDEX.match(text, offset) if previous == "." else None
        kind = "index"
        if match is None:
            match = TOKEN.match(text, offset)
            if match is None:
                raise ValueError(f"no token at {text[offset : offset + 20]!r}")
            kind = match.lastgroup
        if kind == "comment":
            offset = _comment_end(text, offset)
            continue
        if kind != "space":
            yield Token(kind, match.group(), match.start(), match.end())
            previous = match.group()
        offset = match.end()


def _comment_end(text: str, offset: int) -> int:
    depth = 0
    for match in re.compile(r"/\*|\*/").finditer(text, offset):
        depth += 1 if match.group() == "/*" else -1
        if depth == 0:
            return match.end()
    raise ValueError("a comment is not closed")
