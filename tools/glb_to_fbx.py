"""Convert a GLB file of physique into FBX, through the Blender that you have.

    physique export out/walk --format glb --out walk.glb
    blender --background --python tools/glb_to_fbx.py -- walk.glb walk.fbx

Tried with Blender 5.0. Also works as `python tools/glb_to_fbx.py walk.glb walk.fbx` where the
package bpy is installed. Skins, skeletons and the motion of every frame go along; the file is in
metres, y up, as FBX readers expect it.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

FPS = 100  # of physique's simulations; Blender counts whole frames


def main(arguments: list[str]) -> int:
    """Convert, say what is wrong in one line, and return the exit code."""
    if len(arguments) != 2:
        print("glb_to_fbx: expected two files, IN.glb OUT.fbx", file=sys.stderr)
        return 2
    source, out = (Path(argument).resolve() for argument in arguments)
    if not source.is_file() or out.suffix.lower() != ".fbx" or not out.parent.is_dir():
        print(
            f"glb_to_fbx: expected an existing .glb and a .fbx to write; found {source}, {out}",
            file=sys.stderr,
        )
        return 2
    convert(source, out)
    print(out)
    return 0


def convert(source: Path, out: Path) -> None:
    """Read a GLB file and write it as FBX; whole, or not at all."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    # Before the import, which turns seconds into frames.
    scene.render.fps = FPS
    bpy.ops.import_scene.gltf(filepath=str(source))
    # What Blender draws bones with is an object too, which it marks in this way.
    for extra in [c for c in bpy.data.collections if c.name.startswith("glTF_not_exported")]:
        for shape in list(extra.objects):
            bpy.data.objects.remove(shape)
    ends = [action.frame_range[1] for action in bpy.data.actions]
    scene.frame_start, scene.frame_end = 0, round(max(ends, default=0))
    part = out.with_name(f".{out.stem}.part.fbx")
    try:
        bpy.ops.export_scene.fbx(
            filepath=str(part),
            object_types={"ARMATURE", "MESH", "EMPTY"},
            add_leaf_bones=False,
            bake_anim_use_nla_strips=False,
            bake_anim_use_all_actions=False,
            bake_anim_simplify_factor=0.0,
        )
        part.replace(out)
    finally:
        part.unlink(missing_ok=True)


if __name__ == "__main__":
    # Blender keeps what stands before the two dashes for itself.
    given = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    code = main(given)
    if code:
        sys.exit(code)
