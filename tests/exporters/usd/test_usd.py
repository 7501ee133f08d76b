"""USD: read back with pxr, judged by pxr.UsdValidation."""

from __future__ import annotations

import hashlib
import io
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade

from exporters.errors import ExportError
from exporters.inspect import inspect
from exporters.usd.stage import write_usd
from exporters.validate import validate
from georef.frames import ASSET, ENU
from georef.geodesy import nose_bearing_deg
from georef.placement import GeoPlacement
from georef.transform import Transform
from tests.exporters.analytic import ZURICH, asset, capsule
from tests.node import ROOT

SUFFIXES = [".usda", ".usdc", ".usdz"]


@pytest.fixture(params=SUFFIXES)
def stage(request: pytest.FixtureRequest, tmp_path: Path) -> Usd.Stage:
    path = tmp_path / f"farmer{request.param}"
    write_usd(asset(ZURICH), path)
    return Usd.Stage.Open(str(path))


def test_stage_has_units_axes_and_root(stage: Usd.Stage) -> None:
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert stage.GetDefaultPrim().GetPath() == "/Figure"


def test_mesh_comes_back_equal(stage: Usd.Stage) -> None:
    given = asset().mesh
    mesh = UsdGeom.Mesh.Get(stage, "/Figure/Mesh")
    points = np.array(mesh.GetPointsAttr().Get())
    faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    # Seams are undone, so compare corner by corner; float32 goes through to the bit.
    assert np.array_equal(points[faces], given.vertices[given.faces])
    assert len(points) == len(np.unique(given.solid_index))
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    assert np.array_equal(mesh.GetExtentAttr().Get(), [points.min(axis=0), points.max(axis=0)])
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert st.GetInterpolation() == "faceVarying"
    corners = np.array(st.ComputeFlattened()).reshape(-1, 3, 2)
    assert np.array_equal(corners[:, :, 0], given.uv[given.faces][:, :, 0])
    # v runs upwards; 1 - (1 - v) may lose the last bit of a float32.
    assert 1 - corners[:, :, 1] == pytest.approx(given.uv[given.faces][:, :, 1], abs=1e-7)
    normals = np.array(mesh.GetNormalsAttr().Get())
    assert normals[faces] == pytest.approx(given.normals[given.faces], abs=1e-6)


def test_texture_feeds_the_surface(stage: Usd.Stage) -> None:
    mesh = stage.GetPrimAtPath("/Figure/Mesh")
    material = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()[0]
    surface = material.ComputeSurfaceSource()[0]
    source, output, _ = surface.GetInput("diffuseColor").GetConnectedSource()
    image = UsdShade.Shader(source.GetPrim())
    assert (image.GetIdAttr().Get(), output) == ("UsdUVTexture", "rgb")
    assert image.GetInput("sourceColorSpace").Get() == "sRGB"
    resolved = image.GetInput("file").Get().resolvedPath
    if resolved.endswith("]"):  # inside a package
        archive, member = resolved[:-1].split("[")
        data = zipfile.ZipFile(archive).read(member)
    else:
        data = Path(resolved).read_bytes()
    with Image.open(io.BytesIO(data)) as pixels:
        assert np.array_equal(np.asarray(pixels), asset().mesh.texture.pixels)


def test_place_is_in_both_schemas(stage: Usd.Stage) -> None:
    figure, origin = stage.GetDefaultPrim(), stage.GetPrimAtPath("/CesiumGeoreference")
    expected = {"longitude": 8.5417, "latitude": 47.3769, "height": 455.34}
    assert origin.GetTypeName() == "CesiumGeoreferencePrim"
    assert {key: origin.GetAttribute(f"cesium:georeferenceOrigin:{key}").Get() for key in expected} == expected
    assert {key: figure.GetAttribute(f"cesium:anchor:{key}").Get() for key in expected} == expected
    assert figure.GetRelationship("cesium:anchor:georeferenceBinding").GetTargets() == [origin.GetPath()]
    position = figure.GetAttribute("omni:geospatial:wgs84:reference:referencePosition").Get()
    assert tuple(position) == (47.3769, 8.5417, 455.34)
    schemas = figure.GetPrimTypeInfo().GetAppliedAPISchemas()
    assert {"CesiumGlobeAnchorSchemaAPI", "OmniWGS84ReferencePositionAPI"} <= set(schemas)


@pytest.mark.parametrize("heading", [0.0, 90.0, 135.0, 180.0, 359.5])
def test_the_figure_is_turned_to_its_heading(tmp_path: Path, heading: float) -> None:
    write_usd(asset(GeoPlacement(8.5, 47.4, 400.0, heading_deg=heading)), tmp_path / "a.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    matrix = np.array(UsdGeom.Xformable(stage.GetDefaultPrim()).ComputeLocalToWorldTransform(0)).T
    enu_from_stage = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # x east, y up, z south
    # Angles of a float64 rotation, hence exact to some 1e-13 degrees.
    assert nose_bearing_deg(Transform(ENU, ASSET, enu_from_stage @ matrix)) == pytest.approx(heading, abs=1e-9)


def test_levels_of_detail_are_variants(stage: Usd.Stage) -> None:
    figure = stage.GetDefaultPrim()
    variants = figure.GetVariantSets().GetVariantSet("LOD")
    assert variants.GetVariantNames() == ["LOD0", "LOD1", "LOD2"]
    assert variants.GetVariantSelection() == "LOD0"  # what a viewer shows that knows no variants
    files = set()
    for name, given in zip(variants.GetVariantNames(), asset().lods, strict=True):
        variants.SetVariantSelection(name)
        mesh = UsdGeom.Mesh.Get(stage, "/Figure/Mesh")
        assert len(mesh.GetFaceVertexCountsAttr().Get()) == len(given.faces)
        # Bounds as viewers reckon them to frame the figure: from the extent of the selected level.
        bounds = UsdGeom.BBoxCache(0, ["default"]).ComputeUntransformedBound(figure).GetRange()
        assert np.array_equal(bounds.GetMin(), given.vertices.min(axis=0))
        assert np.array_equal(bounds.GetMax(), given.vertices.max(axis=0))
        material = UsdShade.MaterialBindingAPI(mesh.GetPrim()).ComputeBoundMaterial()[0]
        source, _, _ = material.ComputeSurfaceSource()[0].GetInput("diffuseColor").GetConnectedSource()
        files.add(UsdShade.Shader(source.GetPrim()).GetInput("file").Get().resolvedPath)
        subsets = UsdGeom.Subset.GetGeomSubsets(mesh, "face", "part")
        assert sum(len(subset.GetIndicesAttr().Get()) for subset in subsets) == len(given.faces)
    assert "" not in files
    assert len(files) == 3  # each level has a texture of its own


def test_one_level_needs_no_variants(tmp_path: Path) -> None:
    write_usd(asset(lods=(capsule(),)), tmp_path / "a.usda")
    assert "variant" not in (tmp_path / "a.usda").read_text()


def test_a_figure_can_be_referenced_into_another_stage(stage: Usd.Stage) -> None:
    city = Usd.Stage.CreateInMemory()
    farmer = city.DefinePrim("/City/Farmer")
    farmer.GetReferences().AddReference(stage.GetRootLayer().realPath)
    assert farmer.GetVariantSets().GetNames() == ["LOD"]
    farmer.GetVariantSets().SetSelection("LOD", "LOD1")
    mesh = UsdGeom.Mesh.Get(city, "/City/Farmer/Mesh")
    assert len(mesh.GetFaceVertexCountsAttr().Get()) == len(asset().lods[1].faces)
    assert UsdShade.MaterialBindingAPI(mesh.GetPrim()).ComputeBoundMaterial()[0]
    assert farmer.GetAttribute("cesium:anchor:longitude").Get() == 8.5417


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "mesh",
    [capsule(), capsule(parts=None), capsule(texture=None), capsule(texture=None, uv=None, observed=None)],
    ids=["all", "no parts", "no texture", "bare"],
)
def test_validators_are_clean(tmp_path: Path, suffix: str, mesh: object) -> None:
    for place in (ZURICH, None):
        write_usd(asset(place, lods=(mesh,)), tmp_path / f"a{suffix}")
        assert validate(tmp_path / f"a{suffix}") == []


def test_parts_are_subsets_that_cover_every_face(tmp_path: Path) -> None:
    write_usd(asset(), tmp_path / "a.usda")
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))  # prims die with it
    mesh = UsdGeom.Mesh.Get(stage, "/Figure/Mesh")
    subsets = UsdGeom.Subset.GetGeomSubsets(mesh, "face", "part")
    assert [subset.GetPrim().GetName() for subset in subsets] == ["torso", "head", "l_upper_leg"]
    assert sorted(index for subset in subsets for index in subset.GetIndicesAttr().Get()) == list(range(1472))


def test_creases_keep_their_normals(tmp_path: Path) -> None:
    given = capsule()
    flat = given.normals.copy()
    flat[given.vertices[:, 1] > 0.9] = (0, 1, 0)
    columns = given.uv[:, 0] == 1  # the second copy of each seam vertex
    flat[columns] = (1, 0, 0)
    write_usd(asset(lods=(capsule(normals=flat),)), tmp_path / "a.usda")
    stage = Usd.Stage.Open(str(tmp_path / "a.usda"))  # prims die with it
    mesh = UsdGeom.Mesh.Get(stage, "/Figure/Mesh")
    assert mesh.GetNormalsInterpolation() == "faceVarying"
    assert np.array_equal(np.array(mesh.GetNormalsAttr().Get()), flat[given.faces.reshape(-1)])


def test_package_is_stored_aligned_and_undated(tmp_path: Path) -> None:
    path = tmp_path / "a.usdz"
    write_usd(asset(), path)
    data = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        assert archive.namelist() == ["figure.usdc", *(f"figure{lod}_texture.png" for lod in ("", "_lod1", "_lod2"))]
        for member in archive.infolist():
            header = data[member.header_offset : member.header_offset + 30]
            start = (
                member.header_offset
                + 30
                + int.from_bytes(header[26:28], "little")
                + int.from_bytes(header[28:], "little")
            )
            assert start % 64 == 0
            assert member.compress_type == zipfile.ZIP_STORED
            assert member.date_time == (1980, 1, 1, 0, 0, 0)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_same_bytes_in_another_process(tmp_path: Path, suffix: str) -> None:
    # Hash seeds and thread timing differ between processes, not within one.
    path = tmp_path / f"a{suffix}"
    write_usd(asset(ZURICH), path)
    here = path.read_bytes()
    code = (
        "import sys; from exporters.usd.stage import write_usd; from tests.exporters.analytic import *;"
        "write_usd(asset(ZURICH), sys.argv[1])"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=True, cwd=ROOT)
    assert hashlib.sha256(path.read_bytes()).digest() == hashlib.sha256(here).digest()


def test_writing_twice_shows_the_second_version(tmp_path: Path) -> None:
    path = tmp_path / "a.usda"
    write_usd(asset(), path)
    held = Usd.Stage.Open(str(path))  # as a viewer in the same process would hold it
    assert UsdGeom.Mesh.Get(held, "/Figure/Mesh")
    write_usd(asset(lods=(capsule(8, 2),)), path)
    assert validate(path) == []
    assert inspect(path)["vertices"] == len(np.unique(capsule(8, 2).solid_index))


def test_a_file_that_crashes_its_reader_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_usd(asset(), tmp_path / "a.usda")
    dying = tmp_path / "python"
    dying.write_text("#!/bin/sh\nkill -ABRT $$\n")
    dying.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(dying))
    (finding,) = validate(tmp_path / "a.usda")
    assert (finding.code, finding.message) == ("UNREADABLE", "USD crashes on it (SIGABRT)")
    with pytest.raises(ExportError, match=r"USD crashes on it \(SIGABRT\)"):
        inspect(tmp_path / "a.usda")


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"\.usda, \.usdc or \.usdz"):
        write_usd(asset(), tmp_path / "a.usd")
