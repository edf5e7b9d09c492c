"""Physics-based motion retargeting onto real human body shapes."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from physique.body.bodyfile import load_body, save_body
    from physique.body.build import capsule_body
    from physique.body.fit import make_body
    from physique.body.held import Held, parse_held
    from physique.body.named import named_body
    from physique.errors import InputError
    from physique.exporting import export_run
    from physique.feedback.policy import Policy, load_policy
    from physique.motion.clip import Motion
    from physique.motion.library import list_clips
    from physique.motion.read import read_motion
    from physique.pipeline import Progress, export_bvh, retarget
    from physique.robustness import PushReport, grow_tree, push, stabilize
    from physique.run import Run, load_run
    from physique.simulation.character import Character, make_character
    from physique.simulation.held import HeldGeom, held_geoms
    from physique.simulation.start import start_state
    from physique.simulation.strength import torque_limits
    from physique.tracking.costs import Weights
    from physique.tracking.reference import Reference, make_reference
    from physique.tracking.trajectory import Trajectory
    from physique.view.report import write_report

__version__ = version("physique")

__all__ = [
    "Character",
    "Held",
    "HeldGeom",
    "InputError",
    "Motion",
    "Policy",
    "Progress",
    "PushReport",
    "Reference",
    "Run",
    "Trajectory",
    "Weights",
    "capsule_body",
    "export_bvh",
    "export_run",
    "grow_tree",
    "held_geoms",
    "list_clips",
    "load_body",
    "load_policy",
    "load_run",
    "make_body",
    "make_character",
    "make_reference",
    "named_body",
    "parse_held",
    "push",
    "read_motion",
    "retarget",
    "save_body",
    "stabilize",
    "start_state",
    "torque_limits",
    "write_report",
]

_HOME = {
    "physique.body.bodyfile": ("load_body", "save_body"),
    "physique.body.build": ("capsule_body",),
    "physique.body.fit": ("make_body",),
    "physique.body.held": ("Held", "parse_held"),
    "physique.body.named": ("named_body",),
    "physique.errors": ("InputError",),
    "physique.exporting": ("export_run",),
    "physique.feedback.policy": ("Policy", "load_policy"),
    "physique.motion.clip": ("Motion",),
    "physique.motion.library": ("list_clips",),
    "physique.motion.read": ("read_motion",),
    "physique.pipeline": ("Progress", "export_bvh", "retarget"),
    "physique.robustness": ("PushReport", "grow_tree", "push", "stabilize"),
    "physique.run": ("Run", "load_run"),
    "physique.simulation.character": ("Character", "make_character"),
    "physique.simulation.strength": ("torque_limits",),
    "physique.simulation.held": ("HeldGeom", "held_geoms"),
    "physique.tracking.costs": ("Weights",),
    "physique.tracking.reference": ("Reference", "make_reference"),
    "physique.simulation.start": ("start_state",),
    "physique.tracking.trajectory": ("Trajectory",),
    "physique.view.report": ("write_report",),
}


def __getattr__(name: str) -> object:
    """Import the module that has `name` at its first use: MuJoCo and SciPy take a second."""
    for module, names in _HOME.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
