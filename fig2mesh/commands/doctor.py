"""`fig2mesh doctor`: check that everything the pipeline needs is installed and works."""

from __future__ import annotations

import importlib
import os
import tempfile
from collections.abc import Iterator

import click

from fig2mesh.conversion.libraries import PACKAGES, version
from fig2mesh.errors import SYSTEM_LIBRARIES
from fig2mesh.field.kernel_cache import kernel_folder
from fig2mesh.system.processes import run_apart
from fig2mesh.system.surroundings import NEEDED_BYTES, address_limit, temporary_fault


@click.command()
def doctor() -> None:
    """Check that everything fig2mesh needs is installed and works."""
    healthy = True
    for name, text in examine_surroundings():
        click.echo(f"{'note' if ';' in text else 'ok  '} {name}: {text}")
    for name, ok, text in examine():
        healthy &= ok
        click.echo(f"{'ok  ' if ok else 'FAIL'} {name}: {text}")
    if not healthy:
        raise SystemExit(1)


def examine_surroundings() -> Iterator[tuple[str, str]]:
    """Yield (name, state) of what the machine provides; a state with a remedy, after a semicolon, needs attention."""
    folder = kernel_folder()
    yield "compiled kernels", folder.note or f"kept in {folder.path}"
    yield "temporary folder", temporary_fault() or str(tempfile.gettempdir())
    limit = address_limit()
    short = f"{(limit or 0) / 1e9:.1f} GB; allow {NEEDED_BYTES / 1e9:.0f} GB for each process (ulimit -v)"
    enough = "no limit" if limit is None else f"{limit / 1e9:.1f} GB"
    yield "address space", short if limit is not None and limit < NEEDED_BYTES else enough
    apart = run_apart(os.getpid) != os.getpid()
    yield "worker processes", "can be started" if apart else "cannot be started; batch works in one process"
    yield "threads", _threads()


def _threads() -> str:
    try:
        from fig2mesh.field.compiled import thread_count

        return str(thread_count())
    except Exception as error:
        return " ".join(str(error).split())[:200]


def examine() -> Iterator[tuple[str, bool, str]]:
    """Yield (name, whether it works, version or reason) for every library."""
    for module, distribution in PACKAGES.items():
        try:
            importlib.import_module(module)
        except Exception as error:
            reason = " ".join(str(error).split())
            remedy = f"; run: {SYSTEM_LIBRARIES}" if "lib" in reason and ".so" in reason else ""
            yield distribution, False, f"{reason[:200]}{remedy}"
            continue
        yield distribution, True, version(distribution)
    yield _filters()
    yield _weights()
    yield _gpu()


def _filters() -> tuple[str, bool, str]:
    """Check PyMeshLab's filters: without libOpenGL the import succeeds, but they are missing."""
    try:
        import pymeshlab

        usable = hasattr(pymeshlab.MeshSet(), "meshing_close_holes")
    except ImportError:
        usable = False
    return "pymeshlab filters", usable, "loaded" if usable else f"missing; run: {SYSTEM_LIBRARIES}"


def _weights() -> tuple[str, bool, str]:
    try:
        from fig2mesh.nets import disn, figure_parser, part_size, pose_lift, weights
        from fig2mesh.skeleton import KINDS

        figure_parser.PARSER_WEIGHTS.shipped(figure_parser.SHIPPED)
        pose_lift.POSE_WEIGHTS.shipped(pose_lift.SHIPPED)
        for kind in KINDS:
            part_size.SIZE_WEIGHTS.shipped(part_size.SizeShape(kind))
            disn.PART_WEIGHTS.shipped(disn.DisnShape(kind))
    except Exception as error:
        return "weights", False, " ".join(str(error).split())[:200]
    megabytes = sum(path.stat().st_size for path in weights.FOLDER.glob("*.safetensors")) / 1e6
    return "weights", True, f"{megabytes:.0f} MB"


def _gpu() -> tuple[str, bool, str]:
    try:
        import torch

        found = torch.cuda.get_device_name(0) if torch.cuda.is_available() else "none (not needed)"
    except Exception as error:
        return "GPU", False, " ".join(str(error).split())[:200]
    return "GPU", True, found
