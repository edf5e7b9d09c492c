"""Packages that may be missing, or torn: the line that says how to mend it."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError

import pytest

from physique import extras
from physique.errors import InputError
from physique.extras import check_mujoco, require, torn_mujoco

UNINSTALL = "pip uninstall -y mujoco mujoco-core mujoco-studio && pip install 'mujoco>=4,<5'"


def test_a_missing_package_names_its_extra() -> None:
    with pytest.raises(InputError, match=r"pip install 'physique\[video\]'"):
        require("no_such_package.part", "video")


def test_mujoco_4_is_right() -> None:
    check_mujoco()


def test_another_mujoco_is_refused_with_what_mends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "version", lambda name: "3.17.0")
    with pytest.raises(InputError) as fault:
        check_mujoco()
    assert "3.17.0" in str(fault.value)
    assert str(fault.value).endswith(UNINSTALL)


def test_no_mujoco_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(extras, "version", missing)
    with pytest.raises(InputError, match="pip install 'mujoco>=4,<5'"):
        check_mujoco()


# What `import mujoco` 4.0.0 says after `pip install -U mujoco` from 3.17, and of wheels of two versions.
TORN = (
    "The 'mujoco' package is installed, but its core bindings ('mujoco-core') are missing or corrupted",
    "Version mismatch between 'mujoco' (4.0.0) and 'mujoco-core' (4.1.0). Please upgrade all packages",
)


@pytest.mark.parametrize("text", TORN)
def test_a_torn_mujoco_is_known_by_its_import(text: str) -> None:
    found = torn_mujoco(ImportError(text))
    assert found is not None
    assert str(found).endswith(UNINSTALL)
    assert torn_mujoco(ModuleNotFoundError("No module named 'mujoco._specs'", name="mujoco._specs"))


@pytest.mark.parametrize("fault", [ImportError("no module named 'scipy'"), ValueError("mujoco")])
def test_other_faults_are_none_of_its(fault: Exception) -> None:
    assert torn_mujoco(fault) is None
