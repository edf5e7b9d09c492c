"""The 22 joints form one tree, in an order that walks can rely on, and mirror onto themselves."""

from __future__ import annotations

from physique.skeleton import INDEX, JOINTS, MIRROR, PARENTS


def test_joints_are_smpls() -> None:
    # The first 22 of the 24 joints of the SMPL model: files index their arrays by this order.
    assert JOINTS == (
        "pelvis",
        "left_hip",
        "right_hip",
        "spine1",
        "left_knee",
        "right_knee",
        "spine2",
        "left_ankle",
        "right_ankle",
        "spine3",
        "left_foot",
        "right_foot",
        "neck",
        "left_collar",
        "right_collar",
        "head",
        "left_shoulder",
        "right_shoulder",
        "left_elbow",
        "right_elbow",
        "left_wrist",
        "right_wrist",
    )
    assert [INDEX[name] for name in JOINTS] == list(range(22))


def test_parents_come_first() -> None:
    assert len(PARENTS) == len(JOINTS)
    assert PARENTS[0] == -1
    assert all(0 <= parent < joint for joint, parent in enumerate(PARENTS[1:], start=1))


def test_chains() -> None:
    def chain(name: str) -> list[str]:
        names = [name]
        while (parent := PARENTS[INDEX[names[-1]]]) >= 0:
            names.append(JOINTS[parent])
        return names[::-1]

    trunk = ["pelvis", "spine1", "spine2", "spine3"]
    assert chain("head") == [*trunk, "neck", "head"]
    for side in ("left", "right"):
        leg = ["hip", "knee", "ankle", "foot"]
        arm = ["collar", "shoulder", "elbow", "wrist"]
        assert chain(f"{side}_foot") == ["pelvis", *(f"{side}_{part}" for part in leg)]
        assert chain(f"{side}_wrist") == [*trunk, *(f"{side}_{part}" for part in arm)]


def test_mirror_swaps_sides_and_keeps_the_tree() -> None:
    for joint, name in enumerate(JOINTS):
        other = JOINTS[MIRROR[joint]]
        assert MIRROR[MIRROR[joint]] == joint
        if name.startswith(("left_", "right_")):
            assert {name.split("_")[0], other.split("_")[0]} == {"left", "right"}
            assert name.split("_")[1] == other.split("_")[1]
        else:
            assert other == name
        if joint:
            assert PARENTS[MIRROR[joint]] == MIRROR[PARENTS[joint]]
