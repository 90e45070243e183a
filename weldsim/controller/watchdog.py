"""Watchdogs of a program over the inputs that RTDE clients write (`rtde_set_watchdog`)."""

from collections.abc import Iterable


class Watchdogs:
    """At most one an input variable."""

    def __init__(self) -> None:
        self._watched: dict[str, tuple[float, str]] = {}
        self._fed: dict[str, float] = {}

    def set(self, name: str, frequency: float, action: str, t: float) -> None:
        """Do `action` ("pause", "stop" or "ignore") when `name` is updated less often than `frequency` [Hz]; 0 lifts it."""
        self._watched.pop(name, None)
        if frequency > 0:
            self._watched[name] = (1.0 / frequency, action)
            self._fed[name] = t

    def fed(self, names: Iterable[str], t: float) -> None:
        """These inputs were updated at t [s]."""
        for name in names:
            if name in self._watched:
                self._fed[name] = t

    def expired(self, t: float) -> list[tuple[str, str]]:
        """Name and action of each watchdog that waits too long at t [s]; those that ignore it are left out."""
        if not self._watched:
            return []
        late = [(name, action) for name, (limit, action) in self._watched.items() if t - self._fed[name] > limit]
        for name, _ in late:
            self._fed[name] = t
        return [(name, action) for name, action in late if action != "ignore"]

    def clear(self) -> None:
        """Without any: they end with their program."""
        self._watched.clear()
