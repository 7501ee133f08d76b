"""Initial weights of the figure parser from BlazePose: encoder and heat maps from a TFLite file.

The file is `pose_landmark_full.tflite` of the package `@mediapipe/pose` (Apache-2.0, Google). Needs `tflite`, which
reads the format's tables; the order of operators in the file is that of the layers here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from fig2mesh.errors import InputError
from fig2mesh.nets.figure_parser import Encoder, FigureParser, Side, Widened
from fig2mesh.skeleton import JOINT

REMEDY = "give pose_landmark_full.tflite of the package @mediapipe/pose 0.5"


# fmt: off
LANDMARKS: Final = {
    "head": (7, 8), "eyes": (2, 5), "neck": (9, 10, 11, 12), "thorax": (11, 12), "pelvis": (23, 24),
    **{f"{side}_{name}": (first + (side == "r"),) for side in "lr" for name, first in (
        ("shoulder", 11), ("elbow", 13), ("wrist", 15), ("hand", 19), ("hip", 23), ("knee", 25), ("ankle", 27),
        ("foot", 31))},
}
# fmt: on
"""Joint → BlazePose's landmarks whose mean it is: ears, eyes, mouth, and those of its own name."""


def start_from(net: FigureParser, path: Path) -> None:
    """Copy the encoder of BlazePose, and its heat maps for the joints, into a parser."""
    found = _convolutions(path)
    maps = [pair for pair in found if len(pair[0]) == 39]
    try:
        with torch.no_grad():
            (kernel, bias), *_ = maps
            for joint, landmarks in LANDMARKS.items():
                rows = list(landmarks)
                net.direct.weight[JOINT[joint], :, 0, 0] = torch.from_numpy(kernel[rows, 0, 0].mean(axis=0))
                net.direct.bias[JOINT[joint]] = float(bias[rows].mean())  # type: ignore[index]
            for conv, (kernel, bias) in zip(_ordered(net.encoder), found, strict=False):
                turned = kernel.transpose(3, 0, 1, 2) if conv.groups > 1 else kernel.transpose(0, 3, 1, 2)
                conv.weight.copy_(torch.from_numpy(np.ascontiguousarray(turned)))
                assert conv.bias is not None
                conv.bias.copy_(torch.from_numpy(bias))
    except (RuntimeError, ValueError) as error:
        raise InputError(path, f"not the layers expected ({str(error).splitlines()[0][:80]})", REMEDY) from None


def _ordered(encoder: Encoder) -> list[nn.Conv2d]:
    """The convolutions in the file's order: sides come in the middle of the block that follows their stage."""

    def block(widened: Widened, side: Side | None = None) -> list[nn.Conv2d]:
        between: list[nn.Conv2d] = [side.filter, side.mix] if side is not None else []
        return [widened.widen, *between, widened.filter, widened.narrow]

    stages = (encoder.stage64, encoder.stage32, encoder.stage16, encoder.stage8)
    # The side at 128 pixels a side is BlazePose's own and goes to its segmentation: skipped by `_convolutions`.
    out: list[nn.Conv2d] = [encoder.stem, encoder.stem_filter, encoder.stem_narrow]
    for stage, side in zip(stages, (None, encoder.side64, encoder.side32, encoder.side16), strict=True):
        for index, widened in enumerate(stage):
            assert isinstance(widened, Widened)
            out += block(widened, side if index == 0 else None)
    return [*out, encoder.last, encoder.last_filter, encoder.side8.filter, encoder.side8.mix]


def _convolutions(path: Path) -> list[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    """Kernel and bias of the convolutions in the file's order, without the two of the side at 128 pixels."""
    try:
        import tflite
    except ImportError:
        raise InputError("--blazepose", "tflite is not installed", "pip install 'fig2mesh[training]'") from None
    if not path.is_file():
        raise InputError(path, "no such file", REMEDY)
    model: Any = tflite.Model.GetRootAsModel(path.read_bytes(), 0)
    graph = model.Subgraphs(0)
    source: dict[int, int] = {}
    out = []
    for index in range(graph.OperatorsLength()):
        operator = graph.Operators(index)
        code = model.OperatorCodes(operator.OpcodeIndex())
        kind = max(code.BuiltinCode(), code.DeprecatedBuiltinCode())
        inputs = [int(value) for value in operator.InputsAsNumpy()]
        if kind == tflite.BuiltinOperator.DEQUANTIZE:
            source[int(operator.OutputsAsNumpy()[0])] = inputs[0]
        elif kind in (tflite.BuiltinOperator.CONV_2D, tflite.BuiltinOperator.DEPTHWISE_CONV_2D):
            out.append((_values(model, graph, source[inputs[1]]), _values(model, graph, source[inputs[2]])))
    return out[:4] + out[6:]


def _values(model: Any, graph: Any, tensor: int) -> NDArray[np.float32]:
    found = graph.Tensors(tensor)
    raw = model.Buffers(found.Buffer()).DataAsNumpy()
    return np.asarray(raw.view(np.float16).reshape(found.ShapeAsNumpy()), np.float32)
