"""Speed against accuracy: every method over its knobs, one line of a file per run."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from wgsss.console import progress_bar
from wgsss.errors import InputError, unknown
from wgsss.study.run_line import Run
from wgsss.study.runs import FILE, appended, read

if TYPE_CHECKING:
    from wgsss.scene import Scene
    from wgsss.study.run import Spec

__all__ = ["FILE", "Run", "bench", "read"]

Task = tuple["Scene", "Spec"]
Place = tuple[set[str], Callable[[Sequence[Task]], Iterator[Run]]]
"""where runs are done: its adapters, and what does them"""

DEFAULT_REFERENCE = "integral"
_SAME = ("scene", "digest", "method", "knobs", "size", "reference", "version")


def bench(
    scenes: Sequence[Scene],
    methods: Sequence[str] | None = None,
    folder: str | Path = "bench",
    size: tuple[int, int] = (256, 256),
    *,
    reference: str = DEFAULT_REFERENCE,
    scheduler: str | None = None,
    tell: Callable[[Run], None] = lambda run: None,
) -> list[Run]:
    """Measure each of `methods` (by default all) at each setting of its sweep, in each scene, against a reference.

    Runs are appended to `runs.jsonl` in `folder`, which is made, as they end, and those that are there already, of the
    same scene, method, knobs, size, reference, adapter and version, are not done again: what is stopped goes on where
    it was.

    Args:
        size: width and height, pixels.
        reference: its name, as of `REFERENCES`.
        scheduler: address of a Dask cluster to run on; by default runs are done here, one after the other. Each worker
            should have a machine for itself, since what else runs there slows what is measured.
        tell: called with each run as it ends.

    Returns:
        The runs asked for, done now or before, by scene, method and setting.

    Raises:
        InputError: for names that are not known, a scene that a method or the reference cannot have, a folder that
            cannot be written, a scheduler that is not there.
        RenderError: where a number is not finite. The runs before it are kept.
    """
    specs = [(scene, spec) for scene in scenes for spec in _specs(scene, methods, size, reference)]
    with (
        _here() if scheduler is None else _cluster(scheduler) as (adapters, runs),
        appended(Path(folder)) as (before, append),
    ):
        done = {_key(run): run for run in before if run["adapter"] in adapters}
        todo = [(scene, spec) for scene, spec in specs if _key(spec.json()) not in done]
        bar = progress_bar(total=len(specs), initial=len(specs) - len(todo), unit="run")
        with bar:
            for run in runs(todo):
                append(run)
                done[_key(run)] = run
                bar.update()
                tell(run)
    return [done[_key(spec.json())] for _, spec in specs]


def _specs(scene: Scene, methods: Sequence[str] | None, size: tuple[int, int], reference: str) -> list[Spec]:
    """What is to be measured in a scene, each setting once."""
    from wgsss.methods import METHODS, kind_of, make_method
    from wgsss.reference import REFERENCES
    from wgsss.study.run import Spec, digest

    for method in methods or ():
        if method in REFERENCES:
            raise unknown("method", method, METHODS)
    if reference not in REFERENCES:
        raise unknown("reference", reference, REFERENCES)
    seen = digest(scene)
    return [
        Spec(scene.name, seen, method, vars(make_method(method, knobs)), step, size, reference)
        for method in dict.fromkeys(methods or METHODS)
        for step, knobs in enumerate(kind_of(method).sweep)
    ]


def _key(run: Run) -> str:
    return json.dumps([run[name] for name in _SAME], sort_keys=True)


@contextmanager
def _here() -> Iterator[Place]:
    """Runs in this process."""
    from wgsss.study.run import adapter, measure

    yield {adapter()}, lambda todo: (measure(scene, spec) for scene, spec in todo)


@contextmanager
def _cluster(address: str) -> Iterator[Place]:
    """Runs on the workers of a Dask cluster, each scene sent once. Left early, what is still to do is called off."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError("a scheduler needs Dask: install wgsss[cluster]") from None
    from wgsss.study.run import adapter, measure, version

    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler at '{address}' ({' '.join(str(error).split())})") from None

    def runs(todo: Sequence[Task]) -> Iterator[Run]:
        sent = {id(scene): client.scatter(scene) for scene in {id(scene): scene for scene, _ in todo}.values()}
        for future in as_completed([client.submit(measure, sent[id(scene)], spec, pure=False) for scene, spec in todo]):
            yield future.result()

    with client:
        adapters = set(client.run(adapter).values())
        if not adapters:
            raise InputError(f"the Dask cluster at '{address}' has no workers")
        others = set(client.run(version).values()) - {version()}
        if others:
            raise InputError(f"workers at '{address}' run wgsss {', '.join(sorted(others))}, here is {version()}")
        yield adapters, runs
