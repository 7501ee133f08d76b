"""A map on the ground with figures on it, rendered by Blender; runs where `bpy` is, not where the project is.

stdin: {"map": {"image": path, "size_km": [w, h]}, "figures": [{"file": .usdc or .glb, "at_km": [x, y]}, ...],
        "picture": path, "size": [width, height], "samples": n}
x is east and y is north of the middle of the map; figures are in metres and Blender's unit is a kilometre here.
"""

import json
import math
import os
import sys

import bpy
from mathutils import Euler, Vector


def main() -> None:
    job = json.load(sys.stdin)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    lay(job["map"])
    for figure in job["figures"]:
        stand(figure)
    light()
    look(job)
    bpy.ops.render.render(write_still=True)


def lay(sheet: dict) -> None:
    width, height = sheet["size_km"]
    bpy.ops.mesh.primitive_plane_add(size=1)
    plane = bpy.context.object
    plane.scale = (width, height, 1)
    material = bpy.data.materials.new("map")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    image = nodes.new("ShaderNodeTexImage")
    image.image = bpy.data.images.load(sheet["image"])
    surface = nodes["Principled BSDF"]
    surface.inputs["Roughness"].default_value = 1.0
    surface.inputs["Specular IOR Level"].default_value = 0.0
    links.new(image.outputs["Color"], surface.inputs["Base Color"])
    plane.data.materials.append(material)
    # The table that it lies on.
    bpy.ops.mesh.primitive_plane_add(size=400, location=(0, 0, -0.05))
    table = bpy.data.materials.new("table")
    table.use_nodes = True
    table.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.20, 0.13, 0.08, 1)
    table.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.8
    bpy.context.object.data.materials.append(table)


def stand(figure: dict) -> None:
    before = set(bpy.data.objects)
    if figure["file"].endswith(".glb"):
        bpy.ops.import_scene.gltf(filepath=figure["file"])
    else:
        bpy.ops.wm.usd_import(filepath=figure["file"])
    new = [each for each in bpy.data.objects if each not in before]
    holder = bpy.data.objects.new("holder", None)
    bpy.context.scene.collection.objects.link(holder)
    for each in new:
        if each.parent is None:
            each.parent = holder
    holder.scale = (0.001, 0.001, 0.001)
    holder.location = (*figure["at_km"], 0.0)


def light() -> None:
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 2.3
    sun.data.angle = math.radians(3)
    sun.rotation_euler = Euler((math.radians(38), math.radians(-28), 0))
    bpy.context.scene.collection.objects.link(sun)
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (0.86, 0.92, 1.0, 1)
    world.node_tree.nodes["Background"].inputs[1].default_value = 0.42
    bpy.context.scene.world = world


def look(job: dict) -> None:
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.lens = 38
    camera.data.clip_end = 1000
    camera.location = (0, -48, 27)
    towards = Vector((0, -0.9, 0.9)) - camera.location
    camera.rotation_euler = towards.to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = job["samples"]
    scene.cycles.use_denoising = True
    scene.cycles.max_bounces = 2
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = job["size"]
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = job["picture"]


main()
sys.stdout.flush()
os._exit(0)  # bpy 4.2 may crash while Python tidies up
