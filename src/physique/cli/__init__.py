"""The command `physique`: each subcommand calls one stage of the library and shows its result.

The library is imported by the commands that need it, so that `--help` comes at once.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Protocol

from tyro.conf import FlagCreatePairsOff
from tyro.extras import subcommand_cli_from_dict

from physique.cli import console, feedback, make, show
from physique.errors import InputError, suggest
from physique.extras import check_mujoco, torn_mujoco


class Command(Protocol):
    """A subcommand with its options."""

    def run(self) -> None:
        """Do it, and show the result."""


COMMANDS: dict[str, Callable[..., Command]] = {
    "bodies": make.BodiesCommand,
    "clips": make.ClipsCommand,
    "body": make.BodyCommand,
    "retarget": make.RetargetCommand,
    "export": show.ExportCommand,
    "report": show.ReportCommand,
    "view": show.ViewCommand,
    "stabilize": feedback.StabilizeCommand,
    "grow": feedback.GrowCommand,
    "push": feedback.PushCommand,
    "demo": make.DemoCommand,
}


def parse(arguments: Sequence[str] | None = None) -> Command:
    """The subcommand that the arguments ask for, the help for none of them.

    Raises InputError for a fault in them, SystemExit after the help.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given in ([], ["help"]):
        given = ["--help"]
    place = f"physique {given[0]}" if given[0] in COMMANDS else "physique"
    _check_names(given, place)
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            made: Command = subcommand_cli_from_dict(
                COMMANDS,
                prog="physique",
                description="Make a body shape perform a motion-capture clip under physics. "
                "`physique --version` names the versions of physique and MuJoCo.",
                args=given,
                config=(FlagCreatePairsOff,),
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            raise
        raise _refusal(stop) or console.usage_error(said.getvalue(), place) from None
    console.tell(said.getvalue())
    return made


def _check_names(given: Sequence[str], place: str) -> None:
    """Raises InputError for a command or an option that is not there, with the nearest that is."""
    command = given[0]
    if command.startswith("-"):
        known = {"--help", "--version"}
        given = given[:1]
    elif command not in COMMANDS:
        remedy = suggest(command, COMMANDS, "see `physique --help`")
        raise InputError("command line", f"no command {command!r}", "one of " + ", ".join(COMMANDS), remedy)
    else:
        fields = dataclasses.fields(COMMANDS[command])  # type: ignore[arg-type]
        known = {"--help"} | {"--" + field.name.strip("_").replace("_", "-") for field in fields}
    for word in given:
        name = word.partition("=")[0].replace("_", "-")
        if name.startswith("--") and name not in known:
            remedy = suggest(name, sorted(known), f"see `{place} --help`")
            raise InputError("command line", f"no option {name}", f"options of `{place}`", remedy)


def _refusal(stop: BaseException) -> InputError | None:
    """What a reader of an option's text raised, before the parser put a box about it."""
    fault: BaseException | None = stop
    while fault is not None and not isinstance(fault, InputError):
        fault = fault.__context__
    return fault


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line: exit code 0, 2 for bad input, 70 for a fault of physique's own, 130
    after Ctrl-C."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    console.set_up_logging()
    try:
        if given == ["--version"]:
            console.say(_versions())
            return
        command = parse(given)
        check_mujoco()
        command.run()
    except InputError as fault:
        console.fail(str(fault))
        sys.exit(2)
    except KeyboardInterrupt:
        console.fail("stopped; `retarget` and `grow` go on with the same options and --resume")
        sys.exit(130)
    except Exception as fault:
        if _interrupted(fault):  # Ctrl-C within an import
            console.fail("stopped")
            sys.exit(130)
        torn = torn_mujoco(fault)
        if torn is not None:
            console.fail(str(torn))
            sys.exit(2)
        console.fail_unforeseen(fault, given, _versions())
        sys.exit(70)


def _interrupted(fault: BaseException | None) -> bool:
    while fault is not None and not isinstance(fault, KeyboardInterrupt):
        fault = fault.__cause__ or fault.__context__
    return fault is not None


def _versions() -> str:
    """Of physique and of what it steps with, known without importing them."""
    found = []
    for title, package in (("physique", "physique"), ("MuJoCo", "mujoco")):
        try:
            found.append(f"{title} {version(package)}")
        except PackageNotFoundError:
            found.append(f"no {title}")
    return ", ".join(found)
