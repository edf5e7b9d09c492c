"""Pictures of triangle meshes: bodies as they stand, without display or GPU."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from physique.body.mesh import BodyMesh
from physique.errors import InputError
from physique.render import palette
from physique.render.camera import Camera
from physique.render.picture import frame_camera, render
from physique.render.raycast import Array, Image, Layer, cast
from physique.render.surface import vertex_normals


def render_meshes(
    meshes: Sequence[tuple[ArrayLike, ArrayLike, ArrayLike]],
    camera: Camera,
    size: tuple[int, int] = (480, 480),
    *,
    floor: bool = True,
    sun: ArrayLike | None = None,
) -> Image:
    """Picture (h, w, 3) of meshes, each (vertices (V, 3) m, faces (F, 3), rgb (3,) in 0 to 1).

    Faces are counter-clockwise seen from outside; surfaces are drawn smooth. floor: draw z = 0.
    size: (width, height), pixels. sun: (3,), direction towards the light; left out, it shines from
    the camera's upper left. Raises InputError for a mesh that is none.
    """
    spec = mujoco.MjSpec()
    colours: list[Array] = []
    smooth: list[tuple[cKDTree, Array]] = []
    # The first geom is the floor, the rest are the meshes in order.
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 1.0],
        pos=[0.0, 0.0, 0.0 if floor else -1e3],
        contype=0,
        conaffinity=0,
    )
    for index, (vertices, faces, rgb) in enumerate(meshes):
        v, f = _checked(index, vertices, faces)
        used, f = _used(v, f)
        spec.add_mesh(
            name=f"mesh{index}",
            uservert=used.ravel(),
            userface=f.ravel(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
        )
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"mesh{index}", contype=0, conaffinity=0
        )
        smooth.append((cKDTree(used), vertex_normals(used, f)))
        colours.append(np.asarray(rgb, dtype=float))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)

    def normals(points: Array, geom: NDArray[np.int32], flat: Array) -> Array:
        out = flat.copy()
        for index, (tree, of_vertices) in enumerate(smooth):
            mine = np.flatnonzero(geom == index + 1)
            if len(mine):
                out[mine] = _blend(points[mine], flat[mine], tree, of_vertices)
        return out

    layer = Layer(model, data, np.stack([np.ones(3), *colours]), smooth=normals)
    return cast([layer], camera, size, None if sun is None else np.asarray(sun, dtype=float))


def body_picture(mesh: BodyMesh, model: mujoco.MjModel, *, height: int = 420) -> Image:
    """A person in the T-pose: surface and primitives from the front, then both from the left.

    model: of the same person (`simulation.character`), in its reference pose qpos0.
    height: of the picture, pixels. All four views have the same scale.
    """
    front, side = (height, height), (height // 2, height)
    q = model.qpos0[None]
    camera = frame_camera(model, q, front, azimuth=0.0, elevation=5.0)
    distance = float(np.linalg.norm(np.subtract(camera.eye, camera.target)))
    left = Camera.look_at(camera.target, distance=distance, azimuth=90.0, elevation=5.0, fov=camera.fov)
    skin = (mesh.vertices, mesh.faces, palette.rgb(palette.BODIES[0]))
    panels: list[Image] = []
    for view, size in ((camera, front), (left, side)):
        panels.append(render_meshes([skin], view, size))
        panels.append(render(model, model.qpos0, view, size))
    gap = np.full((height, 2, 3), 255, dtype=np.uint8)
    return np.concatenate([panels[0], *(x for p in panels[1:] for x in (gap, p))], axis=1)


def _checked(index: int, vertices: ArrayLike, faces: ArrayLike) -> tuple[Array, NDArray[np.int32]]:
    v, f = np.asarray(vertices, dtype=float), np.asarray(faces)
    place = f"mesh {index}"
    if v.ndim != 2 or v.shape[1] != 3 or len(v) < 4 or not np.isfinite(v).all():
        raise InputError(place, f"vertices {v.shape}", "(V, 3) finite numbers, V >= 4", "check the mesh")
    if f.ndim != 2 or f.shape[1] != 3 or len(f) == 0 or f.min() < 0 or f.max() >= len(v):
        raise InputError(place, f"faces {f.shape}", f"(F, 3) indices below {len(v)}", "check the mesh")
    return v, f.astype(np.int32)


def _used(v: Array, f: NDArray[np.int32]) -> tuple[Array, NDArray[np.int32]]:
    """Only the vertices that a face has: loose ones would stand in the way of smooth shading."""
    keep, inverse = np.unique(f, return_inverse=True)
    return v[keep], inverse.reshape(f.shape).astype(np.int32)


def _blend(points: Array, flat: Array, tree: cKDTree, normals: Array) -> Array:
    """Normals (n, 3) at points on the surface, blended from those of the nearest vertices.

    Vertices that face away from the flat normal (n, 3) belong to another sheet of the surface
    (the other lip, the other side of a thin part) or to a sharp edge, and have no say.
    """
    distance, nearest = tree.query(points, k=4)
    near = normals[nearest]
    agree = np.einsum("nki,ni->nk", near, flat) > 0.5
    weight = agree / (distance + 1e-5) ** 2
    blend = np.einsum("nk,nki->ni", weight, near)
    length = np.linalg.norm(blend, axis=1, keepdims=True)
    return np.where(length > 0, blend / np.maximum(length, 1e-30), flat)
