"""Tokens of URScript. Newlines mean nothing, except that a value to be returned stands on the line of its `return`.

What follows a # is a comment; what follows a $ is the label by which PolyScope knows the line.
"""

import re
from dataclasses import dataclass
from typing import Literal

from weldsim.urscript.errors import ScriptError

Kind = Literal["name", "keyword", "number", "string", "symbol", "end of text"]

KEYWORDS = frozenset(
    [
        "def",
        "thread",
        "sec",
        "end",
        "if",
        "elif",
        "else",
        "while",
        "return",
        "break",
        "continue",
        "global",
        "local",
        "run",
        "kill",
        "join",
        "halt",
        "pass",
        "enter_critical",
        "exit_critical",
        "and",
        "or",
        "not",
        "xor",
        "True",
        "False",
    ]
)

_TOKEN = re.compile(
    r"""(?P<space>[ \t\r\f\ufeff\u00a0]+|\#[^\n]*|\$[^\n]*)
    |(?P<newline>\n)
    |(?P<number>0[xX][0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
    |(?P<name>[^\W\d]\w*)
    |(?P<string>"[^"\n]*"|'[^'\n]*')
    |(?P<symbol>==|!=|<=|>=|[-+*/%<>=()\[\],:^.;])
    """,
    re.VERBOSE,
)


@dataclass(frozen=True)
class Token:
    """One token.

    Attributes:
        kind: what it is.  text: as written, a string without its quotes.
        line: where, from 1.  first: whether it is the first on its line.
    """

    kind: Kind
    text: str
    line: int
    first: bool


def tokens(text: str) -> list[Token]:
    """All tokens of `text`, closed by one of kind "end of text". Raises ScriptError for a character with no meaning."""
    out: list[Token] = []
    position, line, first = 0, 1, True
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            raise ScriptError(f"character {text[position]!r} has no meaning here", line)
        position, kind, word = match.end(), match.lastgroup, match.group()
        if kind == "newline":
            line, first = line + 1, True
            continue
        if kind == "space":
            continue
        if kind == "name" and not word.isidentifier():
            raise ScriptError(f"{word!r} is no name: it may hold letters, digits and _", line)
        if kind == "name" and word in KEYWORDS:
            out.append(Token("keyword", word, line, first))
        elif kind == "string":
            out.append(Token("string", word[1:-1], line, first))
        elif kind in ("name", "number", "symbol"):
            out.append(Token(kind, word, line, first))
        first = False
    out.append(Token("end of text", "", line, True))
    return out
