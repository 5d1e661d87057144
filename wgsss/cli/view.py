"""`wgsss view`: a window to compare two methods by hand."""

from __future__ import annotations

from typing import Any

from wgsss.cli import arguments
from wgsss.errors import InputError

_INSTALL = "pip install rendercanvas glfw imgui-bundle"
_AGAINST = "method or reference on the right, as in sam:samples=8 (default: lambert)"


def declare(commands: Any) -> None:
    parser = arguments.command(commands, "view", run, "compare two methods in a window")
    arguments.add_scene(parser)
    arguments.add_method(parser)
    add = parser.add_argument
    add("--against", metavar="NAME", default="lambert", help=_AGAINST)
    add("--size", metavar="WxH", type=arguments.size, help="size in pixels (default: the last size)")


def _other(text: str) -> Any:
    from wgsss.registry import make_method

    (name, knobs), *more = arguments.settings(text)
    if more:
        raise InputError(f"--against {text}: name one method")
    return make_method(name, knobs)


def run(args: Any) -> None:
    method, other = arguments.make_method(args), _other(args.against)
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
    from wgsss.viewer.state import Source, State
    from wgsss.viewer.window import Window

    source = Source(**{field.name: getattr(args, field.name) for field in fields(Source)})
    state = State.open(source, [method, other], args.material, args.camera, args.light)
    Window(state, default_gpu(), args.size).run()
