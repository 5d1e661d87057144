"""The command line: `wgsss COMMAND`.

Exit codes: 0 done, 1 a fault of the renderer, 2 bad input. Nothing heavy is imported before a command runs.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from wgsss import __version__
from wgsss.cli import bake, bench, catalogue, compare, export, info, profile, render, view
from wgsss.cli.arguments import Parser
from wgsss.errors import InputError, RenderError, unknown

INTERRUPTED, PIPE_CLOSED = 130, 141  # 128 + the signal, as shells report them


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command with its arguments (by default the process's) and give back the exit code."""
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            args = _parse(sys.argv[1:] if argv is None else argv)
            args.run(args)
        return 0
    except InputError as error:
        return _say("error", error, 2)
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # whoever read our output has gone; what is still buffered must not fail again at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return PIPE_CLOSED
    except RenderError as error:
        return _say("error", error, 1)


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
        raise InputError(f"unexpected argument '{rest[0]}'")
    return args


def _show_warning(message: Warning | str, *where: Any, **more: Any) -> None:
    _say("warning", message, 0)


def _say(kind: str, message: object, code: int) -> int:
    print(f"wgsss: {kind}: {' '.join(str(message).split())}", file=sys.stderr)
    return code
