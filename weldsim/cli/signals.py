"""What Ctrl-C and a polite kill do to a command."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager

INTERRUPTED = 130  # exit code: 128 + SIGINT
ASKED = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def interrupted_once() -> Iterator[None]:
    """Within the block the first Ctrl-C or SIGTERM raises KeyboardInterrupt and further ones are passed over.

    So that who presses twice does not cut short the stop of an arm, which ends by itself.
    """

    def first(number: int, frame: object) -> None:
        for each in ASKED:
            signal.signal(each, signal.SIG_IGN)
        raise KeyboardInterrupt

    before = {each: signal.signal(each, first) for each in ASKED}
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
