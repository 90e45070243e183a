"""The command `weldsim`: what every subcommand shares. Answers go to stdout, everything else to stderr in one line.

Exit codes: 0 done, 1 a job that cannot succeed or a failed verdict, 2 bad input, 70 a defect of weldsim itself (with
WELDSIM_DEBUG=1 its traceback is shown), 130 interrupted, 141 the reader of stdout went away.
"""

import contextlib
import io
import json
import logging
import os
import sys
import traceback
import warnings
from collections.abc import Sequence

from weldsim import __version__
from weldsim.cli.signals import INTERRUPTED
from weldsim.errors import WeldsimError

DEFECT, NO_READER = 70, 141  # sysexits.h EX_SOFTWARE; 128 + SIGPIPE


def main(args: Sequence[str] | None = None) -> int:
    """The exit code of one command; `args` without the program's name, or what the process was started with."""
    _write_all_of_stdout()
    words = list(sys.argv[1:] if args is None else args)
    debug = os.environ.get("WELDSIM_DEBUG", "") not in ("", "0")
    try:
        with warnings.catch_warnings():
            if not debug:
                warnings.simplefilter("ignore")  # of libraries; they mean nothing to who runs a command
                # Where the home folder cannot be written matplotlib takes a temporary one, and would say so.
                logging.getLogger("matplotlib").setLevel(logging.ERROR)
            code = _dispatch(words)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        _drop_stdout()
        return NO_READER
    except KeyboardInterrupt as interrupt:
        return _fail(str(interrupt) or "interrupted", INTERRUPTED, as_json=False)
    except WeldsimError as error:
        return _fail(str(error), error.exit_code, as_json="--json" in words)
    except (OSError, MemoryError) as error:
        reason = "out of memory" if isinstance(error, MemoryError) else error.strerror or str(error)
        return _fail(f"{getattr(error, 'filename', None) or 'this machine'}: {reason}", 2, as_json="--json" in words)
    except Exception as error:
        if debug:
            traceback.print_exc()
        what = " ".join(f"{type(error).__name__}: {error}".split())
        return _fail(
            f"internal error: {what}; this is a defect of weldsim, WELDSIM_DEBUG=1 shows where", DEFECT, as_json="--json" in words
        )
    return code


def _dispatch(words: list[str]) -> int:
    """Runs the command that `words` name."""
    # The matrices here are small: threads of OpenBLAS wait for each other longer than they compute, ten times longer on a
    # busy machine. The library reads this when numpy is first imported, which no module loaded so far does.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if words == ["--version"]:
        print(f"weldsim {__version__}")
        return 0
    # tyro takes a sixth of a second: not for --version, and not for who only imports this package.
    from weldsim.cli.usage import parse

    command = parse(words)
    return command if isinstance(command, int) else command()


def _write_all_of_stdout() -> None:
    """Buffers stdout where Python does not (PYTHONUNBUFFERED): unbuffered, it drops without a word what a pipe does not take
    at once, so that output ends early and a reader who left goes unnoticed."""
    raw = getattr(sys.stdout, "buffer", None)
    if isinstance(raw, io.RawIOBase) and sys.stdout is sys.__stdout__:  # not one that a caller put in its place
        encoding, errors = sys.stdout.encoding, sys.stdout.errors
        sys.stdout = io.TextIOWrapper(io.BufferedWriter(raw), encoding=encoding, errors=errors, line_buffering=True)  # type: ignore[arg-type]


def _fail(message: str, code: int, *, as_json: bool) -> int:
    """`code`, after one line on stderr and, for machines, one object on stdout."""
    message = " ".join(message.split())
    try:
        if as_json:
            print(json.dumps({"error": message, "exit_code": code}), flush=True)
    except OSError:
        _drop_stdout()
    with contextlib.suppress(OSError):
        print(f"weldsim: {message}", file=sys.stderr, flush=True)
    return code


def _drop_stdout() -> None:
    """Python flushes stdout once more as it ends: into nothing, then."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
