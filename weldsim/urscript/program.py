"""A running robot program: its threads, each advanced once a control period until it has to wait."""

from collections.abc import Callable, Generator, Iterator, Mapping
from types import TracebackType
from typing import Any

from weldsim.urscript.compiler import FILE, Compiled
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.values import OPERATIONS

MAX_TURNS = 20_000  # loop turns of one thread in one control period; more is a loop that never waits
MAX_THREADS = 50

Body = Generator[None, None, Any]


class _Thread:
    def __init__(self, handle: int, body: Body) -> None:
        self.handle, self.body, self.alive = handle, body, True


class Program:
    """One program while it runs.

    Attributes:
        name: of the program.  kind: "def" or "sec".
        running: whether it has not ended.
    """

    def __init__(self, compiled: Compiled, builtins: Mapping[str, Callable]) -> None:
        self.name, self.kind, self.running = compiled.name, compiled.kind, True
        self._lines = compiled.lines
        self._threads: list[_Thread] = []
        self._handles = 0
        self._current: _Thread | None = None
        self._critical: _Thread | None = None
        self._turns = 0
        names: dict[str, Any] = {f"b_{name}": function for name, function in builtins.items()}
        names |= OPERATIONS
        names |= {"_run": self._run, "_kill": self._kill, "_join": self._join, "_halt": self._halt}
        names |= {"_enter": self._enter, "_leave": self._leave, "_spin": self._spin}
        exec(compiled.code, names)  # built from the syntax tree alone, see the compiler
        self._run(names["main"])

    def step(self) -> None:
        """Every thread until it waits for the next control period.

        Raises:
            ScriptError: the program failed, with its line; it has ended.
        """
        for thread in self._threads:  # grows while threads start threads
            if thread.alive and self._critical in (None, thread):
                self._advance(thread)
            if not self._threads[0].alive:
                self.stop()
                return
        self._threads = [self._threads[0], *(thread for thread in self._threads[1:] if thread.alive)]

    def _advance(self, thread: _Thread) -> None:
        self._current, self._turns = thread, 0
        try:
            next(thread.body)
        except StopIteration:
            self._end(thread)
        except ScriptError as error:
            self.stop()
            raise ScriptError(error.reason, error.line or self._line_of(error.__traceback__)) from None
        except (TypeError, ValueError, ArithmeticError, NameError, LookupError, RecursionError) as error:
            self.stop()
            reason = "nested too deeply" if isinstance(error, RecursionError) else _plain(error)
            raise ScriptError(reason, self._line_of(error.__traceback__)) from None
        finally:
            self._current = None

    def _line_of(self, trace: TracebackType | None) -> int | None:
        """The URScript line of the innermost frame of the program."""
        found = None
        while trace is not None:
            if trace.tb_frame.f_code.co_filename == FILE and trace.tb_lineno < len(self._lines):
                found = self._lines[trace.tb_lineno]
            trace = trace.tb_next
        return found

    def stop(self) -> None:
        """End every thread; harmless when it has ended."""
        self.running = False
        for thread in self._threads:
            self._end(thread)

    def _end(self, thread: _Thread) -> None:
        thread.alive = False
        if self._critical is thread:
            self._critical = None
        if thread is not self._current:  # a generator cannot close itself
            thread.body.close()

    def _run(self, function: Callable[..., Body], *arguments: Any) -> int:
        if len(self._threads) >= MAX_THREADS:
            raise ScriptError(f"more than {MAX_THREADS} threads")
        self._handles += 1
        self._threads.append(_Thread(self._handles, function(*arguments)))
        return self._handles

    def _find(self, handle: Any) -> _Thread | None:
        return next((thread for thread in self._threads if thread.handle == handle and thread.alive), None)

    def _kill(self, handle: Any) -> None:
        thread = self._find(handle)
        if thread is not None:
            self._end(thread)

    def _join(self, handle: Any) -> Iterator[None]:
        while self._find(handle) is not None:
            yield

    def _halt(self) -> Iterator[None]:
        self.running = False
        for thread in self._threads:
            self._end(thread)
        yield

    def _enter(self) -> None:
        self._critical = self._current

    def _leave(self) -> None:
        if self._critical is self._current:
            self._critical = None

    def _spin(self) -> None:
        self._turns += 1
        if self._turns > MAX_TURNS:
            raise ScriptError("infinite loop: it neither moves nor waits; call sync() in it")


def _plain(error: Exception) -> str:
    """A Python error in words a script's author understands."""
    if isinstance(error, NameError):  # a shared variable that was never assigned
        return f"variable {str(error.name or '').removeprefix('g_').removeprefix('l_')!r} is used before it is assigned"
    return " ".join(str(error).split()) or type(error).__name__
