"""Speed against accuracy: measure every method over its knobs, and record one line per run."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from wgsss.console import progress_bar
from wgsss.errors import InputError, unknown
from wgsss.study.run_log import open_log
from wgsss.study.run_record import Run

if TYPE_CHECKING:
    from wgsss.scene import Scene
    from wgsss.study.bench_run import RunSpec

Task = tuple["Scene", "RunSpec"]
Executor = tuple[set[str], Callable[[Sequence[Task]], Iterator[Run]]]
"""The adapters that tasks run on, and a function that does tasks and yields their runs as they end."""

_IDENTITY = ("scene", "digest", "method", "knobs", "size", "reference", "version")
"""Keys that two runs on one adapter share if they measure the same thing."""


def bench(
    scenes: Sequence[Scene],
    methods: Sequence[str] | None = None,
    folder: str | Path = "bench",
    size: tuple[int, int] = (256, 256),
    *,
    reference: str | None = None,
    scheduler: str | None = None,
    on_run: Callable[[Run], None] = lambda run: None,
) -> list[Run]:
    """Measure each of `methods` (by default all) at each setting of its sweep, in each scene, against a reference.

    Each run is appended to `runs.jsonl` in `folder` when it ends. The folder is created if needed. A run is skipped if
    the file already holds one of the same scene, method, knobs, size, reference, adapter and version, so that a
    benchmark that was stopped continues where it was.

    Args:
        size: width and height, pixels.
        reference: a name in `REFERENCES`. By default, `measurement.default_reference` chooses it for each setting.
        scheduler: address of a Dask cluster to run on. By default, runs are done here one after another. Each worker
            should have a machine to itself, because other work on it slows the frames that are timed.
        on_run: called with each run when it ends.

    Returns:
        All runs asked for, new or old, ordered by scene, method and setting.

    Raises:
        InputError: for an unknown name, a scene that the method or the reference cannot render, a folder that cannot be
            written, or a scheduler that cannot be reached.
        RenderError: if a number is not finite. The runs before it are recorded.
    """
    specs = [(scene, spec) for scene in scenes for spec in _specs(scene, methods, size, reference)]
    with (
        _local() if scheduler is None else _cluster(scheduler) as (adapters, execute_all),
        open_log(Path(folder)) as (recorded, append),
    ):
        done = {_key(run): run for run in recorded if run["adapter"] in adapters}
        todo = [(scene, spec) for scene, spec in specs if _key(spec.json()) not in done]
        bar = progress_bar(total=len(specs), initial=len(specs) - len(todo), unit="run")
        with bar:
            for run in execute_all(todo):
                append(run)
                done[_key(run)] = run
                bar.update()
                on_run(run)
    return [done[_key(spec.json())] for _, spec in specs]


def _specs(scene: Scene, methods: Sequence[str] | None, size: tuple[int, int], reference: str | None) -> list[RunSpec]:
    """Return what to measure in a scene, each setting once."""
    from wgsss.registry import METHODS, REFERENCES, make_method, methods_for, sweep_of
    from wgsss.study.bench_run import RunSpec
    from wgsss.study.measurement import default_reference, knobs_of
    from wgsss.study.provenance import scene_digest

    for method in methods or ():
        if method in REFERENCES:
            raise unknown("method", method, METHODS)
    if reference is not None and reference not in REFERENCES:
        raise unknown("reference", reference, REFERENCES)
    digest = scene_digest(scene)
    specs = []
    for name in dict.fromkeys(methods or methods_for(scene)):
        for step, knobs in enumerate(sweep_of(name)):
            made = make_method(name, knobs)
            against = reference or default_reference(scene, [made])
            specs.append(RunSpec(scene.name, digest, name, knobs_of(made) | knobs, step, size, against))
    return specs


def _key(run: Mapping[str, object]) -> str:
    return json.dumps([run[name] for name in _IDENTITY], sort_keys=True)


@contextmanager
def _local() -> Iterator[Executor]:
    """Yield an executor that does runs in this process."""
    from wgsss.study.bench_run import execute
    from wgsss.study.provenance import adapter

    yield {adapter()}, lambda todo: (execute(scene, spec) for scene, spec in todo)


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    """Yield an executor that does runs on the workers of a Dask cluster, and sends each scene once.

    If the block ends early, the runs that have not started are cancelled.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError("a scheduler needs Dask: install wgsss[cluster]") from None
    from wgsss.study.bench_run import execute
    from wgsss.study.provenance import adapter, version

    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler at '{address}' ({' '.join(str(error).split())})") from None

    def execute_all(todo: Sequence[Task]) -> Iterator[Run]:
        sent = {id(scene): client.scatter(scene) for scene in {id(scene): scene for scene, _ in todo}.values()}
        for future in as_completed([client.submit(execute, sent[id(scene)], spec, pure=False) for scene, spec in todo]):
            yield future.result()

    with client:
        adapters = set(client.run(adapter).values())
        if not adapters:
            raise InputError(f"the Dask cluster at '{address}' has no workers")
        others = set(client.run(version).values()) - {version()}
        if others:
            raise InputError(
                f"workers at '{address}' have wgsss {', '.join(sorted(others))}, but this machine has {version()}"
            )
        yield adapters, execute_all
