"""The syntax tree of a URScript program."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Node:
    line: int


@dataclass(frozen=True)
class Constant(Node):
    value: float | int | bool | str


@dataclass(frozen=True)
class Name(Node):
    name: str


@dataclass(frozen=True)
class ListLiteral(Node):
    items: "tuple[Expression, ...]"


@dataclass(frozen=True)
class PoseLiteral(Node):
    items: "tuple[Expression, ...]"


@dataclass(frozen=True)
class Index(Node):
    target: "Expression"
    indices: "tuple[Expression, ...]"


@dataclass(frozen=True)
class Unary(Node):
    operator: str
    operand: "Expression"


@dataclass(frozen=True)
class Binary(Node):
    operator: str
    left: "Expression"
    right: "Expression"


@dataclass(frozen=True)
class Call(Node):
    function: str
    arguments: "tuple[Expression, ...]"
    named: "tuple[tuple[str, Expression], ...]"


@dataclass(frozen=True)
class Method(Node):
    """`target.name(x)`: a function of a remote procedure server."""

    target: "Expression"
    name: str
    arguments: "tuple[Expression, ...]"


@dataclass(frozen=True)
class Run(Node):
    """`run f(x)`: the handle of a new thread."""

    call: Call


Expression = Constant | Name | ListLiteral | PoseLiteral | Index | Unary | Binary | Call | Method | Run


@dataclass(frozen=True)
class Evaluate(Node):
    """An expression that stands alone."""

    value: Expression


@dataclass(frozen=True)
class Assign(Node):
    """`x = value`; scope "global" or "local" where the statement says so, else ""."""

    name: str
    value: Expression
    scope: str


@dataclass(frozen=True)
class AssignItem(Node):
    name: str
    indices: tuple[Expression, ...]
    value: Expression


@dataclass(frozen=True)
class If(Node):
    """Branches in order; the last one's condition is None for `else`."""

    branches: "tuple[tuple[Expression | None, tuple[Statement, ...]], ...]"


@dataclass(frozen=True)
class While(Node):
    condition: Expression
    body: "tuple[Statement, ...]"


@dataclass(frozen=True)
class Return(Node):
    value: Expression | None


@dataclass(frozen=True)
class Simple(Node):
    """One word: break, continue, halt, pass, enter_critical, exit_critical."""

    word: str


@dataclass(frozen=True)
class ThreadControl(Node):
    """`kill handle` or `join handle`."""

    word: str
    handle: Expression


@dataclass(frozen=True)
class Function(Node):
    """A function or, with kind "thread", what a thread runs; kind "sec" is a program that may not move the arm."""

    kind: str
    name: str
    parameters: tuple[tuple[str, Expression | None], ...]
    body: "tuple[Statement, ...]"


Statement = Evaluate | Assign | AssignItem | If | While | Return | Simple | ThreadControl | Function
