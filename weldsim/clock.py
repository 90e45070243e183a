"""How long each stage took, and the telling of progress. No stage reads a clock: who calls the stages holds one of these."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

Tell = Callable[[str, float | None], None]
"""Told the stage that begins, and while it runs the fraction done, 0 to 1, where that is known."""


@dataclass(eq=False)
class Clock:
    """Seconds a stage, in order. Attributes: seconds; tell, called when a stage begins."""

    tell: Tell = lambda stage, done: None
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Adds the time its block takes to `seconds[name]`."""
        self.tell(name, None)
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
