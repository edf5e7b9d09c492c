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
    from physique.character.held import HeldGeom, held_geoms
    from physique.character.model import Character, make_character
    from physique.character.start import start_state
    from physique.character.strength import torque_limits
    from physique.commands.export import export_run
    from physique.commands.grow import grow_tree
    from physique.commands.push import PushReport, push
    from physique.commands.report import write_report
    from physique.commands.retarget import Progress, RetargetOptions, export_bvh, retarget
    from physique.commands.stabilize import stabilize
    from physique.errors import InputError
    from physique.feedback.policy import Policy, load_policy
    from physique.motion.clip import Motion
    from physique.motion.library import list_clips
    from physique.motion.read import read_motion
    from physique.reference.reference import Reference, make_reference
    from physique.reference.target import Weights
    from physique.runs.run import Run, load_run
    from physique.tracking.trajectory import Trajectory

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
    "RetargetOptions",
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
    "physique.commands.export": ("export_run",),
    "physique.feedback.policy": ("Policy", "load_policy"),
    "physique.motion.clip": ("Motion",),
    "physique.motion.library": ("list_clips",),
    "physique.motion.read": ("read_motion",),
    "physique.commands.retarget": ("Progress", "RetargetOptions", "export_bvh", "retarget"),
    "physique.commands.grow": ("grow_tree",),
    "physique.commands.push": ("PushReport", "push"),
    "physique.commands.stabilize": ("stabilize",),
    "physique.runs.run": ("Run", "load_run"),
    "physique.character.model": ("Character", "make_character"),
    "physique.character.strength": ("torque_limits",),
    "physique.character.held": ("HeldGeom", "held_geoms"),
    "physique.reference.target": ("Weights",),
    "physique.reference.reference": ("Reference", "make_reference"),
    "physique.character.start": ("start_state",),
    "physique.tracking.trajectory": ("Trajectory",),
    "physique.commands.report": ("write_report",),
}


def __getattr__(name: str) -> object:
    """Import the module that has `name` at its first use: MuJoCo and SciPy take a second."""
    for module, names in _HOME.items():
        if name in names:
            return getattr(import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
