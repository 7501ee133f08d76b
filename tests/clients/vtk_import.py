"""Import of files into VTK, which F3D, ParaView and PyVista build on; runs in an environment of its own.

stdin:  {"files": [path, ...], "camera": as for the pages, "size": [width, height], "pictures": folder}
stdout: [{"messages": [...], "meshes": [{"matrix": column-major, "low": [...], "high": [...]}], "picture": path}, ...]
"""

import json
import sys
from pathlib import Path

import vtk


def main() -> None:
    job = json.load(sys.stdin)
    print(json.dumps([seen(Path(file), job, number) for number, file in enumerate(job["files"])]))


class Messages:
    """What VTK complains of."""

    def __init__(self) -> None:
        self.window = vtk.vtkStringOutputWindow()
        vtk.vtkOutputWindow.SetInstance(self.window)

    def found(self) -> list:
        return [
            line for line in self.window.GetOutput().splitlines() if "ERR" in line or "|" in line or "xtension" in line
        ]


def seen(path: Path, job: dict, number: int) -> dict:
    messages = Messages()
    window = vtk.vtkRenderWindow()
    window.OffScreenRenderingOn()
    window.SetSize(*job["size"])
    window.SetMultiSamples(4)
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    window.AddRenderer(renderer)
    if path.suffix in (".glb", ".gltf"):
        importer = vtk.vtkGLTFImporter()
        importer.SetFileName(str(path))
        importer.SetRenderWindow(window)
        importer.Update()
    else:
        actor(path, renderer)
    actors = [renderer.GetActors().GetItemAsObject(i) for i in range(renderer.GetActors().GetNumberOfItems())]
    meshes = []
    for each in actors:
        each.GetProperty().LightingOff()
        x0, x1, y0, y1, z0, z1 = each.GetMapper().GetInput().GetBounds()
        matrix = each.GetUserMatrix() or vtk.vtkMatrix4x4()
        columns = [matrix.GetElement(row, column) for column in range(4) for row in range(4)]
        meshes.append(
            {
                "matrix": columns,
                "low": [x0, y0, z0],
                "high": [x1, y1, z1],
                "triangles": each.GetMapper().GetInput().GetNumberOfPolys(),
            }
        )
    camera = vtk.vtkCamera()
    camera.SetPosition(*job["camera"]["eye"])
    camera.SetFocalPoint(*job["camera"]["target"])
    camera.SetViewUp(*job["camera"]["up"])
    camera.SetViewAngle(job["camera"]["fov_deg"])
    renderer.SetActiveCamera(camera)
    renderer.ResetCameraClippingRange()
    picture = Path(job["pictures"]) / f"vtk{number}.png"
    if meshes:
        window.Render()
        shot = vtk.vtkWindowToImageFilter()
        shot.SetInput(window)
        shot.ReadFrontBufferOff()
        writer = vtk.vtkPNGWriter()
        writer.SetFileName(str(picture))
        writer.SetInputConnection(shot.GetOutputPort())
        writer.Write()
    return {"messages": messages.found(), "meshes": meshes, "picture": str(picture)}


def actor(path: Path, renderer: vtk.vtkRenderer) -> None:
    reader = vtk.vtkPLYReader() if path.suffix == ".ply" else vtk.vtkOBJReader()
    reader.SetFileName(str(path))
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(reader.GetOutputPort())
    mapper.Update()
    item = vtk.vtkActor()
    item.SetMapper(mapper)
    if path.suffix == ".obj":
        image = vtk.vtkPNGReader()
        image.SetFileName(str(path.with_name(f"{path.stem}_texture.png")))
        texture = vtk.vtkTexture()
        texture.SetInputConnection(image.GetOutputPort())
        texture.InterpolateOn()
        item.SetTexture(texture)
    renderer.AddActor(item)


main()
