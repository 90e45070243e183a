"""URScript compiled to Python: every function that can take time becomes a generator that yields once a control period.

The Python text is built from the tree alone: names are prefixed, constants written by `repr`, so nothing of the script's own
text is executed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import isgeneratorfunction, signature, unwrap
from types import CodeType

from weldsim.urscript import tree
from weldsim.urscript.effects import Effects
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.parser import parse
from weldsim.urscript.scopes import Scopes, find_scopes, walk

_OPERATORS = {"xor": "!=", "==": "==", "!=": "!=", "<": "<", ">": ">", "<=": "<=", ">=": ">=", "and": "and", "or": "or"}
_CHECKED = {"+": "_add", "-": "_subtract", "*": "_multiply", "/": "_divide", "%": "_modulo"}
FILE = "<urscript>"


@dataclass(frozen=True)
class Compiled:
    """A program ready to run.

    Attributes:
        name: of the program.  kind: "def", or "sec" for one that runs beside the main program.
        code: defines `main`, a generator function, once executed with the runtime's names.
        lines: URScript line of each Python line, from 1; entry 0 is not used.
        effects: of its parts, where it was compiled to be read.
    """

    name: str
    kind: str
    code: CodeType
    lines: tuple[int, ...]
    effects: Effects | None = None


def compile_program(text: str, builtins: Mapping[str, Callable], *, moving: frozenset[str] | None = None) -> Compiled:
    """A program from its text: one `def` or `sec`, or bare statements.

    Args:
        text: the script.  builtins: functions it can call; those that are generator functions take time.
        moving: for a program that is read and not run: the names of built-in functions that move the arm. A statement that
            moves nothing may then raise the runtime's `_Untold`: `_pass_over` is told of it, and what it assigns becomes
            what that returns. A variable that threads assign is read through `_of_thread`.
    Raises:
        ScriptError: with the line.
    """
    statements = parse(text)
    if not statements:
        raise ScriptError("the program is empty")
    wanted = [s for s in statements if not _is_run_program(s)]
    if len(wanted) == 1 and isinstance(wanted[0], tree.Function) and not wanted[0].parameters:
        program = wanted[0]
        name, kind, body = program.name, program.kind, program.body
    else:
        name, kind, body = "unnamed", "def", tuple(wanted)
    try:
        return _Compiler(body, builtins, moving).compile(name, kind)
    except RecursionError:
        raise ScriptError("nested too deeply") from None


def _is_run_program(statement: tree.Statement) -> bool:
    run = statement.value if isinstance(statement, tree.Evaluate) else None
    return isinstance(run, tree.Run) and run.call.function == "program"


class _Compiler:
    def __init__(self, body: tuple[tree.Statement, ...], builtins: Mapping[str, Callable], moving: frozenset[str] | None) -> None:
        self._builtins, self._body = builtins, body
        slow = frozenset(name for name, function in builtins.items() if isgeneratorfunction(unwrap(function)))
        self._slow_builtins = slow
        self._scopes: Scopes = find_scopes(body, slow)
        self._effects = None if moving is None else Effects(self._scopes, moving)
        self._locals: frozenset[str] = frozenset()
        self._out: list[str] = []
        self._lines: list[int] = [0]
        self._line = 1

    def compile(self, name: str, kind: str) -> Compiled:
        for function in self._scopes.functions.values():
            self._function(function)
        self._locals = frozenset()
        self._emit(0, "def main():")
        self._shared_names(1)
        self._emit(1, "if 0: yield")
        self._block(self._body, 1)
        try:
            code = compile("\n".join(self._out) + "\n", FILE, "exec")
        except SyntaxError as error:  # break outside a loop, say: what the parser does not look at
            raise ScriptError(error.msg, self._lines[error.lineno] if error.lineno else None) from None
        except MemoryError:  # what Python's own parser says of deep nesting
            raise ScriptError("nested too deeply") from None
        return Compiled(name, kind, code, tuple(self._lines), self._effects)

    def _emit(self, depth: int, text: str) -> None:
        self._out.append("    " * depth + text)
        self._lines.append(self._line)

    def _shared_names(self, depth: int) -> None:
        if shared := sorted(self._scopes.shared - self._locals):
            self._emit(depth, "global " + ", ".join(f"g_{name}" for name in shared))

    def _function(self, function: tree.Function) -> None:
        self._line = function.line
        self._locals = frozenset()
        defaults = {name: self._value(default) for name, default in function.parameters if default is not None}
        self._locals = self._scopes.locals_of(function)
        parameters = ", ".join(f"l_{name}" + (f"={defaults[name]}" if name in defaults else "") for name, _ in function.parameters)
        self._emit(0, f"def f_{function.name}({parameters}):")
        self._shared_names(1)
        if function.name in self._scopes.slow:
            self._emit(1, "if 0: yield")
        changed = {node.name for node in walk(function.body, into_functions=False) if isinstance(node, tree.AssignItem)}
        for name, _ in function.parameters:
            if name in changed:  # lists are values: what a function changes is its own copy
                self._emit(1, f"l_{name} = _own(l_{name})")
        self._block(function.body, 1)

    def _block(self, statements: tuple[tree.Statement, ...], depth: int) -> None:
        before = len(self._out)
        for statement in statements:
            if not isinstance(statement, tree.Function):
                self._line = statement.line
                self._guarded(statement, depth)
        if len(self._out) == before:
            self._emit(depth, "pass")

    def _guarded(self, statement: tree.Statement, depth: int) -> None:
        """A statement; one that moves nothing is passed over where what it does cannot be told."""
        effects = self._effects
        if effects is None or not effects.decides(statement) or not effects.can_be_passed_over(statement):
            self._statement(statement, depth)
            return
        self._emit(depth, "try:")
        self._statement(statement, depth + 1)
        self._line = statement.line
        self._emit(depth, "except _Untold as untold:")
        known = self._locals | self._scopes.shared
        targets = "".join(f"{self._variable(name)} = " for name in sorted(effects.assigned(statement) & known))
        self._emit(depth + 1, f"{targets}_pass_over(untold, {type(statement).__name__!r})")

    def _statement(self, statement: tree.Statement, depth: int) -> None:
        match statement:
            case tree.Evaluate(value=value):
                self._emit(depth, self._value(value))
            case tree.Assign(name=name, value=value):
                self._emit(depth, f"{self._variable(name)} = {self._copied(value)}")
            case tree.AssignItem(name=name, indices=indices, value=value):
                self._emit(depth, f"_store({self._read(name)}, ({self._list(indices)},), {self._copied(value)})")
            case tree.If(branches=branches):
                self._if(branches, depth)
            case tree.While(condition=condition, body=body):
                self._emit(depth, f"while {self._value(condition)}:")
                self._emit(depth + 1, "_spin()")
                self._block(body, depth + 1)
            case tree.Return(value=value):
                self._emit(depth, "return" if value is None else f"return {self._copied(value)}")
            case tree.ThreadControl(word="kill", handle=handle):
                self._emit(depth, f"_kill({self._value(handle)})")
            case tree.ThreadControl(handle=handle):
                self._emit(depth, f"yield from _join({self._value(handle)})")
            case tree.Simple(word=word):
                calls = {"halt": "yield from _halt()", "enter_critical": "_enter()", "exit_critical": "_leave()"}
                self._emit(depth, calls.get(word, word))

    def _if(self, branches: tuple[tuple[tree.Expression | None, tuple[tree.Statement, ...]], ...], depth: int) -> None:
        for k, (condition, body) in enumerate(branches):
            if condition is None:
                self._emit(depth, "else:")
            else:
                self._line = condition.line
                self._emit(depth, f"{'elif' if k else 'if'} {self._value(condition)}:")
            self._block(body, depth + 1)

    def _variable(self, name: str) -> str:
        return f"l_{name}" if name in self._locals else f"g_{name}"

    def _read(self, name: str) -> str:
        if name in self._locals or name in self._scopes.shared:
            variable = self._variable(name)
            if self._effects is not None and name not in self._locals and name in self._effects.of_threads:
                return f"_of_thread({name!r}, {variable})"
            return variable
        raise ScriptError(f"variable {name!r} is not defined", self._line)

    def _copied(self, value: tree.Expression) -> str:
        """A value that shares no list with another variable."""
        text = self._value(value)
        return f"_own({text})" if isinstance(value, tree.Name | tree.Index) else text

    def _list(self, items: tuple[tree.Expression, ...]) -> str:
        return ", ".join(self._copied(item) for item in items)

    def _value(self, value: tree.Expression) -> str:
        match value:
            case tree.Constant(value=constant):
                return f"({constant!r})"
            case tree.Name(name=name):
                return self._read(name)
            case tree.ListLiteral(items=items):
                return f"[{self._list(items)}]"
            case tree.PoseLiteral(items=items):
                return f"_pose([{self._list(items)}])"
            case tree.Index(target=target, indices=indices):
                return f"_item({self._value(target)}, ({self._list(indices)},))"
            case tree.Unary(operator=operator, operand=operand):
                return f"(not {self._value(operand)})" if operator == "not" else f"_negate({self._value(operand)})"
            case tree.Binary(operator=operator, left=left, right=right) if operator in _CHECKED:
                return f"{_CHECKED[operator]}({self._value(left)}, {self._value(right)})"
            case tree.Binary(operator=operator, left=left, right=right):
                return f"({self._value(left)} {_OPERATORS[operator]} {self._value(right)})"
            case tree.Run(call=call):
                if call.function not in self._scopes.functions:
                    raise ScriptError(f"{call.function!r} is not a thread or function of this program", call.line)
                return f"_run(f_{call.function}{''.join(f', {self._copied(a)}' for a in call.arguments)})"
            case tree.Method(target=target, name=name, arguments=arguments):
                return f"_method({self._value(target)}, {name!r}, [{self._list(arguments)}])"
            case tree.Call():
                return self._call(value)

    def _call(self, call: tree.Call) -> str:
        name = call.function
        arguments = [self._copied(argument) for argument in call.arguments]
        if name in self._scopes.functions:
            function, slow = f"f_{name}", name in self._scopes.slow
            arguments += [f"l_{key}={self._copied(argument)}" for key, argument in call.named]
            names = [parameter for parameter, _ in self._scopes.functions[name].parameters]
            if len(call.arguments) > len(names) or any(key not in names for key, _ in call.named):
                raise ScriptError(f"{name}() takes ({', '.join(names)})", call.line)
        elif name in self._builtins:
            function, slow = f"b_{name}", name in self._slow_builtins
            arguments += [f"{key}={self._copied(argument)}" for key, argument in call.named]
            try:
                signature(self._builtins[name]).bind(*call.arguments, **dict(call.named))
            except TypeError as error:
                raise ScriptError(f"{name}(): {error}", call.line) from None
        else:
            raise ScriptError(f"there is no function {name!r}", call.line)
        text = f"{function}({', '.join(arguments)})"
        return f"(yield from {text})" if slow else text
