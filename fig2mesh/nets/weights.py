"""Trained parameters: half precision in safetensors files, shipped as package data.

The header says what they are: network, data, seed, scores. It is one JSON text under one key, because the format
leaves the order of several keys open and the same weights shall give the same bytes.
"""

from __future__ import annotations

import functools
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, TypeVar

import torch
from torch import Tensor, nn

from fig2mesh.errors import InputError
from fig2mesh.nets.disn import Disn, DisnShape
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json

M = TypeVar("M", bound=nn.Module)

FOLDER: Final = Path(__file__).resolve().parent.parent / "weights"
KEY: Final = "fig2mesh"
REINSTALL: Final = "install fig2mesh again; docs/training.md says how weights are made"


def save(path: Path, state: Mapping[str, Tensor], facts: Mapping[str, Any]) -> None:
    """Write parameters as float16 (integers as they are) with what is known of them; facts : anything JSON holds."""
    from safetensors.torch import save_file

    halves = {
        name: (value.half() if value.is_floating_point() else value).detach().cpu().contiguous()
        for name, value in state.items()
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    save_file(halves, part, {KEY: json.dumps(dict(facts), sort_keys=True)})
    # safetensors writes for the owner alone; package data is for everybody.
    part.chmod(0o644)
    os.replace(part, path)


def read(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Parameters as float32, and the facts written with them."""
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise InputError(path, "no such file of weights", REINSTALL)
    try:
        with safe_open(path, framework="pt") as stream:
            facts = parse_json((stream.metadata() or {})[KEY])
            if not isinstance(facts, dict):
                raise ValueError("facts")
            state = {name: stream.get_tensor(name) for name in stream.keys()}  # noqa: SIM118 - no mapping
    except (SafetensorError, DamagedFile, OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise InputError(path, f"no readable weights ({type(error).__name__})", REINSTALL) from None
    broken = [name for name, value in state.items() if not torch.isfinite(value).all()]
    if broken:
        raise InputError(path, f"{broken[0]} holds numbers that are not finite", REINSTALL)
    return {name: value.float() if value.is_floating_point() else value for name, value in state.items()}, facts


def read_module(path: Path, make: Callable[[dict[str, Any]], M], what: str) -> tuple[M, dict[str, Any]]:
    """A network, ready for inference, and its facts.

    make : network from the shape among the facts; what : it is called, "pose network"
    """
    state, facts = read(path)
    try:
        net = make(facts["shape"])
        net.load_state_dict(state)
    except (AttributeError, LookupError, TypeError, ValueError, RuntimeError, ArithmeticError) as error:
        finding = f"not the weights of a {what} ({str(error).splitlines()[0]})"
        raise InputError(path, finding, REINSTALL) from None
    return net.eval().requires_grad_(False), facts


def disn_path(shape: DisnShape, folder: Path = FOLDER) -> Path:
    """Where the weights of a part network are."""
    return folder / f"disn-{shape.kind}-{shape.variant}.safetensors"


def save_disn(path: Path, net: Disn, facts: Mapping[str, Any]) -> None:
    """Write a part network; its shape is put among the facts."""
    shape = {"kind": net.shape.kind, "variant": net.shape.variant}
    save(path, net.state_dict(), {**facts, "network": "disn", "shape": shape})


def read_disn(path: Path) -> tuple[Disn, dict[str, Any]]:
    """A part network, ready for inference, and its facts."""
    return read_module(path, lambda shape: Disn(DisnShape.of(shape["kind"], shape["variant"])), "part network")


@functools.cache
def load(kind: str, variant: str = "two-stream-pose") -> Disn:
    """The shipped network of a part, read once a process."""
    shape = DisnShape.of(kind, variant)
    path = disn_path(shape)
    net, _ = read_disn(path)
    if net.shape != shape:
        raise InputError(path, f"weights of a {net.shape.variant} network for {net.shape.kind}", REINSTALL)
    return net
