"""A small grammar of URScript, after its manual: it refuses what a controller would refuse.

Programs are lines: definitions, control flow, assignments, calls. Names have to be known: built in,
defined, assigned or given as parameters; calls have the right number of arguments.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

# Built-in functions that the scripts use -> least and largest number of arguments.
BUILT_IN = {
    "textmsg": (1, 2),
    "sync": (0, 0),
    "sleep": (1, 1),
    "sqrt": (1, 1),
    "servoj": (4, 6),
    "stopj": (1, 1),
    "force_mode": (5, 5),
    "end_force_mode": (0, 0),
    "zero_ftsensor": (0, 0),
    "get_tcp_force": (0, 0),
    "get_actual_tcp_pose": (0, 0),
    "pose_trans": (2, 2),
    "set_tcp": (1, 1),
    "read_input_integer_register": (1, 1),
    "write_output_integer_register": (2, 2),
}
TOKEN = re.compile(
    r'\s*(?:(?P<number>\d+\.\d+|\d+)|(?P<text>"[^"\n]*")|(?P<pose>p(?=\[))|(?P<name>[A-Za-z_]\w*)'
    r"|(?P<sign><=|>=|==|!=|[-+*/<>=()\[\],:]))"
)
WORDS = {"def", "end", "if", "elif", "else", "while", "return", "global", "local", "halt"}
VALUES = {"True", "False"}


class Refused(Exception):
    """The line and what is wrong with it."""


class Line:
    """The tokens of one line, read from the left."""

    def __init__(self, number: int, text: str) -> None:
        self.number, self.tokens, self.at = number, list(self._split(text)), 0

    def _split(self, text: str) -> Iterator[tuple[str, str]]:
        position = 0
        while text[position:].strip():
            match = TOKEN.match(text, position)
            if match is None:
                raise self.refused(f"no token at {text[position:]!r}")
            assert match.lastgroup is not None
            yield match.lastgroup, match[match.lastgroup]
            position = match.end()

    def refused(self, why: str) -> Refused:
        return Refused(f"line {self.number}: {why}")

    def next(self) -> str:
        return self.tokens[self.at][1] if self.at < len(self.tokens) else ""

    def kind(self) -> str:
        return self.tokens[self.at][0] if self.at < len(self.tokens) else ""

    def take(self, wanted: str = "") -> str:
        found = self.next()
        if not found or (wanted and found != wanted):
            raise self.refused(f"{wanted or 'more'} expected, not {found or 'the end'}")
        self.at += 1
        return found

    def end(self) -> None:
        if self.at < len(self.tokens):
            raise self.refused(f"{self.next()} is too much")


class Script:
    """A whole script, checked.

    Attributes:
        functions: Number of parameters of each that is defined.
        called: How often each function is called, in the text.
    """

    def __init__(self, text: str) -> None:
        self.functions: dict[str, int] = {}
        self.called: dict[str, int] = {}
        self.scopes: list[set[str]] = [set()]
        self.blocks: list[str] = []
        for number, raw in enumerate(text.splitlines(), start=1):
            bare = re.sub(r'#(?=(?:[^"]*"[^"]*")*[^"]*$).*', "", raw)
            if bare.strip():
                self._line(Line(number, bare))
        if self.blocks:
            raise Refused(f"{len(self.blocks)} blocks are not ended")

    def _line(self, line: Line) -> None:
        word = line.next()
        if word == "def":
            self._definition(line)
        elif word in ("if", "while"):
            line.take()
            self.blocks.append(word)
            self._condition(line)
        elif word in ("elif", "else"):
            if not self.blocks or self.blocks[-1] != "if":
                raise line.refused(f"{word} without if")
            line.take()
            self._condition(line) if word == "elif" else line.take(":")
        elif word == "end":
            line.take()
            if not self.blocks:
                raise line.refused("end without a block")
            if self.blocks.pop() == "def":
                self.scopes.pop()
        elif word == "return":
            line.take()
            self._expression(line)
        elif word == "halt":
            line.take()
        elif word in ("global", "local"):
            line.take()
            self._assignment(line, self.scopes[0] if word == "global" else self.scopes[-1])
        elif len(line.tokens) > 1 and line.tokens[1][1] == "=":
            if not any(word in scope for scope in self.scopes):
                raise line.refused(f"{word} is assigned, but declared nowhere")
            self._assignment(line, self.scopes[-1])
        else:
            self._expression(line)
        line.end()

    def _definition(self, line: Line) -> None:
        line.take("def")
        name, parameters = line.take(), set()
        line.take("(")
        while line.next() != ")":
            parameters.add(line.take())
            if line.next() == ",":
                line.take()
        line.take(")")
        line.take(":")
        if name in self.functions or name in BUILT_IN:
            raise line.refused(f"{name} is defined twice")
        self.functions[name] = len(parameters)
        self.blocks.append("def")
        self.scopes.append(parameters)

    def _condition(self, line: Line) -> None:
        self._expression(line)
        line.take(":")

    def _assignment(self, line: Line, scope: set[str]) -> None:
        if line.kind() != "name" or line.next() in WORDS | VALUES:
            raise line.refused(f"{line.next()} cannot be assigned")
        name = line.take()
        line.take("=")
        self._expression(line)
        scope.add(name)

    def _expression(self, line: Line) -> None:
        self._term(line)
        while line.next() in {"and", "or", "+", "-", "*", "/", "<", ">", "<=", ">=", "==", "!="}:
            line.take()
            self._term(line)

    def _term(self, line: Line) -> None:
        while line.next() in ("not", "-"):
            line.take()
        kind, word = line.kind(), line.take()
        if kind == "pose" or word == "[":
            if kind == "pose":
                line.take("[")
            self._items(line, pose=kind == "pose")
        elif word == "(":
            self._expression(line)
            line.take(")")
        elif kind == "name" and line.next() == "(":
            self._call(line, word)
        elif kind == "name" and word not in VALUES:
            if word in WORDS or not any(word in scope for scope in self.scopes):
                raise line.refused(f"{word} is not known")
            if line.next() == "[":
                line.take()
                self._expression(line)
                line.take("]")
        elif kind not in ("number", "text") and word not in VALUES:
            raise line.refused(f"{word} is no value")

    def _items(self, line: Line, *, pose: bool) -> None:
        count = 0
        while line.next() != "]":
            self._expression(line)
            count += 1
            if line.next() == ",":
                line.take()
        line.take("]")
        if pose and count != 6:
            raise line.refused(f"a pose has six numbers, not {count}")

    def _call(self, line: Line, name: str) -> None:
        line.take("(")
        count = 0
        while line.next() != ")":
            self._expression(line)
            count += 1
            if line.next() == ",":
                line.take()
        line.take(")")
        if name in self.functions:
            least = most = self.functions[name]
        elif name in BUILT_IN:
            least, most = BUILT_IN[name]
        else:
            raise line.refused(f"there is no function {name}")
        if not least <= count <= most:
            raise line.refused(f"{name} takes {least} to {most} arguments, not {count}")
        self.called[name] = self.called.get(name, 0) + 1
