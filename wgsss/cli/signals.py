"""Turns signals that end a command into an exception, so that temporary files are deleted."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_ENDING = ("SIGINT", "SIGTERM", "SIGHUP")
_AGAIN_S = 0.02  # after which a signal whose exception was lost is raised once more


class Stopped(KeyboardInterrupt):
    """A signal asked the command to end. Handlers of KeyboardInterrupt catch it too."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.code = 128 + number
        """the exit code, as shells report it"""


@contextmanager
def stoppable() -> Iterator[None]:
    """Raise Stopped in the block at the first signal that asks the process to end, and ignore later signals.

    A signal that was ignored before, for example by nohup, stays ignored. After Stopped, signals stay ignored because
    the process is about to end. Python handles signals in the main thread only: in other threads this does nothing.
    """
    stopped = 0  # by which signal

    def stop(number: int, frame: Any) -> None:
        nonlocal stopped
        if not stopped:
            stopped = number
            raise Stopped(number)

    def unraisable(lost: Any) -> None:
        nonlocal stopped
        if isinstance(lost.exc_value, Stopped):  # it came where Python drops exceptions, as when an object is freed
            stopped = 0
            threading.Timer(_AGAIN_S, _send, (lost.exc_value.code - 128,)).start()
        else:
            before_hook(lost)

    before: dict[int, Any] = {}
    before_hook = sys.unraisablehook
    if threading.current_thread() is threading.main_thread():
        for number in (getattr(signal, name) for name in _ENDING if hasattr(signal, name)):
            if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
                before[number] = signal.signal(number, stop)
        sys.unraisablehook = unraisable
    try:
        yield
    except Exception:
        if stopped:  # a library made another exception of it, as of what goes wrong while a module is imported
            raise Stopped(stopped) from None
        raise
    finally:
        sys.unraisablehook = before_hook
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if stopped else handler)


def _send(number: int) -> None:
    """Send a signal to the main thread, to interrupt a blocking call."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        _thread.interrupt_main(signal.Signals(number))
