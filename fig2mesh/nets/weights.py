"""Trained parameters: half precision in safetensors files, shipped as package data.

The header describes them: network, data, seed, scores. It is one JSON text under one key, because the format leaves
the order of several keys open and the same weights must give the same bytes.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Generic, TypeVar, cast

import torch
from torch import Tensor, nn

from exporters.atomic_file import atomic_path
from fig2mesh.errors import InputError
from georef.untrusted.damage import DamagedFile
from georef.untrusted.json_file import parse_json

S = TypeVar("S")
M = TypeVar("M", bound=nn.Module)

FOLDER: Final = Path(__file__).resolve().parent.parent / "weights"
KEY: Final = "fig2mesh"
REINSTALL: Final = "install fig2mesh again; see docs/training.md to train weights"


def save(path: Path, state: Mapping[str, Tensor], facts: Mapping[str, Any]) -> None:
    """Write parameters as float16 (integers as they are) with their metadata; facts : any JSON object."""
    from safetensors.torch import save_file

    halves = {
        name: (value.half() if value.is_floating_point() else value).detach().cpu().contiguous()
        for name, value in state.items()
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(path) as partial:
        save_file(halves, partial, {KEY: json.dumps(dict(facts), sort_keys=True)})
        # safetensors makes files readable by the owner only; package data is for everybody.
        partial.chmod(0o644)


def read(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Parameters as float32, and the facts written with them."""
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise InputError(path, "no such file", REINSTALL)
    try:
        with safe_open(path, framework="pt") as stream:
            facts = parse_json((stream.metadata() or {})[KEY])
            if not isinstance(facts, dict):
                raise ValueError("facts")
            state = {name: stream.get_tensor(name) for name in stream.keys()}  # noqa: SIM118 - no mapping
    except (SafetensorError, DamagedFile, OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise InputError(path, f"not a readable weights file ({type(error).__name__})", REINSTALL) from None
    broken = [name for name, value in state.items() if not torch.isfinite(value).all()]
    if broken:
        raise InputError(path, f"{broken[0]} holds numbers that are not finite", REINSTALL)
    return {name: value.float() if value.is_floating_point() else value for name, value in state.items()}, facts


@dataclass(frozen=True)
class WeightsFile(Generic[S, M]):
    """Storage of the networks of one kind: a file for each shape, its shape among the facts.

    network : name of the kind among the facts; title : its name in messages, "pose network"
    build : an untrained network of a shape; it keeps the shape as its attribute `shape`
    read_shape : shape from its entry in the facts
    file_name : name of the file of a shape, without its suffix
    write_shape : entry of a shape in the facts
    """

    network: str
    title: str
    build: Callable[[S], M]
    read_shape: Callable[[dict[str, Any]], S]
    file_name: Callable[[S], str]
    write_shape: Callable[[S], dict[str, Any]] = lambda shape: asdict(cast(Any, shape))

    def path(self, shape: S, folder: Path | None = None) -> Path:
        """Path of the weights of a shape, in the package unless a folder is given."""
        return (folder or FOLDER) / f"{self.file_name(shape)}.safetensors"

    def save(self, path: Path, net: M, facts: Mapping[str, Any]) -> None:
        """Write a network; its shape is put among the facts."""
        shape = self.write_shape(cast(S, net.shape))
        save(path, net.state_dict(), {**facts, "network": self.network, "shape": shape})

    def read(self, path: Path) -> tuple[M, dict[str, Any]]:
        """A network, ready for inference, and its facts."""
        state, facts = read(path)
        try:
            net = self.build(self.read_shape(facts["shape"]))
            net.load_state_dict(state)
        except (AttributeError, LookupError, TypeError, ValueError, RuntimeError, ArithmeticError) as error:
            finding = f"not the weights of a {self.title} ({str(error).splitlines()[0]})"
            raise InputError(path, finding, REINSTALL) from None
        return net.eval().requires_grad_(False), facts

    def shipped(self, shape: S) -> M:
        """The shipped network of a shape, read once per process."""
        net: M = read_shipped(self, shape)
        return net


@functools.cache
def read_shipped(stored: WeightsFile[Any, Any], shape: Any) -> Any:
    """Read a shipped network for `WeightsFile.shipped`; failures are not cached."""
    path = stored.path(shape)
    net, _ = stored.read(path)
    if net.shape != shape:
        raise InputError(path, f"weights of a {stored.title} of another shape, {net.shape}", REINSTALL)
    return net
