"""Which variables a program shares among its threads, which belong to one function, and which functions can take time."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cache

from weldsim.urscript import tree


def walk(node: object, into_functions: bool = True) -> Iterator[tree.Node]:
    """`node` and everything below it; the bodies of nested functions only where asked for."""
    if isinstance(node, tuple):
        for part in node:
            yield from walk(part, into_functions)
    elif isinstance(node, tree.Node):
        yield node
        if isinstance(node, tree.Function) and not into_functions:
            return
        for name in _parts(type(node)):
            yield from walk(getattr(node, name), into_functions)


@cache
def _parts(kind: type[tree.Node]) -> tuple[str, ...]:
    """Names of a node's fields."""
    return tuple(field.name for field in fields(kind))


@dataclass(frozen=True)
class Scopes:
    """What the names of one program mean.

    Attributes:
        shared: variables declared global anywhere, or assigned in the program's own body.
        functions: {name: definition}, nested ones among them.
        slow: names of functions that can take time: they move, wait, or call one that does. Threads always can.
    """

    shared: frozenset[str]
    functions: Mapping[str, tree.Function]
    slow: frozenset[str]

    def locals_of(self, function: tree.Function) -> frozenset[str]:
        """The variables that belong to a function: parameters, those declared local, those it assigns and nobody shares."""
        own = {name for name, _ in function.parameters}
        for node in walk(function.body, into_functions=False):
            if isinstance(node, tree.Assign) and (node.scope == "local" or (node.scope == "" and node.name not in self.shared)):
                own.add(node.name)
        return frozenset(own)


def find_scopes(body: tuple[tree.Statement, ...], slow_builtins: frozenset[str]) -> Scopes:
    """Scopes of a program with this body."""
    nodes = tuple(walk(body))
    functions = {node.name: node for node in nodes if isinstance(node, tree.Function)}
    shared = {node.name for node in nodes if isinstance(node, tree.Assign) and node.scope == "global"}
    shared |= {node.name for node in walk(body, into_functions=False) if isinstance(node, tree.Assign)}
    slow = {name for name, function in functions.items() if function.kind == "thread"}
    slow |= {node.call.function for node in nodes if isinstance(node, tree.Run)} & set(functions)
    grew = True
    while grew:
        grew = False
        for name, function in functions.items():
            if name not in slow and _takes_time(function, slow | slow_builtins):
                slow.add(name)
                grew = True
    return Scopes(frozenset(shared), functions, frozenset(slow))


def _takes_time(function: tree.Function, slow: set[str] | frozenset[str]) -> bool:
    for node in walk(function.body, into_functions=False):
        if isinstance(node, tree.Call) and node.function in slow:
            return True
        if isinstance(node, tree.ThreadControl) or (isinstance(node, tree.Simple) and node.word in ("halt", "enter_critical")):
            return True
    return False
