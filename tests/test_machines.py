"""wgsss can be installed without a compiler on every supported machine with every supported Python."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires
from typing import Any

import pytest
from conftest import ROOT
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
WITHOUT = {"viewer": "macOS x86_64", "reference": "macOS x86_64"}
"""extras that are not available on a system: imgui-bundle and Mitsuba have no wheels for Macs with Intel processors"""
LISTER = ROOT / "tests" / "wheels.py"

PYTHONS = ("3.11", "3.12", "3.13", "3.14")
SYSTEMS = {  # values of environment markers for the systems of wheels.py
    "Linux x86_64": {"sys_platform": "linux", "platform_machine": "x86_64"},
    "Linux aarch64": {"sys_platform": "linux", "platform_machine": "aarch64"},
    "macOS x86_64": {"sys_platform": "darwin", "platform_machine": "x86_64"},
    "macOS arm64": {"sys_platform": "darwin", "platform_machine": "arm64"},
    "Windows AMD64": {"sys_platform": "win32", "platform_machine": "AMD64"},
}
MACHINES = {
    f"Python {python}, {name}": {
        **system,
        "python_version": python,
        "python_full_version": f"{python}.0",
        "platform_system": {"linux": "Linux", "darwin": "Darwin", "win32": "Windows"}[system["sys_platform"]],
        "os_name": "nt" if system["sys_platform"] == "win32" else "posix",
        "implementation_name": "cpython",
        "platform_python_implementation": "CPython",
    }
    for python in PYTHONS
    for name, system in SYSTEMS.items()
}


def needed(
    texts: list[str], environment: dict[str, str], extras: frozenset[str] = frozenset()
) -> Iterator[Requirement]:
    """Yield requirements for a machine, and recursively those of the packages that are installed here."""
    seen = set()
    queue = [(text, extras) for text in texts]
    while queue:
        text, extras = queue.pop()
        requirement = Requirement(text)
        if requirement.marker and not any(
            requirement.marker.evaluate({**environment, "extra": e}) for e in ("", *extras)
        ):
            continue
        yield requirement
        key = (canonicalize_name(requirement.name), frozenset(requirement.extras))
        if key not in seen:
            seen.add(key)
            try:
                queue += [(inner, key[1]) for inner in requires(requirement.name) or ()]
            except PackageNotFoundError:
                continue


def asked(extra: str) -> list[str]:
    return EXTRAS[extra] if extra else PROJECT["dependencies"]


@pytest.fixture(scope="module")
def wheels() -> dict[str, dict[str, list[str]]]:
    """Return the versions with a wheel, by machine and package."""
    every = [
        requirement for extra in ("", *EXTRAS) for env in MACHINES.values() for requirement in needed(asked(extra), env)
    ]
    names = sorted({canonicalize_name(requirement.name) for requirement in every})
    if not list_wheels(["numpy"], patience=60)[next(iter(MACHINES))]["numpy"]:
        pytest.skip("no package index answers")
    return list_wheels(names, patience=240)


def list_wheels(names: list[str], patience: float) -> Any:
    try:
        done = subprocess.run(
            [sys.executable, str(LISTER), *names], capture_output=True, text=True, timeout=patience, check=True
        )
    except subprocess.TimeoutExpired:
        pytest.skip(f"the package index does not answer within {patience:.0f} s")
    return json.loads(done.stdout)


@pytest.mark.parametrize("extra", ["", *EXTRAS])
def test_every_package_has_a_wheel(wheels: dict[str, dict[str, list[str]]], extra: str) -> None:
    missing = []
    for machine, environment in MACHINES.items():
        if extra in WITHOUT and machine.endswith(WITHOUT[extra]):
            continue
        specifiers: dict[str, Any] = {}
        for requirement in needed(asked(extra), environment):
            name = canonicalize_name(requirement.name)
            specifiers[name] = specifiers.get(name, requirement.specifier) & requirement.specifier
        for name, versions in specifiers.items():
            matching = [v for v in wheels[machine][name] if versions.contains(v, prereleases=False)]
            if not matching:
                missing.append(f"{machine}: no wheel of {name} {versions}".rstrip())
    assert not missing, "\n".join(missing)


def test_missing_wheels_are_detected(wheels: dict[str, dict[str, list[str]]]) -> None:
    """The lookup finds no wheel where there is none, so that the test above can fail."""
    assert not wheels["Python 3.14, Linux x86_64"]["xatlas"] and not wheels["Python 3.11, Linux aarch64"]["embreex"]
    assert wheels["Python 3.11, Linux x86_64"]["xatlas"] and wheels["Python 3.14, Windows AMD64"]["numpy"]


@pytest.mark.parametrize(("machine", "environment"), MACHINES.items(), ids=MACHINES)
def test_every_machine_has_one_package_for_rays_and_one_for_unwrapping(
    machine: str, environment: dict[str, str]
) -> None:
    names = {requirement.name for requirement in needed(PROJECT["dependencies"], environment)}
    assert len(names & {"embreex", "libigl"}) == len(names & {"xatlas", "uvunwrap"}) == 1


def test_bounds_are_versions_that_exist(wheels: dict[str, dict[str, list[str]]]) -> None:
    """`make test-lowest` installs these versions."""
    for text in PROJECT["dependencies"]:
        requirement = Requirement(text)
        (lowest,) = [s.version for s in requirement.specifier if s.operator == ">="]
        available = {Version(v) for machine in wheels.values() for v in machine[canonicalize_name(requirement.name)]}
        assert Version(lowest) in available, text
