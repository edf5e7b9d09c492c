"""Noise goes, motion stays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physique import rotations as rot
from physique.motion.clip import Motion
from physique.motion.filter import low_pass, repair_spikes, resample
from physique.motion.kinematics import joint_positions
from physique.motion.read import read_motion


def swing(frames: int, fps: float, hertz: float, degrees: float, joint: int = 16) -> Motion:
    """One joint that swings about x, as a sine; the root that swings along x with it."""
    t = np.arange(frames) / fps
    wave = np.sin(2 * np.pi * hertz * t)
    rotations = np.tile(rot.IDENTITY, (frames, 22, 1))
    rotations[:, joint] = rot.positive(rot.about("x", np.radians(degrees) * wave))
    root = np.stack([0.1 * wave, 0 * wave, 0 * wave + 1], axis=-1)
    contacts = np.zeros((frames, 2), dtype=bool)
    return Motion("swing", "test", fps, rotations, root, np.zeros((22, 3)), contacts)


def amplitude(motion: Motion) -> tuple[float, float]:
    middle = slice(motion.frames // 4, -motion.frames // 4)
    angle = rot.log(motion.rotations[middle, 16])[:, 0]
    return float(np.degrees(np.abs(angle).max())), float(np.abs(motion.root[middle, 0]).max())


def test_slow_motion_passes_and_fast_motion_does_not() -> None:
    slow = swing(480, 120.0, 1.0, 80.0)
    angle, root = amplitude(low_pass(slow, 8.0))
    assert angle == pytest.approx(80.0, rel=0.01)
    assert root == pytest.approx(0.1, rel=0.01)
    angle, root = amplitude(low_pass(swing(480, 120.0, 30.0, 10.0), 8.0))
    assert angle < 0.2
    assert root < 0.002


def test_no_phase_shift() -> None:
    slow = swing(480, 120.0, 2.0, 60.0)
    smooth = low_pass(slow, 8.0)
    off = rot.log(rot.multiply(rot.conjugate(slow.rotations), smooth.rotations))
    assert np.degrees(np.abs(off[100:-100]).max()) < 1.0


def test_the_sign_of_a_quaternion_does_not_matter() -> None:
    motion = read_motion("spinkick", low_pass=None)
    flipped = motion.rotations.copy()
    flipped[::2] *= -1
    plain, other = low_pass(motion, 8.0), low_pass(replace(motion, rotations=flipped), 8.0)
    np.testing.assert_allclose(plain.rotations, other.rotations, atol=1e-12)
    steps = np.sum(rot.continuous(flipped)[1:] * rot.continuous(flipped)[:-1], axis=-1)
    assert steps.min() > 0


@settings(max_examples=40, deadline=None)
@given(
    frames=st.integers(1, 40),
    fps=st.sampled_from([10.0, 16.0, 30.0, 120.0]),
    cutoff=st.sampled_from([0.5, 8.0, 50.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_short_and_wild_clips_stay_finite_and_unit(frames: int, fps: float, cutoff: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    motion = swing(frames, fps, 1.0, 10.0)
    wild = rot.normalize(rng.normal(size=motion.rotations.shape))
    for m in (motion, replace(motion, rotations=wild)):
        out = repair_spikes(low_pass(m, cutoff))
        assert out.rotations.shape == m.rotations.shape
        assert np.isfinite(out.root).all()
        np.testing.assert_allclose(np.linalg.norm(out.rotations, axis=-1), 1.0, atol=1e-9)


@pytest.mark.parametrize("length", [1, 2, 3])
def test_glitches_are_repaired(length: int) -> None:
    clean = swing(480, 120.0, 1.0, 40.0)
    rotations, root = clean.rotations.copy(), clean.root.copy()
    rotations[200 : 200 + length, 16] = rot.about("y", np.full(length, 1.0))
    root[300 : 300 + length, 2] += 0.3
    fixed = repair_spikes(replace(clean, rotations=rotations, root=root))
    off = rot.log(rot.multiply(rot.conjugate(clean.rotations), fixed.rotations))
    assert np.degrees(np.abs(off).max()) < 0.5
    assert np.abs(fixed.root - clean.root).max() < 0.005


@pytest.mark.parametrize("name", ["run", "backflip", "spinkick", "punch", "kick"])
def test_fast_movements_are_no_glitches(name: str) -> None:
    motion = read_motion(name, low_pass=None)
    np.testing.assert_array_equal(repair_spikes(motion).rotations, motion.rotations)


def test_resampling() -> None:
    motion = read_motion("kick")
    fine = resample(motion, 4 * motion.fps)
    assert fine.frames == 4 * (motion.frames - 1) + 1
    np.testing.assert_allclose(fine.rotations[::4], motion.rotations, atol=1e-9)
    np.testing.assert_allclose(fine.root[::4], motion.root, atol=1e-9)
    np.testing.assert_array_equal(fine.contacts[::4], motion.contacts)
    back = resample(fine, motion.fps)
    np.testing.assert_allclose(joint_positions(back), joint_positions(motion), atol=1e-9)
    odd = resample(motion, 100.0)
    assert odd.seconds <= motion.seconds < odd.seconds + 1 / 100.0 + 1e-9


def test_resampling_follows_the_curve() -> None:
    fine, coarse = swing(481, 240.0, 1.0, 60.0), swing(61, 30.0, 1.0, 60.0)
    again = resample(coarse, 240.0)
    assert again.frames == fine.frames
    assert np.abs(again.root - fine.root).max() < 2e-4
    off = rot.log(rot.multiply(rot.conjugate(fine.rotations), again.rotations))
    assert np.degrees(np.abs(off).max()) < 0.4
