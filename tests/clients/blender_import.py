"""Import of a file into Blender; runs in the environment of `bpy`, not of the project.

stdin:  {"file": path, "picture": path of a PNG or null, "size": [width, height]}
stdout: after Blender's own output, one line of JSON: the imported meshes, their materials, parts and properties

The picture is an orthographic front view as in Blender: from -y along +y, z up, with the bounding box of the meshes
filling the height; rendered by Cycles on the CPU, in uniform light.
https://docs.blender.org/manual/en/4.2/addons/import_export/scene_gltf2.html
https://docs.blender.org/manual/en/4.2/files/import_export/usd.html
"""

import json
import os
import sys
from pathlib import Path

import bpy
from mathutils import Vector


def main() -> None:
    job = json.load(sys.stdin)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    path = job["file"]
    if Path(path).suffix in (".glb", ".gltf"):
        bpy.ops.import_scene.gltf(filepath=path)
    else:
        bpy.ops.wm.usd_import(filepath=path)
    meshes = [each for each in bpy.context.scene.objects if each.type == "MESH"]
    bpy.context.view_layer.update()
    corners = [each.matrix_world @ vertex.co for each in meshes for vertex in each.data.vertices]
    low, high = ([pick(corner[axis] for corner in corners) for axis in range(3)] for pick in (min, max))
    if job.get("picture"):
        render(Path(job["picture"]), job["size"], low, high)
    found = {
        "version": bpy.app.version_string,
        "low": low,
        "high": high,
        "objects": {each.name: plain(each) for each in bpy.context.scene.objects},
        "scene": plain(bpy.context.scene),
        "meshes": [facts(each) for each in meshes],
    }
    print("\n" + json.dumps(found))


def facts(item: bpy.types.Object) -> dict:
    mesh = item.data
    materials = [slot.material for slot in item.material_slots]
    return {
        "name": item.name,
        "vertices": len(mesh.vertices),
        "faces": len(mesh.polygons),
        "uv": [layer.name for layer in mesh.uv_layers],
        "attributes": [each.name for each in mesh.attributes],
        "properties": plain(mesh),
        "parent": item.parent.name if item.parent else None,
        "materials": [material.name if material else None for material in materials],
        "culled": [material.use_backface_culling for material in materials if material],
        "textures": [list(size) for material in materials if material for size in images(material)],
        "faces_of_materials": [sum(face.material_index == i for face in mesh.polygons) for i in range(len(materials))],
    }


def images(material: bpy.types.Material) -> list:
    nodes = material.node_tree.nodes if material.use_nodes else ()
    return [tuple(node.image.size) for node in nodes if node.type == "TEX_IMAGE" and node.image is not None]


def plain(item: bpy.types.ID) -> dict:
    """Convert custom properties to JSON types."""
    found = {}
    for key in item.keys():  # noqa: SIM118 - this is not a dict
        value = item[key]
        found[key] = (
            value.to_dict() if hasattr(value, "to_dict") else value.to_list() if hasattr(value, "to_list") else value
        )
    return {key: value for key, value in found.items() if isinstance(value, str | int | float | list | dict)}


def render(path: Path, size: list, low: list, high: list) -> None:
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    camera.data.type = "ORTHO"
    # The longer side of the picture.
    camera.data.ortho_scale = (high[2] - low[2]) * max(1.0, size[0] / size[1])
    middle = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
    camera.location = Vector((middle[0], low[1] - 10 * (high[2] - low[2]), middle[2]))
    camera.rotation_euler = (1.5707963267948966, 0, 0)
    camera.data.clip_end = 100 * (high[2] - low[2])
    scene.camera = camera
    world = bpy.data.worlds.new("light")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (1, 1, 1, 1)
    scene.world = world
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 16
    scene.cycles.use_denoising = False
    scene.cycles.max_bounces = 0
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


main()
sys.stdout.flush()
os._exit(0)  # bpy 4.2 may crash at exit
