"""Syntax trees from URScript text, by recursive descent."""

from weldsim.urscript import tree
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.lexer import Token, tokens

_BINARY = (("or",), ("xor",), ("and",), ("==", "!=", "<", ">", "<=", ">="), ("+", "-"), ("*", "/", "%"))
"""Operators from loosest to tightest; `not` binds between `and` and comparisons."""
_COMPARISON = 3
_SIMPLE = ("break", "continue", "halt", "pass", "enter_critical", "exit_critical")
_MAX_DEPTH = 60


def parse(text: str) -> tuple[tree.Statement, ...]:
    """The statements of a text, functions among them. Raises ScriptError, which names the line."""
    parser = _Parser(tokens(text))
    try:
        return parser.block(until=())
    except RecursionError:
        raise ScriptError("nested too deeply", parser.line) from None


_CLOSING = (",", ")", "]")  # symbols after which an expression is over


class _Parser:
    def __init__(self, found: list[Token]) -> None:
        self._tokens, self._at, self._depth = found, 0, 0

    @property
    def line(self) -> int:
        """Of the token that comes next."""
        return self._next.line

    @property
    def _next(self) -> Token:
        return self._tokens[self._at]

    def _take(self) -> Token:
        token = self._next
        self._at += 1
        return token

    def _sees(self, *texts: str) -> bool:
        return self._next.text in texts and self._next.kind in ("keyword", "symbol")

    def _accept(self, *texts: str) -> Token | None:
        return self._take() if self._sees(*texts) else None

    def _expect(self, text: str, where: str) -> Token:
        if not self._sees(text):
            raise ScriptError(f"expected {text!r} {where}, not {self._said()}", self._next.line)
        return self._take()

    def _said(self) -> str:
        return repr(self._next.text) if self._next.text else "the end of the text"

    def _name(self, where: str) -> Token:
        if self._next.kind != "name":
            raise ScriptError(f"expected a name {where}, not {self._said()}", self._next.line)
        return self._take()

    def block(self, until: tuple[str, ...], opened: str = "") -> tuple[tree.Statement, ...]:
        """Statements up to one of the keywords in `until`, or to the end of the text where it is empty.

        Args:
            opened: what began the block and where, for the error of one that has no end.
        """
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            raise ScriptError(f"nested deeper than {_MAX_DEPTH}", self._next.line)
        out: list[tree.Statement] = []
        while not self._sees(*until):
            if self._next.kind == "end of text":
                if until:
                    raise ScriptError(f"expected {' or '.join(until)} of {opened} before the end of the text", self._next.line)
                break
            if self._accept(";"):
                continue
            if not until and self._sees("end"):
                raise ScriptError("this end closes nothing: no def, thread, if or while is open", self._next.line)
            out.append(self._statement())
        self._depth -= 1
        return tuple(out)

    def _statement(self) -> tree.Statement:
        token = self._next
        if self._sees("def", "thread", "sec"):
            return self._function()
        if self._accept("if"):
            return self._if(token.line)
        if self._accept("while"):
            condition = self.expression()
            self._expect(":", "after the condition of while")
            body = self.block(("end",), f"while (line {token.line})")
            self._take()
            return tree.While(token.line, condition, body)
        if self._accept("return"):
            alone = self._next.first or self._next.kind == "end of text" or self._sees("end", "else", "elif")
            return tree.Return(token.line, None if alone else self.expression())
        if self._accept("kill", "join"):
            return tree.ThreadControl(token.line, token.text, self._postfix())
        if self._accept("global", "local"):
            name = self._name(f"after {token.text}").text
            value: tree.Expression = self.expression() if self._accept("=") else tree.Constant(token.line, 0)
            return tree.Assign(token.line, name, value, token.text)
        if self._accept(*_SIMPLE):
            return tree.Simple(token.line, token.text)
        return self._assignment_or_call()

    def _assignment_or_call(self) -> tree.Statement:
        line = self._next.line
        left = self.expression()
        if not self._accept("="):
            return tree.Evaluate(line, left)
        value = self.expression()
        if isinstance(left, tree.Name):
            return tree.Assign(line, left.name, value, "")
        if isinstance(left, tree.Index) and isinstance(left.target, tree.Name):
            return tree.AssignItem(line, left.target.name, left.indices, value)
        raise ScriptError("only a variable or an element of one can be assigned to", line)

    def _function(self) -> tree.Function:
        word = self._take()
        name = self._name(f"after {word.text}").text
        self._expect("(", f"after {word.text} {name}")
        parameters: list[tuple[str, tree.Expression | None]] = []
        while not self._accept(")"):
            parameter = self._name(f"among the parameters of {name}").text
            parameters.append((parameter, self.expression() if self._accept("=") else None))
            if not self._sees(")"):
                self._expect(",", f"between the parameters of {name}")
        self._expect(":", f"after {word.text} {name}(...)")
        body = self.block(("end",), f"{word.text} {name} (line {word.line})")
        self._take()
        return tree.Function(word.line, word.text, name, tuple(parameters), body)

    def _if(self, line: int) -> tree.If:
        branches: list[tuple[tree.Expression | None, tuple[tree.Statement, ...]]] = []
        condition: tree.Expression | None = self.expression()
        while True:
            self._expect(":", "after a condition")
            closing = ("end",) if condition is None else ("elif", "else", "end")
            branches.append((condition, self.block(closing, f"if (line {line})")))
            word = self._take().text
            if word == "end":
                return tree.If(line, tuple(branches))
            condition = self.expression() if word == "elif" else None

    def expression(self, level: int = 0) -> tree.Expression:
        """One expression of operators at `level` and tighter."""
        if level == 0 and (number := self._plain_number()) is not None:
            return number
        if level == len(_BINARY):
            return self._unary()
        if level == _COMPARISON and self._sees("not"):
            line = self._take().line
            return tree.Unary(line, "not", self.expression(level))
        left = self.expression(level + 1)
        while self._sees(*_BINARY[level]):
            operator = self._take()
            left = tree.Binary(operator.line, operator.text, left, self.expression(level + 1))
        return left

    def _plain_number(self) -> tree.Expression | None:
        """A number with nothing to be worked out, as most of a long program's are; None for anything else."""
        minus = self._next.text == "-" and self._next.kind == "symbol"
        # The last token is the end of the text: there is always one after a number.
        if minus and self._tokens[self._at + 1].kind != "number":
            return None
        token = self._tokens[self._at + minus]
        if token.kind != "number" or self._tokens[self._at + minus + 1].text not in _CLOSING:
            return None
        self._at += minus + 1
        value = tree.Constant(token.line, _number(token))
        return tree.Unary(token.line, "-", value) if minus else value

    def _unary(self) -> tree.Expression:
        if (operator := self._accept("-", "+", "not")) is not None:
            operand = self._unary()
            return operand if operator.text == "+" else tree.Unary(operator.line, operator.text, operand)
        return self._postfix()

    def _postfix(self) -> tree.Expression:
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            raise ScriptError(f"nested deeper than {_MAX_DEPTH}", self._next.line)
        value = self._atom()
        while (token := self._accept("[", ".")) is not None:
            value = tree.Index(token.line, value, self._items("]")) if token.text == "[" else self._method(value)
        self._depth -= 1
        return value

    def _method(self, target: tree.Expression) -> tree.Method:
        """What follows the dot of `target.name(x)`."""
        name = self._name("after .")
        if not self._sees("("):
            raise ScriptError(
                f"expected '(' after .{name.text}: structs are not known, only calls of rpc_factory's handles", name.line
            )
        call = self._call(name)
        return tree.Method(name.line, target, name.text, (*call.arguments, *(value for _, value in call.named)))

    def _atom(self) -> tree.Expression:
        token = self._take()
        line = token.line
        if token.kind == "number":
            return tree.Constant(line, _number(token))
        if token.kind == "string":
            return tree.Constant(line, token.text)
        if token.text in ("True", "False"):
            return tree.Constant(line, token.text == "True")
        if token.text == "run":
            call = self._postfix()
            if isinstance(call, tree.Name):  # `run program`, which old scripts end with
                call = tree.Call(line, call.name, (), ())
            if not isinstance(call, tree.Call):
                raise ScriptError("expected a call after run", line)
            return tree.Run(line, call)
        if token.kind == "name":
            return self._named(token)
        if token.text == "(":
            value = self.expression()
            self._expect(")", "to close the bracket")
            return value
        if token.text == "[":
            return tree.ListLiteral(line, self._items("]"))
        self._at -= 1
        raise ScriptError(f"expected a value, not {self._said()}", line)

    def _named(self, token: Token) -> tree.Expression:
        """A variable, a call, or a pose: p[...] with six values; with fewer it is an element of a variable named p."""
        if self._sees("("):
            return self._call(token)
        if token.text == "p" and self._sees("["):
            self._take()
            items = self._items("]")
            if len(items) == 6:
                return tree.PoseLiteral(token.line, items)
            if len(items) > 2:  # an element has one index, or two
                raise ScriptError(f"a pose p[...] has six values, not {len(items)}", token.line)
            return tree.Index(token.line, tree.Name(token.line, "p"), items)
        return tree.Name(token.line, token.text)

    def _items(self, close: str) -> tuple[tree.Expression, ...]:
        out: list[tree.Expression] = []
        while not self._accept(close):
            out.append(self.expression())
            if not self._sees(close):
                self._expect(",", "between values")
        return tuple(out)

    def _call(self, name: Token) -> tree.Call:
        self._take()
        arguments: list[tree.Expression] = []
        named: list[tuple[str, tree.Expression]] = []
        while not self._accept(")"):
            value = self.expression()
            if self._accept("="):
                if not isinstance(value, tree.Name):
                    raise ScriptError("only a name can stand before = in a call", name.line)
                named.append((value.name, self.expression()))
            elif named:
                raise ScriptError(f"{name.text}: an argument without a name follows one with a name", name.line)
            else:
                arguments.append(value)
            if not self._sees(")"):
                self._expect(",", f"between the arguments of {name.text}")
        return tree.Call(name.line, name.text, tuple(arguments), tuple(named))


def _number(token: Token) -> float | int:
    text = token.text.lower()
    if text.startswith("0x"):
        return int(text, 16)
    value = float(text) if "." in text or "e" in text else int(text)
    if value == float("inf"):
        raise ScriptError(f"{token.text} is too large a number", token.line)
    return value
