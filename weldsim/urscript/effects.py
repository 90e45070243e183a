"""What parts of a program do: which move the arm, and which variables they may change."""

from weldsim.urscript import tree
from weldsim.urscript.scopes import Scopes, walk

Part = tree.Node | tuple[tree.Statement, ...]


class Effects:
    """Effects of the statements and functions of one program, those of the functions that they call included.

    Attributes:
        moving: names of the built-in functions that move the arm or change what a pose means.
        of_threads: variables that threads of the program assign.
    """

    def __init__(self, scopes: Scopes, moving: frozenset[str]) -> None:
        self.moving, self._scopes = moving, scopes
        self._moves: dict[str, tree.Call | None] = {}
        self._assigned: dict[str, frozenset[str]] = {}
        threads = [name for name, function in scopes.functions.items() if function.kind == "thread"]
        self.of_threads = frozenset(variable for name in threads for variable in self.shared_by(name))

    def moves(self, part: Part) -> tree.Call | None:
        """The first call below `part` that moves the arm, or None."""
        for node in walk(part, into_functions=False):
            if isinstance(node, tree.Call):
                if node.function in self._scopes.functions:
                    found = self.function_moves(node.function)
                else:
                    found = node if node.function in self.moving else None
                if found is not None:
                    return found
        return None

    def function_moves(self, name: str) -> tree.Call | None:
        """The first call by which a function or thread of the program moves the arm, or None."""
        if name not in self._moves:
            self._moves[name] = None  # of one that calls itself: what else it does counts
            self._moves[name] = self.moves(self._scopes.functions[name].body)
        return self._moves[name]

    def moving_threads(self) -> tuple[tuple[str, int], ...]:
        """Names and lines of the threads that would move the arm."""
        functions = self._scopes.functions.items()
        return tuple(
            (name, function.line)
            for name, function in functions
            if function.kind == "thread" and self.function_moves(name) is not None
        )

    def movers(self) -> tuple[str, ...]:
        """The functions of the program that move the arm, those that can be called without arguments last."""
        functions = self._scopes.functions.items()
        found = [(name, bool(function.parameters)) for name, function in functions if self.function_moves(name) is not None]
        return tuple(name for name, _ in sorted(found, key=lambda one: not one[1]))

    def shared_by(self, name: str) -> frozenset[str]:
        """The shared variables that a function or thread assigns."""
        if name not in self._assigned:
            self._assigned[name] = frozenset()
            function = self._scopes.functions[name]
            self._assigned[name] = self.assigned(function.body) - self._scopes.locals_of(function)
        return self._assigned[name]

    def assigned(self, part: Part) -> frozenset[str]:
        """The variables that `part` may change: those it assigns, and the shared ones of the functions that it calls."""
        names: set[str] = set()
        for node in walk(part, into_functions=False):
            if isinstance(node, tree.Assign | tree.AssignItem):
                names.add(node.name)
            elif isinstance(node, tree.Call) and node.function in self._scopes.functions:
                names |= self.shared_by(node.function)
        return frozenset(names)

    def can_be_passed_over(self, statement: tree.Statement) -> bool:
        """Whether the arm's motion is the same without the statement, but for the variables that it assigns.

        A halt or a wait in it may end the motion sooner or later than without, never lead it elsewhere.
        """
        return not _leaves(statement, inside_loop=False) and self.moves(statement) is None

    def decides(self, statement: tree.Statement) -> bool:
        """Whether a statement may be unable to go on where a value is unknown: it decides by one, or calls a function that may."""
        for node in walk(statement, into_functions=False):
            if isinstance(node, tree.If | tree.While) or (isinstance(node, tree.Unary) and node.operator == "not"):
                return True
            if isinstance(node, tree.Binary) and node.operator in ("and", "or"):
                return True
            if isinstance(node, tree.Call) and node.function in self._scopes.functions:
                return True
        return False


def _leaves(statement: tree.Statement, inside_loop: bool) -> bool:
    """Whether control may leave the statement by return, or by a break or continue of a loop around it."""
    match statement:
        case tree.Return():
            return True
        case tree.Simple(word="break" | "continue"):
            return not inside_loop
        case tree.If(branches=branches):
            return any(_leaves(each, inside_loop) for _, body in branches for each in body)
        case tree.While(body=body):
            return any(_leaves(each, True) for each in body)
    return False
