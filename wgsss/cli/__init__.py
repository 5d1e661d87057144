"""The command line: `wgsss COMMAND`.

Exit codes: 0 success, 1 a fault of the renderer, 2 bad input. Large packages are imported only by the command that
uses them.
"""

from __future__ import annotations

import atexit
import logging
import os
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from wgsss import __version__, console
from wgsss.cli import bake, bench, catalogue, compare, export, info, profile, render, view
from wgsss.cli.arguments import Parser
from wgsss.cli.signals import Stopped, stoppable
from wgsss.errors import InputError, Note, RenderError, unknown
from wgsss.text import one_line, shortened, shown

INTERRUPTED, PIPE_CLOSED = 130, 141  # 128 + the signal, as shells report them
_LONGEST, _LONGEST_LINE = 200, 2000  # characters of a library's message, and of one of ours


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return the exit code. `argv` defaults to the arguments of the process."""
    console.occupy_standard_streams()
    try:
        with stoppable(), _printed_notes() as notes:
            args = _parse(sys.argv[1:] if argv is None else argv)
            args.warnings = notes
            args.run(args)
        return 0
    except InputError as error:
        return _fail(error, 2)
    except RenderError as error:
        return _fail(error, 1)
    except Stopped as stop:
        if argv is None:
            _leave(stop.code)
        return stop.code
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # the reader closed the pipe
        return PIPE_CLOSED
    except MemoryError as error:
        return _unexpected(f"there is not enough memory for this ({one_line(error) or 'how much is not known'})")
    except Exception as error:
        return _unexpected(
            f"a fault of wgsss, not of the input ({type(error).__name__}: {shortened(error, _LONGEST)}): please report"
            " it with the command and its files; WGSSS_DEBUG=1 shows where it happened"
        )


def _parse(argv: Sequence[str]) -> Any:
    parser = Parser(prog="wgsss", description="Render translucent materials by the methods of published papers.")
    parser.add_argument("--version", action="version", version=f"wgsss {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True, title="commands")
    for module in (render, view, bake, compare, bench, profile, export, catalogue, info):
        module.declare(commands)
    if argv and not argv[0].startswith("-") and argv[0] not in commands.choices:
        raise unknown("command", argv[0], commands.choices)
    args, rest = parser.parse_known_args(argv)
    if rest and rest[0].startswith("-"):
        raise unknown("option", rest[0].split("=")[0], commands.choices[args.command].options)
    if rest:
        raise InputError(f"unexpected argument {shown(rest[0])}")
    return args


@contextmanager
def _printed_notes() -> Iterator[list[str]]:
    """Print each different Note that the block raises on standard error, and yield the list of them.

    Warnings of libraries are ignored.
    """
    notes: list[str] = []

    def show(message: Warning | str, *where: Any, **more: Any) -> None:
        text = one_line(message)
        if text not in notes:
            notes.append(text)
            console.print_message(f"wgsss: warning: {text}")

    silent = logging.NullHandler()  # without any handler, Python prints what libraries log
    logging.getLogger().addHandler(silent)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("always", category=Note)
            warnings.showwarning = show
            yield notes
    finally:
        logging.getLogger().removeHandler(silent)


def _leave(code: int) -> None:
    """Run the exit handlers and end the process without shutting down the interpreter.

    Threads of libraries may still run, and would crash while the interpreter shuts down.
    """
    with suppress(Exception):
        atexit._run_exitfuncs()
    os._exit(code)


def _fail(message: object, code: int) -> int:
    console.print_message(f"wgsss: error: {shortened(message, _LONGEST_LINE)}")
    return code


def _unexpected(message: str) -> int:
    if os.environ.get("WGSSS_DEBUG") == "1":
        console.print_message(traceback.format_exc().rstrip())
    return _fail(message, 1)
