"""The text for users is true: its links resolve, its commands parse, its code runs, and it describes every method."""

from __future__ import annotations

import re
import shlex
from dataclasses import fields
from functools import cache
from pathlib import Path

import pytest
from conftest import ROOT

from wgsss import __version__
from wgsss.cli import _parse
from wgsss.registry import METHODS, REFERENCES, SURFACES, TRANSLUCENCIES
from wgsss.scene import load_scene

DOCS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
EXECUTED_ELSEWHERE = {"docs/extending.md"}  # by test_extending.py


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


each_page = pytest.mark.parametrize("page", DOCS, ids=name_of)


def blocks(page: Path, language: str) -> list[str]:
    """Return the code blocks of a page that are marked with a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.S | re.M)


@cache
def prose(page: Path) -> str:
    """Return the text of a page without its code."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.S | re.M)
    return re.sub(r"`[^`\n]*`", lambda match: "x" * len(match.group()), text)


@cache
def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub forms them."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", page.read_text(), flags=re.S | re.M), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@each_page
def test_relative_links_and_anchors_resolve(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if target.startswith("https://"):
            continue
        file, _, anchor = target.partition("#")
        linked = (page.parent / file).resolve() if file else page
        assert linked.exists(), f"{name_of(page)} links to {target}, which does not exist"
        if anchor:
            assert anchor in anchors(linked), f"{name_of(page)} links to {target}, a heading that does not exist"


@pytest.mark.parametrize("page", [page for page in DOCS if name_of(page) not in EXECUTED_ELSEWHERE], ids=name_of)
def test_files_of_the_project_that_are_named_exist(page: Path) -> None:
    for name in re.findall(r"`((?:examples|studies|wgsss|wgsl|tests|docs)/[\w/.]+\.\w+)`", page.read_text()):
        assert (ROOT / name).exists(), f"{name_of(page)} names {name}, which does not exist"


def test_every_page_is_linked_from_the_readme_or_the_index_of_methods() -> None:
    linked = set()
    for index in (ROOT / "README.md", ROOT / "docs" / "methods" / "README.md"):
        targets = re.findall(r"\]\(([^)\s#]+)", index.read_text())
        linked |= {(index.parent / target).resolve() for target in targets if not target.startswith("http")}
    assert set(DOCS) - {ROOT / "README.md"} <= linked


def test_the_readme_has_at_most_150_lines() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= 150


@each_page
def test_commands_parse(page: Path) -> None:
    for block in blocks(page, "sh"):
        for line in block.splitlines():
            words = shlex.split(line, comments=True)
            if words and words[0] == "wgsss":
                _parse(words[1:])


def test_the_readme_shows_six_commands() -> None:
    commands = [line for block in blocks(ROOT / "README.md", "sh") for line in block.splitlines()]
    assert len(commands) == 6 and all(command.startswith("wgsss ") for command in commands)


@pytest.mark.parametrize("page", [page for page in DOCS if name_of(page) not in EXECUTED_ELSEWHERE], ids=name_of)
def test_python_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    smaller = {"(512, 512)": "(24, 24)", '"ear"': '"ear", vertices=500', "15.0": "15.0, vertices=300", "=2048": "=64"}
    for block in blocks(page, "python"):
        for whole, small in smaller.items():
            block = block.replace(whole, small)
        exec(compile(block, name_of(page), "exec"), {})


@pytest.mark.parametrize("page", [page for page in DOCS if blocks(page, "toml")], ids=name_of)
def test_scene_files_load(page: Path, tmp_path: Path) -> None:
    for number, block in enumerate(blocks(page, "toml")):
        path = tmp_path / f"{number}.toml"
        path.write_text(re.sub(r'mesh = ".*"\nsize_mm = .*', 'shape = "sphere"', block))
        load_scene(path)


@pytest.mark.parametrize("name", METHODS)
def test_each_method_has_a_page_and_a_row_in_the_readme(name: str) -> None:
    source = METHODS[name].source
    row = re.search(rf"^\| \[`{name}`\]\(docs/methods/{name}\.md\) \|.*$", (ROOT / "README.md").read_text(), re.M)
    assert row and any(paper.split(",")[0] in row.group() for paper in source.split("; "))
    page = ROOT / "docs" / "methods" / f"{name}.md"
    headings = re.findall(r"^## (.*)$", page.read_text(), re.M)
    assert headings == ["Model", "What it leaves out", "When to choose it", "Knobs"]
    assert source.split(",")[0] in page.read_text()


@pytest.mark.parametrize("name", METHODS)
def test_the_page_of_a_method_lists_its_knobs_and_their_defaults(name: str) -> None:
    rows = re.findall(r"^\| `(\w+)` \| ([^|]*) \|", (ROOT / "docs" / "methods" / f"{name}.md").read_text(), re.M)
    listed = dict(rows)
    for knob in fields(METHODS[name]):  # type: ignore[arg-type]
        default = (
            {True: "on", False: "off"}.get(knob.default, knob.default) if knob.type in (bool, "bool") else knob.default
        )
        assert listed.get(knob.name) == str(default), f"{name}: {knob.name}"


def test_the_page_of_references_lists_their_knobs_and_defaults() -> None:
    text = (ROOT / "docs" / "references.md").read_text()
    for name, kind in REFERENCES.items():
        for knob in fields(kind):
            assert f"| `{name}`: `{knob.name}` | {knob.default} |" in text


def test_the_index_of_methods_lists_every_part_of_a_pair() -> None:
    text = (ROOT / "docs" / "methods" / "README.md").read_text()
    for part, names in {"surface": SURFACES, "translucency": ["none", *TRANSLUCENCIES]}.items():
        for name in names:
            assert f"| {part} | `{name}` |" in text


def test_the_citation_names_this_version_and_every_required_key() -> None:
    text = (ROOT / "CITATION.cff").read_text()
    assert re.findall(r"^ *version: (.*)$", text, re.M) == [__version__] * 2
    keys = re.findall(r"^([a-z-]+):", text, re.M)
    assert {"cff-version", "message", "title", "authors"} <= set(keys)
    assert "http" not in text
