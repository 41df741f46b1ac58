"""Blender's Cycles: its bake of ambient occlusion to vertex colours or an image, on the processor."""

from __future__ import annotations

import bpy
import numpy as np
from exchange import Request, answer

SETTINGS = {
    "bake": "type AO, object.bake, margin 0; distance 1e6 units",
    "sampling": "samples as in the table, adaptive sampling off, pattern as it comes",
    "material": "diffuse, which is faster than the one that Blender starts with",
    "denoising": "Cycles denoises no bake of type AO: where the table says so, it is done afterwards",
    "device": "processor, as many threads as for all; tree as it comes, built within the clock",
    "defaults": "4,096 samples, adaptive sampling with a noise threshold of 0.01, margin 16",
}


def scene_of(request: Request) -> bpy.types.Object:
    """One object in an empty file, with the normals that all are given."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    arrays = request.arrays
    faces = arrays["faces"].astype(np.int32)
    mesh = bpy.data.meshes.new("mesh")
    mesh.vertices.add(len(arrays["vertices"]))
    mesh.vertices.foreach_set("co", arrays["vertices"].astype(np.float32).ravel())
    mesh.loops.add(3 * len(faces))
    mesh.loops.foreach_set("vertex_index", faces.ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(faces), 3, np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ones(len(faces), bool))
    mesh.update(calc_edges=True)
    mesh.normals_split_custom_set_from_vertices(arrays["normals"].tolist())
    thing = bpy.data.objects.new("mesh", mesh)
    bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    mesh.materials.append(plain_material())
    return thing


def plain_material() -> bpy.types.Material:
    """Diffuse: with the material that Blender starts with, the same bake takes half as long again."""
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    surface, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    material.node_tree.links.new(surface.outputs["BSDF"], output.inputs["Surface"])
    return material


def configure(request: Request) -> None:
    """Everything that is set; the rest is as Blender comes."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", request.threads
    scene.cycles.device, scene.cycles.seed = "CPU", request.seed
    scene.cycles.use_adaptive_sampling = request.adaptive
    scene.cycles.adaptive_threshold = 0.01
    scene.cycles.use_denoising = False
    scene.render.bake.margin = 0
    scene.world = bpy.data.worlds.new("world")
    scene.world.light_settings.distance = 1e6


def to_vertices(thing: bpy.types.Object):
    attribute = thing.data.color_attributes.new("ao", "FLOAT_COLOR", "POINT")
    thing.data.color_attributes.active_color = attribute
    bpy.context.scene.render.bake.target = "VERTEX_COLORS"
    values = np.empty(4 * len(thing.data.vertices), np.float32)

    def bake(samples: int) -> np.ndarray:
        bpy.context.scene.cycles.samples = samples
        bpy.ops.object.bake(type="AO")
        thing.data.color_attributes["ao"].data.foreach_get("color", values)
        return values[::4].copy()

    return bake


def to_image(request: Request, thing: bpy.types.Object):
    layer = thing.data.uv_layers.new(name="uv")
    layer.data.foreach_set("uv", request.arrays["uv"].astype(np.float32).ravel())
    image = bpy.data.images.new("ao", request.size, request.size, float_buffer=True, is_data=True)
    nodes = thing.data.materials[0].node_tree.nodes
    node = nodes.new("ShaderNodeTexImage")
    node.image = image
    nodes.active = node
    bpy.context.scene.render.bake.target = "IMAGE_TEXTURES"
    values = np.empty(4 * request.size**2, np.float32)

    def bake(samples: int) -> np.ndarray:
        bpy.context.scene.cycles.samples = samples
        bpy.ops.object.bake(type="AO")
        image.pixels.foreach_get(values)
        return values[::4].reshape(request.size, request.size)[::-1].copy()

    return bake


def prepare(request: Request):
    thing = scene_of(request)
    configure(request)
    return to_vertices(thing) if request.kind == "vertex" else to_image(request, thing)


if __name__ == "__main__":
    answer(f"Blender {bpy.app.version_string}", SETTINGS, prepare)
