"""Biovision hierarchy (BVH) motion files: joints, rest offsets and any frame.

Positions stay in the file's own units and axes; whoever reads a file turns them into the frame it needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fig2mesh.errors import FigureError
from fig2mesh.records import _Checked

_AXIS = {"X": 0, "Y": 1, "Z": 2}


@dataclass(frozen=True)
class Bvh(_Checked):
    """One motion file.

    names : (J,) joint names; an end site is called "<its joint>:end"
    parents : (J,) int32, parents come before their children, -1 for the root
    offsets : (J, 3) float32, file units, each joint from its parent at rest
    channels : for each joint the channel names in file order, such as "Xposition" or "Zrotation"
    motion : (F, C) float32, one row per frame, rotations in degrees
    frame_s : seconds between frames
    """

    names: tuple[str, ...]
    parents: NDArray[np.int32]
    offsets: NDArray[np.float32]
    channels: tuple[tuple[str, ...], ...]
    motion: NDArray[np.float32]
    frame_s: float

    def __post_init__(self) -> None:
        count = len(self.names)
        self._put("parents", np.int32, (count,))
        self._put("offsets", np.float32, (count, 3))
        self._put("motion", np.float32, (None, sum(len(c) for c in self.channels)))

    def poses(self, frames: NDArray[np.integer] | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(F, J, 3, 3) global rotations and (F, J, 3) joint positions, file axes, of the requested frames.

        Without `frames` it is the rest pose alone, F = 1: every channel at zero.
        """
        motion = np.zeros((1, self.motion.shape[1])) if frames is None else self.motion[frames].astype(np.float64)
        rotations = np.empty((len(motion), len(self.names), 3, 3))
        positions = np.empty((len(motion), len(self.names), 3))
        column = 0
        for joint, parent in enumerate(self.parents):
            local = np.broadcast_to(np.eye(3), (len(motion), 3, 3))
            shift = np.tile(self.offsets[joint].astype(np.float64), (len(motion), 1))
            for channel in self.channels[joint]:
                values, axis = motion[:, column], _AXIS[channel[0]]
                column += 1
                if channel.endswith("rotation"):
                    local = local @ _about(axis, np.radians(values))
                else:
                    shift[:, axis] += values
            if parent < 0:
                rotations[:, joint], positions[:, joint] = local, shift
            else:
                above = rotations[:, parent]
                rotations[:, joint] = above @ local
                positions[:, joint] = positions[:, parent] + np.einsum("fij,fj->fi", above, shift)
        return rotations, positions


def read_bvh(path: Path) -> Bvh:
    """Read one BVH file; raises `FigureError` for any other file."""
    words = path.read_text(errors="replace").split()
    try:
        return _parse(words)
    except (ValueError, IndexError, KeyError) as error:
        raise FigureError(path.name, f"not a complete BVH file ({error})", "export the motion again") from error


def _parse(words: list[str]) -> Bvh:
    if not words or words[0] != "HIERARCHY":
        raise ValueError("the first word is not HIERARCHY")
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[tuple[str, ...]] = []
    open_joints: list[int] = []
    at = 1
    while words[at] != "MOTION":
        word = words[at]
        if word in ("ROOT", "JOINT", "End"):
            parents.append(open_joints[-1] if open_joints else -1)
            names.append(words[at + 1] if word != "End" else f"{names[parents[-1]]}:end")
            offsets.append([0.0, 0.0, 0.0])
            channels.append(())
            at += 2
        elif word == "{":
            open_joints.append(len(names) - 1)
            at += 1
        elif word == "}":
            open_joints.pop()
            at += 1
        elif word == "OFFSET":
            offsets[open_joints[-1]] = [float(value) for value in words[at + 1 : at + 4]]
            at += 4
        elif word == "CHANNELS":
            count = int(words[at + 1])
            channels[open_joints[-1]] = tuple(words[at + 2 : at + 2 + count])
            at += 2 + count
        else:
            raise ValueError(f"unknown word {word!r}")
    if words[at + 1] != "Frames:" or words[at + 3 : at + 5] != ["Frame", "Time:"]:
        raise ValueError("MOTION is not followed by Frames and Frame Time")
    frames, width = int(words[at + 2]), sum(len(c) for c in channels)
    motion = np.array(words[at + 6 : at + 6 + frames * width], np.float32).reshape(frames, width)
    rest = np.array(offsets, np.float32)
    return Bvh(tuple(names), np.array(parents, np.int32), rest, tuple(channels), motion, float(words[at + 5]))


def _about(axis: int, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(F, 3, 3) rotations by `angles` (F,) radians about one coordinate axis."""
    result = np.zeros((len(angles), 3, 3))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    result[:, axis, axis] = 1
    result[:, u, u] = result[:, v, v] = np.cos(angles)
    result[:, v, u] = np.sin(angles)
    result[:, u, v] = -np.sin(angles)
    return result
