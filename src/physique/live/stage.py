"""The bodies in the page's 3-D scene: skins or shapes, their ghosts, arrows of force."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from physique import rotations
from physique.character.held import HeldGeom
from physique.live.bones import send_bones
from physique.render import palette
from physique.render.surface import Surface, capsule_surface, held_mesh, skin_surface
from physique.runs.run import Run

Array = NDArray[np.float64]
Look = Literal["skin", "capsules"]

LANE = 1.5  # m between bodies, and half as much to a ghost that stands beside
PUSH_COLOUR, FLOOR_COLOUR = (220, 40, 40), (60, 160, 60)
ARROW_LENGTH = 1.0  # m for a force of the body's weight


class Figure:
    """One surface that follows the joints: only 22 bones and the root are sent for a frame."""

    def __init__(
        self, scene: Any, name: str, surface: Surface, colour: str, opacity: float | None = None
    ) -> None:
        self.node = scene.add_mesh_skinned(
            name,
            surface.vertices - surface.joints[0],
            surface.faces,
            bone_wxyzs=np.tile(rotations.IDENTITY, (len(surface.joints), 1)),
            bone_positions=surface.joints - surface.joints[0],
            skin_weights=surface.weights,
            color=palette.rgb_bytes(colour),
            opacity=opacity,
            visible=False,
            cast_shadow=opacity is None,
        )

    def show(self, poses: Array | None) -> None:
        """Take poses (22, 7) of the joints: position (m), orientation; None hides the figure."""
        if poses is None:
            self.node.visible = False
            return
        # The bones stand relative to the pelvis, so that the browser's bounding volume, which it
        # makes once, goes with the body.
        self.node.position = poses[0, :3]
        send_bones(self.node, poses[:, :3] - poses[0, :3], poses[:, 3:])
        self.node.visible = True


class Prop:
    """What a hand holds: a rigid mesh that one joint carries."""

    def __init__(
        self, scene: Any, name: str, geom: HeldGeom, colour: str, opacity: float | None = None
    ) -> None:
        self._joint = geom.joint
        self.node = scene.add_mesh_simple(
            name,
            *held_mesh(geom),
            color=palette.rgb_bytes(colour),
            opacity=opacity,
            visible=False,
            cast_shadow=opacity is None,
        )

    def show(self, poses: Array | None) -> None:
        """Go with the joint in poses (22, 7): position (m), orientation; None hides it."""
        if poses is not None:
            self.node.position, self.node.wxyz = poses[self._joint, :3], poses[self._joint, 3:]
        self.node.visible = poses is not None


class Arrow:
    """An arrow at a place. The browser moves it at once, but takes a while to change its shape."""

    def __init__(self, scene: Any, name: str, colour: tuple[int, int, int], radius: float) -> None:
        # Hardly to be seen, for a browser that shows the arrow before it has the first shape.
        self._points = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, 1e-3]]], dtype=np.float32)
        self.node = scene.add_arrows(
            name,
            self._points,
            colour,
            shaft_radius=radius,
            head_radius=2.4 * radius,
            head_length=5.6 * radius,
            visible=False,
        )

    def show(self, place: Array, tail: Array, tip: Array) -> None:
        """Show it at a place (3,), m, from tail (3,) to tip (3,), both relative to the place."""
        points = np.stack([tail, tip])[None].astype(np.float32)
        if not np.array_equal(points, self._points):
            self.node.points = self._points = points
        self.node.position = place
        self.node.visible = True

    def hide(self) -> None:
        """Show it no more."""
        self.node.visible = False


class Lane:
    """A run's place on the stage: the body, its ghost, and arrows; all in the run's own world.

    offset: (3,) m, from the run's world to the stage's.
    """

    def __init__(self, scene: Any, run: Run, index: int, many: int) -> None:
        start = run.trajectory.q[0, :2]
        # The first body stands leftmost as seen from in front of it.
        across = LANE * (index - 0.5 * (many - 1))
        self.offset = np.array([-start[0], across - start[1], 0.0])
        self._root = scene.add_frame(f"/stage/{index}", show_axes=False, position=self.offset)
        self._beside = scene.add_frame(f"/stage/{index}/ghost", show_axes=False)
        self.looks: tuple[Look, ...] = ("skin", "capsules") if run.mesh else ("capsules",)
        surfaces = {
            look: capsule_surface(run.body)
            if look == "capsules" or run.mesh is None
            else skin_surface(run.mesh)
            for look in self.looks
        }
        self._bodies = {
            look: Figure(scene, f"/stage/{index}/{look}", surface, palette.body(index))
            for look, surface in surfaces.items()
        }
        self._ghosts = {
            look: Figure(
                scene, f"/stage/{index}/ghost/{look}", surface, palette.SOURCE, palette.SOURCE_OPACITY
            )
            for look, surface in surfaces.items()
        }
        held = run.held()
        self._props = [
            Prop(scene, f"/stage/{index}/{geom.name}", geom, palette.of_rgb(geom.rgb)) for geom in held
        ]
        self._ghost_props = [
            Prop(scene, f"/stage/{index}/ghost/{geom.name}", geom, palette.SOURCE, palette.SOURCE_OPACITY)
            for geom in held
        ]
        self._push = Arrow(scene, f"/stage/{index}/push", PUSH_COLOUR, 0.025)
        self._floor = [
            Arrow(scene, f"/stage/{index}/{side}_floor", FLOOR_COLOUR, 0.012) for side in ("left", "right")
        ]
        self._label = scene.add_label(f"/stage/{index}/label", run.name)
        self._weight = 9.81 * run.body.mass
        self._height = run.body.height

    @property
    def targets(self) -> list[Any]:
        """The scene nodes that people click on to push the body."""
        bodies = [figure.node for figure in self._bodies.values()]
        return bodies + [prop.node for prop in self._props]

    def show(self, poses: Array, ghost: Array | None, look: Look, beside: bool) -> None:
        """Show the body in poses (22, 7) and its ghost in others, or none."""
        look = look if look in self.looks else self.looks[-1]
        for name, figure in self._bodies.items():
            figure.show(poses if name == look else None)
        for name, figure in self._ghosts.items():
            figure.show(ghost if name == look else None)
        for prop in self._props:
            prop.show(poses)
        for prop in self._ghost_props:
            prop.show(ghost)
        self._beside.position = (0.0, -0.5 * LANE if beside else 0.0, 0.0)
        self._label.position = (poses[0, 0], poses[0, 1], self._height + 0.25)

    def show_push(self, point: Array | None, impulse: Array | None) -> None:
        """Show an arrow that ends at point (3,), along impulse (3,) Ns; None hides it."""
        if point is None or impulse is None:
            self._push.hide()
            return
        size = float(np.linalg.norm(impulse))
        way = impulse / max(size, 1e-9) * (0.35 + 0.006 * min(size, 150.0))
        self._push.show(point, -way, np.zeros(3))

    def show_floor(self, floor: Array | None, pressure: Array | None) -> None:
        """Show forces floor (2, 3) N at points pressure (2, 2) m; None hides them."""
        for side, arrow in enumerate(self._floor):
            if floor is None or pressure is None or not np.isfinite(pressure[side]).all():
                arrow.hide()
                continue
            foot = np.array([*pressure[side], 0.0])
            arrow.show(foot, np.zeros(3), ARROW_LENGTH * floor[side] / self._weight)


class Stage:
    """All lanes on one floor. The stage moves under the camera where the camera is to follow."""

    def __init__(self, server: Any, runs: list[Run]) -> None:
        scene = server.scene
        # The default lights do; an environment map costs graphics without a GPU most of their time.
        scene.configure_environment_map(None)
        scene.add_light_hemisphere(
            "/sky", sky_color=(255, 255, 255), ground_color=(190, 180, 170), intensity=1.6
        )
        self._scene = scene
        self._frame = scene.add_frame("/stage", show_axes=False)
        scene.add_grid(
            "/stage/floor",
            infinite_grid=True,
            fade_distance=25.0,
            cell_size=0.5,
            section_size=1.0,
            plane_color=(250, 250, 250),
            plane_opacity=1.0,
            shadow_opacity=0.2,
        )
        self.lanes = [Lane(scene, run, i, len(runs)) for i, run in enumerate(runs)]
        width = LANE * (len(runs) - 1)
        camera = server.initial_camera
        camera.position = (2.4 + 0.6 * width, 1.5 + 0.3 * width, 1.5)
        camera.look_at = (0.0, 0.0, 0.9)
        self._shift = np.zeros(3)

    def shade(self, shadows: bool) -> None:
        """Switch shadows."""
        self._scene.configure_default_lights(cast_shadow=shadows)

    def follow(self, roots: list[Array] | None, ease: float = 1.0) -> None:
        """Bring the middle of the roots (3,), each in its lane's world, over the origin.

        ease: the share of the way that is gone at once. None brings the stage back.
        """
        wanted = np.zeros(3)
        if roots is not None:
            places = [lane.offset[:2] + root[:2] for lane, root in zip(self.lanes, roots)]
            wanted[:2] = -np.mean(places, axis=0)
        self._shift = self._shift + ease * (wanted - self._shift)
        self._frame.position = self._shift

    def to_lane(self, lane: Lane, point: Array) -> Array:
        """A point (3,) of the page's world in the world of a lane's run."""
        return point - self._shift - lane.offset

    def to_page(self, lane: Lane, point: Array) -> Array:
        """A point (3,) of the world of a lane's run in the page's world."""
        return point + self._shift + lane.offset

    def on_push(
        self,
        click: Callable[[int, Array, Array], None],
        grab: Callable[[int, Array, Array], None],
        release: Callable[[int, Array], None],
    ) -> None:
        """Hand on what people do to bodies, all in the page's world.

        click(lane, origin, direction): a ray. grab(lane, origin, direction): a drag begins there;
        release(lane, way): it ends; `way` (3,) m is what the pointer went, across the view.
        """
        for index, lane in enumerate(self.lanes):
            for node in lane.targets:
                self._listen(node, index, click, grab, release)

    @staticmethod
    def _listen(
        node: Any,
        index: int,
        click: Callable[[int, Array, Array], None],
        grab: Callable[[int, Array, Array], None],
        release: Callable[[int, Array], None],
    ) -> None:
        # Coroutines run in the order of the events; plain functions would run on threads.
        async def clicked(event: Any) -> None:
            click(index, np.array(event.ray_origin), np.array(event.ray_direction))

        async def dragged(event: Any) -> None:
            if event.phase == "start":
                eye = np.array(event.client.camera.position)
                grab(index, eye, np.array(event.start_position) - eye)
            elif event.phase == "end":
                release(index, np.array(event.end_position) - np.array(event.start_position))

        node.on_click(clicked)
        node.on_drag("left")(dragged)
