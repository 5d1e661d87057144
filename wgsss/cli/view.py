"""`wgsss view`: a window that compares two methods."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from wgsss.cli import arguments
from wgsss.errors import InputError

if TYPE_CHECKING:
    from wgsss.methods import Method

_INSTALL = "pip install rendercanvas glfw imgui-bundle"
_AGAINST = "method or reference on the right, as in sam:samples=8 (default: lambert)"


def declare(commands: Any) -> None:
    """Declare the command and its arguments."""
    parser = arguments.command(commands, "view", run, "compare two methods in a window")
    arguments.add_scene(parser)
    arguments.add_method(parser)
    add = parser.add_argument
    add("--against", metavar="NAME", default="lambert", help=_AGAINST)
    add("--size", metavar="WxH", type=arguments.size, help="size in pixels (default: the last size)")


def run(args: argparse.Namespace) -> None:
    """Open the window, and return once it is closed. Raises InputError if it cannot be opened."""
    methods = [arguments.make_method(args), _parse_against(args.against)]
    try:
        import glfw
        import imgui_bundle  # noqa: F401
        import rendercanvas  # noqa: F401
    except ImportError as error:
        raise InputError(f"the viewer needs {error.name}: {_INSTALL}") from None
    if not glfw.init():
        raise InputError("no window can be opened: there is no display")

    from dataclasses import fields

    from wgsss.gpu import default_gpu
    from wgsss.viewer.command import Source
    from wgsss.viewer.session import Session
    from wgsss.viewer.window import Window

    source = Source(**{field.name: getattr(args, field.name) for field in fields(Source)})
    session = Session.open(default_gpu(), source, methods, args.material, args.camera, args.light)
    Window(session, args.size).run()


def _parse_against(text: str) -> Method:
    """Return the method of --against, with its knobs set."""
    from wgsss.registry import make_method

    (name, knobs), *more = arguments.settings(text)
    if more:
        raise InputError(f"--against {text}: name one method")
    return make_method(name, knobs)
