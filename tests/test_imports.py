"""Imports go one way, georef <- exporters <- fig2mesh, and heavy libraries stay where they belong."""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

OTHERS_OF_THE_HOUSE = {"tests", "examples"}
MESH_LIBRARIES = {
    "fast_simplification",
    "manifold3d",
    "numba",
    "open3d",
    "pxr",
    "pygltflib",
    "pymeshlab",
    "skimage",
    "trimesh",
    "xatlas",
}
FORBIDDEN = {
    "georef": {"exporters", "fig2mesh", "torch"} | MESH_LIBRARIES | OTHERS_OF_THE_HOUSE,
    "exporters": {"fig2mesh", "torch"} | OTHERS_OF_THE_HOUSE,
    "fig2mesh": OTHERS_OF_THE_HOUSE,
}


def imported(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """(line, top-level package) of every absolute import, those inside functions and TYPE_CHECKING too."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name.split(".")[0]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.lineno, node.module.split(".")[0]
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in ("import_module", "__import__") and isinstance(node.args[0].value, str):
                yield node.lineno, node.args[0].value.split(".")[0]


def offences(source: str, package: str) -> list[tuple[int, str]]:
    return [(line, name) for line, name in imported(ast.parse(source)) if name in FORBIDDEN[package]]


@pytest.mark.parametrize("package", FORBIDDEN)
def test_imports_go_one_way(package):
    modules = sorted((ROOT / package).rglob("*.py"))
    assert modules, f"{package}/ holds no modules"
    found = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in modules
        for line, name in offences(path.read_text(encoding="utf-8"), package)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "source",
    [
        "import exporters.gltf.glb",
        "from fig2mesh import records",
        "def f():\n    import torch.nn as nn",
        "import importlib\nimportlib.import_module('trimesh')",
        "if TYPE_CHECKING:\n    from exporters.asset import Asset",
    ],
)
def test_the_scan_sees_every_way_of_importing(source):
    assert offences(source, "georef")
    assert not offences("import numpy\nfrom georef.frames import ENU\nfrom . import errors", "georef")


# fmt: off
LAYERS = (
    ("georef",),
    ("exporters",),
    ("counters", "errors", "settings", "skeleton", "system", "terminal"),
    ("records", "nets"),
    ("image_frame", "field", "parse"),
    ("asset_frame", "parts", "pose"),
    ("texture",),
    ("mesh",),
    ("contour",),
    ("stages", "measure", "training"),
    ("conversion",),
    ("fig2mesh", "batch", "evaluate", "render", "view"),
    ("annotate", "globe", "tradeoff"),
    ("commands",),
    ("__main__",),
)
# fmt: on
"""Folders and modules of fig2mesh, and the packages below it, from the bottom up: each imports only from below.

"fig2mesh" is the front door, `fig2mesh/__init__.py`. Modules of one folder may import each other, one way.
"""


def modules() -> dict[str, Path]:
    """File of each module of the three packages, by its dotted name."""
    found = {}
    for package in FORBIDDEN:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported_modules(source: str, known: Collection[str]) -> set[str]:
    """Those of the known modules that a source imports, inside functions and TYPE_CHECKING too."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                found.add(whole if whole in known else node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return found & set(known)


def import_graph() -> dict[str, set[str]]:
    """Modules that each module imports."""
    files = modules()
    return {name: imported_modules(path.read_text("utf-8"), files) - {name} for name, path in files.items()}


def cycle_in(graph: dict[str, set[str]]) -> list[str]:
    """Modules that import each other, directly or not; empty where there are none."""
    left = dict(graph)
    while left:
        free = [name for name, others in left.items() if not others & left.keys()]
        if not free:
            return sorted(left)
        for name in free:
            del left[name]
    return []


def test_no_two_modules_import_each_other():
    assert not cycle_in(import_graph())
    assert cycle_in({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set()}) == ["a", "b", "c", "d"]


def layer_name(module: str) -> str:
    parts = module.split(".")
    return parts[1] if parts[0] == "fig2mesh" and len(parts) > 1 else parts[0]


def test_layers_import_only_from_below():
    height = {name: number for number, layer in enumerate(LAYERS) for name in layer}
    graph = import_graph()
    assert {layer_name(module) for module in graph} == set(height)
    found = [
        f"{module} imports {other}"
        for module, others in graph.items()
        for other in others
        if layer_name(other) != layer_name(module) and height[layer_name(other)] >= height[layer_name(module)]
    ]
    assert not found, "\n".join(found)


def test_no_crowds():
    """Few loose modules, and folders that can be taken in at a glance."""
    folders = [path for package in FORBIDDEN for path in (ROOT / package).rglob("*") if (path / "__init__.py").exists()]
    counts = {path.relative_to(ROOT).as_posix(): len(list(path.glob("*.py"))) for path in folders}
    assert len(list((ROOT / "fig2mesh").glob("*.py"))) <= 10
    assert all(count <= 27 for count in counts.values()), counts


def test_classes_have_names_of_their_own():
    found: dict[str, list[str]] = {}
    for name, path in modules().items():
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name, []).append(name)
    assert not {name: places for name, places in found.items() if len(places) > 1}
