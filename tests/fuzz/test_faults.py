"""A bug in a reader is an internal error: it must not be reported as a damaged file."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from fig2mesh.commands.main import main
from georef.errors import InputError
from tests.fuzz import seeds
from tests.fuzz.readers import READERS
from tests.fuzz.seeds import Input


@dataclass(frozen=True)
class Planted:
    """A function, by module and name, that fails while a reader of `READERS` reads its intact input."""

    reader: str
    target: str
    suffix: str = ""


PLANTED = (
    Planted("glb", "exporters.gltf.reader._dtype"),
    Planted("glb", "exporters.gltf.reader._triangles"),
    Planted("glb", "exporters.gltf.reader.local_matrix"),
    Planted("glb", "exporters.gltf.reader.check_shape"),
    Planted("glb", "exporters.gltf.check.check_solid"),
    Planted("glb", "exporters.figure_reader.placement_of_record"),
    Planted("gltf", "exporters.gltf.reader._resource"),
    Planted("gltf", "exporters.gltf.inspect.solid_facts"),
    Planted("tileset", "exporters.tiles.check.volume_problem"),
    Planted("tileset", "exporters.tiles.check.read_transform"),
    Planted("tileset", "exporters.tiles.check_content.tile_from_asset"),
    Planted("b3dm", "exporters.tiles.check_content._check_batches"),
    Planted("entities", "exporters.gis.check._same_place"),
    Planted("entities", "exporters.gis.check._range"),
    Planted("triangles", "exporters.triangles.check.merged_by_position"),
    Planted("triangles", "exporters.triangles.files.references_of", ".obj"),
    Planted("model", "fig2mesh.render.model._gltf_labels", ".glb"),
    Planted("globe", "fig2mesh.globe.assets._needed"),
    Planted("stage", "fig2mesh.conversion.record_file._unpack"),
    Planted("stage", "fig2mesh.conversion.record_file.fits"),
    Planted("joints", "fig2mesh.parse.joint_formats._figure"),
    Planted("picture", "fig2mesh.parse.picture._rgba"),
    Planted("picture", "fig2mesh.parse.picture.check_scans"),
    Planted("points", "georef.sheets.points_file.make_controls"),
    Planted("annotation", "georef.sheets.annotation._row"),
    Planted("world-file", "georef.sheets.find.read_world_file"),
    Planted("geotiff", "georef.sheets.pictures._geo_keys"),
    Planted("heights", "georef.heights.check_grid"),
)


@pytest.fixture(scope="module")
def intact() -> dict[str, list[Input]]:
    """Seeds, made once."""
    return {}


@pytest.mark.parametrize("kind", [TypeError, AttributeError, NameError])
@pytest.mark.parametrize("planted", PLANTED, ids=lambda planted: planted.target)
def test_a_mistake_in_a_reader_goes_through(
    planted: Planted,
    kind: type[Exception],
    intact: dict[str, list[Input]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reader = READERS[planted.reader]
    if planted.reader not in intact:
        intact[planted.reader] = list(reader.seeds())
    monkeypatch.setattr(planted.target, _failing(kind))
    raised = []
    for number, each in enumerate(intact[planted.reader]):
        if planted.suffix and not each.main.endswith(planted.suffix):
            continue
        room = tmp_path / str(number)
        room.mkdir()
        try:
            reader.read(each.put(room))
        except InputError as error:
            pytest.fail(f"reported as a fault of {each.main}: {error}")
        except kind as error:
            raised.append(str(error))
    assert set(raised) == {"planted"}


def _failing(kind: type[Exception]) -> Callable[..., object]:
    def fail(*_: object, **__: object) -> object:
        raise kind("planted")

    return fail


def test_the_command_line_calls_it_an_internal_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = next(iter(seeds.glbs())).put(tmp_path)
    monkeypatch.setattr("exporters.gltf.reader._triangles", _failing(TypeError))
    for command in ("inspect", "validate"):
        assert main([command, str(path)]) == 1
        assert "internal error: TypeError: planted" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["inspect", "validate"])
def test_the_process_that_reads_usd_hands_mistakes_on(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import exporters

    package = tmp_path / "code" / "exporters"
    shutil.copytree(Path(exporters.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("check.py", "inspect.py"):
        text = (package / "usd" / name).read_text()
        text = text.replace("(stage: Any, path: Path)", "(stage: Any, path: Path, fault: Any = None)")
        text = text.replace("    findings: list[Finding] = []\n", "    findings: list[Finding] = fault.nothing\n")
        text = text.replace("    facts = stage.GetRootLayer()", "    facts = fault.nothing or stage.GetRootLayer()")
        (package / "usd" / name).write_text(text)
    monkeypatch.chdir(package.parent)  # where the process looks for modules first
    path = next(iter(seeds.stages())).put(tmp_path)
    assert main([command, str(path)]) == 1
    assert "has no attribute 'nothing'" in capsys.readouterr().err
