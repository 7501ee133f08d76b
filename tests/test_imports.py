"""Imports go one way, georef <- exporters <- fig2mesh, and heavy libraries stay where they belong."""

from __future__ import annotations

import ast
from collections.abc import Iterator
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


KNOWN_CYCLES = {("parse", "convert"), ("batch", "commands")}
"""Imports between folders of fig2mesh that are not counted: logging of jobs, and the options that rows may set."""


def folder_imports() -> dict[str, set[str]]:
    """Folder of fig2mesh → the others that its modules import, inside functions too."""
    graph: dict[str, set[str]] = {}
    for path in sorted((ROOT / "fig2mesh").rglob("*.py")):
        folder = path.relative_to(ROOT / "fig2mesh").parts[0].removesuffix(".py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("fig2mesh."):
                other = node.module.split(".")[1]
                if other != folder and (folder, other) not in KNOWN_CYCLES:
                    graph.setdefault(folder, set()).add(other)
    return graph


def test_folders_import_each_other_one_way_only():
    left = folder_imports()
    assert {"nets", "parts", "convert"} <= set(left)
    while left:
        free = [folder for folder, others in left.items() if not others & set(left)]
        assert free, f"these import each other: {', '.join(sorted(left))}"
        for folder in free:
            del left[folder]


def test_stages_do_not_import_what_stands_above_them():
    above = {"commands", "convert", "measure", "evaluate", "training", "batch", "render", "view"}
    graph = folder_imports()
    for folder in ("parse", "parts", "nets", "pose", "texture", "mesh", "field"):
        assert not graph[folder] & above, folder
