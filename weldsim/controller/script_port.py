"""The script ports, 30001 to 30003: programs out of the text that a client sends, in whatever pieces it comes."""

import re
from codecs import getincrementaldecoder

from weldsim.controller.machine import Machine

MAX_TEXT = 4_000_000  # [character]
_WORD = re.compile(r"\"[^\"\n]*\"|'[^'\n]*'|[#$][^\n]*|[^\W\d]\w*|\n|.", re.DOTALL)
_OPENING = frozenset(("def", "thread", "sec", "if", "while"))


def split_programs(text: str) -> tuple[list[str], str]:
    """The programs that `text` completes, and what is left of it.

    A program is a `def` or `sec` to its `end`, or one line outside of them.
    """
    programs: list[str] = []
    depth, start = 0, 0
    for match in _WORD.finditer(text):
        word = match.group()
        if word in _OPENING:
            depth += 1
        elif word == "end" and depth:
            depth -= 1
        elif word == "\n" and depth == 0:
            programs.append(text[start : match.end()])
            start = match.end()
    kept = [program for program in programs if re.sub(r"[#$][^\n]*", "", program).strip()]
    return kept, text[start:]


class ScriptSession:
    """One client that sends scripts; what it is told in turn its subclasses say (`primary`, `realtime`)."""

    def __init__(self, machine: Machine) -> None:
        self._machine, self._text = machine, ""
        self._decoder = getincrementaldecoder("utf-8")(errors="replace")  # letters that are not UTF-8 are in comments at most

    def greeting(self) -> bytes:
        return b""

    def ended(self) -> None:
        self._text = ""

    def received(self, data: bytes) -> bytes:
        """Nothing, after the programs that are complete have been started."""
        self._text += self._decoder.decode(data).replace("\r\n", "\n")
        programs, self._text = split_programs(self._text)
        for program in programs:
            if program.strip() != "run program":
                self._machine.upload(program)
        if len(self._text) > MAX_TEXT:
            self._machine.say(f"script refused: longer than {MAX_TEXT} characters")
            self._text = ""
        return b""
