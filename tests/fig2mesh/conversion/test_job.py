"""The main job from end to end on a drawn figure."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pygltflib
import pytest

from exporters.inspect import inspect
from exporters.tiles.tileset import VISIBLE_RANGE_PER_ERROR
from exporters.validate import validate
from fig2mesh.commands.main import main
from fig2mesh.measure.model import load_textured, shape_measures
from fig2mesh.mesh.preview import render_mesh
from tests.exporters.walk import property_texels
from tests.fig2mesh.conftest import OUTPUTS, ZURICH, Run


@pytest.mark.parametrize("name", OUTPUTS)
def test_outputs_are_valid(finished: Run, name: str) -> None:
    findings = [f for f in validate(finished.output(name)) if f.severity in ("error", "warning")]
    assert findings == []


@pytest.mark.parametrize("name", OUTPUTS)
def test_outputs_are_one_closed_solid(finished: Run, name: str) -> None:
    facts = inspect(finished.output(name))
    assert facts["watertight"]
    assert facts["components"] == 1
    assert facts["volume_m3"] > 0


def test_report_describes_the_model(finished: Run) -> None:
    measures = finished.report["measures"]
    assert measures["watertight"]
    assert measures["winding_consistent"]
    assert measures["components"] == measures["pieces_drawn"] == 1
    assert measures["silhouette_iou"] > 0.97
    assert measures["front_ssim"] > 0.9
    assert 0.3 < measures["observed"]["torso"] < 0.7
    stages = [stage["stage"] for stage in finished.report["stages"]]
    assert stages[:5] == ["place", "lift", "parts", "body", "cloud"]
    assert all(stage["seconds"] >= 0 and stage["peak_mb"] > 0 for stage in finished.report["stages"])
    assert finished.report["placement"]["heading_deg"] == 45.0
    levels = finished.report["lods"]
    assert levels[1]["triangles"] < levels[0]["triangles"] / 3
    assert 0 < levels[0]["mean_deviation_m"] < levels[1]["mean_deviation_m"] < 0.01


def test_model_stands_on_the_ground_at_the_height_asked_for(finished: Run) -> None:
    mesh = load_textured(finished.output("a.glb"))
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert low[1] == pytest.approx(0.0, abs=1e-6)
    # A hundredth of the height: the simplified outline may stop short of the drawn tip.
    assert high[1] == pytest.approx(2.5, abs=0.025)
    assert abs(low[0] + high[0]) < 0.1, "feet are symmetric, so the origin is in the middle"


def test_left_is_at_plus_x_and_front_at_plus_z(finished: Run) -> None:
    """The left hand wears a green glove: at +x, right in the front view, left in the back view."""
    mesh = load_textured(finished.output("a.glb"))

    def glove(yaw_deg: float) -> float:
        """Mean column of the green pixels, 0 left to 1 right."""
        view = render_mesh(mesh, yaw_deg=yaw_deg, size=(300, 300)).astype(int)
        green = (view[..., 1] > view[..., 0] + 60) & (view[..., 1] > view[..., 2] + 60) & (view[..., 3] > 200)
        return float(np.nonzero(green)[1].mean() / 300)

    assert glove(0) > 0.7
    assert glove(180) < 0.3
    assert 0.3 < glove(90) < 0.7, "from the figure's left the glove is in the middle"


def test_measures_on_the_written_file_agree_with_the_report(finished: Run) -> None:
    from_file = shape_measures(load_textured(finished.output("a.glb")))
    for key in ("watertight", "components", "genus", "triangles"):
        assert from_file[key] == finished.report["measures"][key]
    assert from_file["volume_m3"] == pytest.approx(finished.report["measures"]["volume_m3"], rel=1e-5)


def test_credit_and_place_are_kept(finished: Run) -> None:
    facts = inspect(finished.output("b/tileset.json"))
    assert facts["placement"]["lon_deg"] == pytest.approx(float(ZURICH[0]), abs=1e-9)
    assert facts["placement"]["heading_deg"] == pytest.approx(45.0, abs=1e-6)
    assert "Drawn by a test" in json.dumps(inspect(finished.output("a.glb")))


def test_evidence_is_shown_and_can_be_left_out(finished: Run, tmp_path: Path) -> None:
    shown = inspect(finished.output("a.glb"))
    assert set(shown["observed"]) == set(shown["parts"])
    assert all(0 <= share <= 1 for share in shown["observed"].values())
    assert 0.3 < shown["observed"]["torso"] < 0.7, "the front of it"
    assert property_texels(finished.output("a.glb")) == 0, "clients read such a texture once per vertex"
    assert all(property_texels(path) == 0 for path in finished.output("b").glob("*.glb"))
    target = tmp_path / "a.glb"
    arguments = [str(finished.files.image), "--keypoints", str(finished.files.keypoints), "-q", "-o", str(target)]
    assert main([*arguments, "--quality", "draft", "--parts", "outline", "--evidence", "none"]) == 0
    plain = inspect(target)
    assert plain["parts"] is None
    assert plain["observed"] is None


def test_without_textures_no_texture_network_runs(
    finished: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse() -> None:
        raise AssertionError("a texture network was requested")

    monkeypatch.setattr("fig2mesh.texture.unobserved.shipped", refuse)
    arguments = [str(finished.files.image), "--keypoints", str(finished.files.keypoints), "--quality", "draft", "-q"]
    for name, textures in (("wrap", "wrap"), ("none", "none")):
        report = tmp_path / f"{name}.json"
        made = ["--textures", textures, "-o", str(tmp_path / f"{name}.glb"), "--report", str(report)]
        assert main([*arguments, *made]) == 0
        assert validate(tmp_path / f"{name}.glb") == []
    stages = {stage["stage"]: stage for stage in json.loads(report.read_text())["stages"]}
    for stage in ("unwrap", "textures", "bake"):
        assert not stages[stage]["run"]
        assert stages[stage]["why"] == "no texture is requested"
    facts = inspect(tmp_path / "none.glb")
    assert facts["texture_px"] is None
    assert facts["solid"]


@pytest.mark.parametrize("effect", ["light", "none"])
def test_only_what_is_lit_has_normals(finished: Run, tmp_path: Path, effect: str) -> None:
    report, target = tmp_path / "r.json", tmp_path / "a.glb"
    arguments = [str(finished.files.image), "--keypoints", str(finished.files.keypoints), "--quality", "draft", "-q"]
    arguments += ["--textures", "none", "--effect", effect, "-o", str(target), "--report", str(report)]
    assert main(arguments) == 0
    assert validate(target) == []
    model = pygltflib.GLTF2().load(str(target))
    facts = json.loads(report.read_text())
    work = facts["counters"]
    lit = effect == "light"
    assert (model.meshes[0].primitives[0].attributes.NORMAL is not None) == lit
    assert ("KHR_materials_unlit" in (model.extensionsUsed or [])) != lit
    assert (work["shading normals"] > 0) == lit
    assert work["texture coordinate network"] == work["texture completion network"] == work["texels"] == 0
    assert work["pose network"] == 1
    assert work["part networks"] > 0 < work["field values"]
    assert {each["effect"]: each["run"] for each in facts["effects"]} == {"normals": lit, "light": lit}


def test_textures_are_counted(finished: Run) -> None:
    work = finished.report["counters"]
    assert work["texture coordinate network"] == work["texture completion network"] == 0
    assert work["texels"] > 10_000
    assert work["rays"] > 0


def digest(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.mark.slow
def test_same_input_and_seed_same_bytes(finished: Run, tmp_path: Path) -> None:
    for name in ("first", "second"):
        out = tmp_path / name
        out.mkdir()
        arguments = [str(finished.files.image), "--keypoints", str(finished.files.keypoints), "--lonlat", *ZURICH]
        arguments += [
            "-q",
            "-o",
            str(out / "a.glb"),
            "-o",
            str(out / "t"),
            "-o",
            str(out / "c.usdz"),
        ]
        assert main(arguments) == 0
    assert digest(tmp_path / "first") == digest(tmp_path / "second")


def test_resuming_gives_the_same_model(finished: Run, tmp_path: Path) -> None:
    arguments = [str(finished.files.image), "--keypoints", str(finished.files.keypoints), "--lonlat", *ZURICH]
    arguments += ["--facing", "NE", "--quality", "draft", "--lods", "2", "--height-m", "2.5"]
    arguments += ["--credit", "Drawn by a test"]
    arguments += ["--save-stages", str(finished.folder / "stages"), "--resume-from", "unwrap", "-q"]
    target = tmp_path / "a.glb"
    assert main([*arguments, "-o", str(target), "--report", str(tmp_path / "r.json")]) == 0
    assert target.read_bytes() == finished.output("a.glb").read_bytes()
    stages = json.loads((tmp_path / "r.json").read_text())["stages"]
    assert {stage["stage"] for stage in stages if not stage["run"]} == {
        "contour",
        "lift",
        "parts",
        "cloud",
        "solid",
        "simplify",
        "surface",
    }


@pytest.mark.parametrize("height", [1.79, 1800.0])
def test_a_figure_is_drawn_from_a_thousand_times_its_height(
    finished: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str], height: float
) -> None:
    arguments = [str(finished.files.image), "--keypoints", str(finished.files.keypoints), "--lonlat", *ZURICH]
    arguments += ["--height-m", str(height), "--quality", "draft", "--parts", "outline", "--textures", "none"]
    arguments += ["--mesher", "isosurface", "--triangles", "800", "-o", str(tmp_path / "b"), "--overwrite"]
    assert main(arguments) == 0
    assert "--visible-from" not in capsys.readouterr().err
    error = json.loads((tmp_path / "b" / "tileset.json").read_text())["geometricError"]
    assert 104 * error >= 1000 * height
    if height == 1.79:
        assert error == 2000.0 / VISIBLE_RANGE_PER_ERROR
    assert main([*arguments, "--visible-from", str(5 * height)]) == 0
    (line,) = [line for line in capsys.readouterr().err.splitlines() if "--visible-from" in line]
    assert f"a figure {height:g} m tall is not drawn" in line


def test_tiles_for_older_clients(finished: Run, tmp_path: Path) -> None:
    arguments = [str(finished.files.image), "--keypoints", str(finished.files.keypoints), "--lonlat", *ZURICH]
    arguments += ["--facing", "NE", "--quality", "draft", "--lods", "2", "--height-m", "2.5", "--tiles-version", "1.0"]
    arguments += ["--save-stages", str(finished.folder / "stages"), "--resume-from", "unwrap", "-q"]
    assert main([*arguments, "-o", str(tmp_path / "b")]) == 0
    assert sorted({path.suffix for path in (tmp_path / "b").iterdir()}) == [".b3dm", ".json"]
    assert [each for each in validate(tmp_path / "b", external=False) if each.severity != "info"] == []
    assert main(["validate", str(tmp_path / "b")]) == 0


@pytest.mark.parametrize("option", [("--mesher", "isosurface"), ("--closing", "fill")])
def test_other_ways_to_a_solid(finished: Run, tmp_path: Path, option: tuple[str, str]) -> None:
    target = tmp_path / "other.glb"
    arguments = [str(finished.files.image), "--keypoints", str(finished.files.keypoints), "--quality", "draft", "-q"]
    assert main([*arguments, *option, "-o", str(target)]) == 0
    facts = shape_measures(load_textured(target))
    assert facts["watertight"]
    assert facts["winding_consistent"]
    assert facts["components"] == 1


def test_default_output_is_named_after_the_figure(
    finished: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = [str(finished.files.image), "--keypoints", str(finished.files.keypoints), "--quality", "draft"]
    assert main([*arguments, "-q"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["drawn.glb"]
