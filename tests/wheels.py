"""Print, as JSON, the versions of packages that have wheels for each machine: {machine: {package: [version, …]}}.

The script runs in its own process, with the names of the packages as arguments. It queries the indexes that pip is
configured to use once for each package. `pip install --dry-run --platform …` would query them for each machine, and
take a minute or two. pip has no public interface for this, so the script uses internal functions.
"""

from __future__ import annotations

import json
import sys
from functools import cached_property
from itertools import product
from typing import Any

from pip._internal.commands import create_command
from pip._internal.models.target_python import TargetPython
from pip._internal.models.wheel import Wheel
from pip._internal.utils.compatibility_tags import get_supported
from pip._internal.utils.packaging import check_requires_python

PYTHONS = ((3, 11), (3, 12), (3, 13), (3, 14))
GLIBC = range(17, 29)  # up to 2.28, the version of Debian 10 and RHEL 8
PLATFORMS = {
    "Linux x86_64": ["manylinux2014_x86_64", *(f"manylinux_2_{n}_x86_64" for n in GLIBC)],
    "Linux aarch64": ["manylinux2014_aarch64", *(f"manylinux_2_{n}_aarch64" for n in GLIBC)],
    "macOS x86_64": ["macosx_14_0_x86_64"],
    "macOS arm64": ["macosx_14_0_arm64"],
    "Windows AMD64": ["win_amd64"],
}
MACHINES = {
    f"Python {major}.{minor}, {name}": ((major, minor), platforms)
    for (major, minor), (name, platforms) in product(PYTHONS, PLATFORMS.items())
}


TAGS = {
    name: set(get_supported("".join(map(str, python)), platforms)) for name, (python, platforms) in MACHINES.items()
}
"""tags of the wheels that run on each machine"""


class _AnyMachine(TargetPython):
    """A target for pip that accepts the wheels of all machines."""

    @cached_property
    def _all(self) -> set[Any]:
        return set.union(*TAGS.values())

    def get_unsorted_tags(self) -> set[Any]:
        return self._all

    get_tags = get_unsorted_tags  # as pip 23.2 and older call it


def main(names: list[str]) -> None:
    command: Any = create_command("download")
    options, _ = command.parse_args(["--retries=1", "--timeout=20", "--only-binary=:all:", *names])
    with command.main_context():
        finder = command._build_package_finder(options, command.get_default_session(options), _AnyMachine(), True)
        wheels = {name: [candidate.link for candidate in finder.find_all_candidates(name)] for name in names}

    def versions(machine: str, name: str) -> list[str]:
        """Return the versions of a package that have a wheel for a machine."""
        python, tags = (*MACHINES[machine][0], 0), TAGS[machine]
        candidates = ((Wheel(link.filename), link) for link in wheels[name])
        return sorted(
            {
                w.version
                for w, link in candidates
                if w.supported(tags) and check_requires_python(link.requires_python, python)
            }
        )

    json.dump({machine: {name: versions(machine, name) for name in names} for machine in MACHINES}, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1:])
