"""Which required extensions can be passed over, because they do not change where surfaces are."""

from __future__ import annotations

from aobake.errors import InputError
from aobake.meshes.formats.gltf.document import Document

__all__ = ["check_required"]

# Read, and so honoured.
UNDERSTOOD = frozenset(
    {
        "KHR_draco_mesh_compression",
        "EXT_meshopt_compression",
        "KHR_meshopt_compression",
        "KHR_mesh_quantization",
        "KHR_node_visibility",
        "EXT_mesh_gpu_instancing",
        "KHR_texture_transform",
    }
)
# They say how surfaces look, move or are annotated, not where they are.
HARMLESS = frozenset(
    {
        "KHR_animation_pointer",
        "KHR_audio_emitter",
        "KHR_audio_graph",
        "KHR_gaussian_splatting",  # point primitives only
        "KHR_interactivity",
        "KHR_lights_punctual",
        "KHR_node_hoverability",
        "KHR_node_selectability",
        "KHR_physics_rigid_bodies",
        "KHR_techniques_webgl",
        "KHR_xmp",
        "KHR_xmp_json_ld",
        "EXT_feature_metadata",
        "EXT_instance_features",
        "EXT_lights_ies",
        "EXT_lights_image_based",
        "EXT_mesh_features",
        "EXT_mesh_manifold",
        "EXT_property_animation",
        "EXT_structural_metadata",
        "CESIUM_primitive_outline",
        "CESIUM_RTC",  # moves the whole scene
        "GODOT_single_root",
        "MSFT_audio_emitter",
        "MSFT_lod",  # coarser levels are nodes outside of the scene
        "MSFT_packing_normalRoughnessMetallic",
        "MSFT_packing_occlusionRoughnessMetallic",
        "NV_materials_mdl",
        "VRM",
        "OMI_audio_emitter",
        "OMI_physics_body",
        "OMI_physics_joint",
        "OMI_physics_shape",
        "OMI_seat",
        "OMI_spawn_point",
    }
)
HARMLESS_FAMILIES = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_materials_",
    "EXT_texture_",
    "MSFT_texture_",
    "ADOBE_materials_",
    "FB_materials_",
    "AGI_",
    "VRMC_",
    "MOZ_hubs_",
    "MPEG_media",
)


def check_required(document: Document) -> None:
    """Raise InputError for a required extension that may change the geometry and that is not understood."""
    for name in document.top.list_of("extensionsRequired"):
        if not isinstance(name, str):
            raise InputError(
                f"{document.path}: extensionsRequired holds what is no string. Export it again."
            )
        known = name in UNDERSTOOD or name in HARMLESS or name.startswith(HARMLESS_FAMILIES)
        if not known:
            raise InputError(
                f"{document.path}: it requires the extension {name[:60]!r}, which is not understood and may "
                "change the geometry. Export it without, or make it optional (extensionsUsed alone)."
            )
