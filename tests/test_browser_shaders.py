"""Every WGSL module, with its imports, compiles in Chromium, whose compiler (Tint) is stricter than wgpu's (naga)."""

from __future__ import annotations

import json
from pathlib import Path

import browser
import pytest

from wgsss import wgsl

COMPILE = """(async () => {
    const adapter = await navigator.gpu?.requestAdapter();
    if (!adapter) {
        return null;
    }
    const device = await adapter.requestDevice();
    const faults = {};
    for (const [name, code] of Object.entries(SOURCES)) {
        const info = await device.createShaderModule({ code }).getCompilationInfo();
        const errors = info.messages.filter((message) => message.type === "error");
        faults[name] = errors.map((error) => `:${error.lineNum}:${error.linePos} ${error.message}`);
    }
    return faults;
})()"""


def test_all_modules_compile_in_chromium(tmp_path: Path) -> None:
    if browser.chromium() is None:
        pytest.skip(f"no browser: none of {', '.join(browser.NAMES)} is installed")
    names = [str(path.relative_to(wgsl.ROOT).with_suffix("")) for path in sorted(wgsl.ROOT.rglob("*.wgsl"))]
    modules = {name: wgsl.load(name) for name in names}
    sources = {name: module.source for name, module in modules.items()}
    blank = tmp_path / "blank.html"  # a file, since pages without an address have no WebGPU
    blank.write_text("<!doctype html><title>WGSL</title>")
    with browser.page(webgpu=True) as page:
        page.open(blank.as_uri())
        faults = page.run(COMPILE.replace("SOURCES", json.dumps(sources)))
    if faults is None:
        pytest.skip("this browser has no WebGPU adapter")
    assert faults.keys() == modules.keys()
    explained = [modules[name].explain(fault) for name, found in faults.items() for fault in found]
    assert not explained, "\n".join(explained)
