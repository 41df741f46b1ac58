"""The commands, how their arguments are parsed, and what becomes of an error.

The one file that imports cyclopts. Commands import nothing heavy before they are run.
"""

from __future__ import annotations

import importlib
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Literal, get_args, get_origin

from cyclopts import App, CycloptsError, Group, Parameter, Token
from cyclopts.exceptions import (
    CoercionError,
    MissingArgumentError,
    RepeatArgumentError,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)

from aobake import AobakeError, Cancelled, SettingsError, __version__
from aobake.cli import terminal
from aobake.cli.leaving import Terminated, obey_sigterm
from aobake.errors import nearest

__all__ = ["COMMANDS", "Group", "Parameter", "Token", "build", "run"]

COMMANDS = {
    "vertex": "Bake ambient occlusion to vertex colours.",
    "texture": "Bake ambient occlusion to a lightmap texture.",
    "batch": "Bake a folder of assets, and later what has changed in it.",
    "watch": "Bake what changes in a folder of assets, as it changes.",
    "render": "Preview with a local illumination model and the baked ambient occlusion.",
    "view": "Show an asset with its ambient occlusion on, off and alone, in one page.",
    "study": "Measure what accuracy costs in time on an asset.",
    "plan": "Show which effects a bake would simulate, why, and at what cost.",
    "info": "Show what is in an asset; without one, versions and the machine.",
    "demo": "Bake a scene that aobake makes itself, to see what it does.",
}
"""In the order of the help: each is a function in a file of its name, and here is how its docstring begins.

Said twice so that one command is imported at a time: all of them took half of the time of --help.
"""


def build(chosen: str | None) -> App:
    """The application; of its commands, the chosen one can be run, and the others are listed."""
    app = App(
        name="aobake",
        help=(
            "Bake ambient occlusion into meshes, and get each asset back whole.\n\n"
            "aobake COMMAND --help explains a command."
        ),
        help_format="plaintext",
        version=__version__,
        default_parameter=Parameter(negative=(), show_default=False),
        result_action="return_value",
        suppress_keyboard_interrupt=False,
        exit_on_error=False,
        print_error=False,
    )
    app["--help"].group = app["--version"].group = Group("Options", sort_key=9)
    app["--help"].help, app["--version"].help = "Show this.", "Show the version."
    for number, (name, summary) in enumerate(COMMANDS.items()):
        if name == chosen:
            module = importlib.import_module(f"aobake.cli.{name}")
            app.command(getattr(module, name), name=name, sort_key=number)
        else:
            app.command(_listed, name=name, help=summary, sort_key=number)
    return app


def _listed() -> None:
    """Stands for a command that is not to be run."""


def run(arguments: Sequence[str]) -> int:
    """Run one command and return its exit status; an error becomes one line on stderr.

    With --debug among the arguments the traceback of an error is shown as well.
    """
    obey_sigterm()
    try:
        chosen = next((word for word in arguments if word in COMMANDS), None)
        status = build(chosen)(list(arguments))
        sys.stdout.flush()
        return status if isinstance(status, int) else 0
    except BrokenPipeError:  # the reader of our output has gone, as in `aobake info | head -1`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 - the last place to say it
        if "--debug" in arguments:
            traceback.print_exc()
        message, status = _explained(error, arguments)
        terminal.error(message)
        return status


def _explained(error: BaseException, arguments: Sequence[str]) -> tuple[str, int]:
    """The line and the exit status that an error is worth."""
    match error:
        case CycloptsError():
            return _usage(error), 2
        case Terminated():
            return "terminated.", 143
        case KeyboardInterrupt() | Cancelled():
            return "interrupted.", 130
        case SettingsError():
            return str(error), 2
        case AobakeError():
            return str(error), 1
        case MemoryError():
            return f"{_asset(arguments)}there is not enough memory for this.", 1
        case _:
            what = f"{type(error).__name__}: {error}".rstrip(": ")
            bug = f"this should not happen: {what}. --debug shows where; please report it."
            return f"{_asset(arguments)}{bug}", 1


def _asset(arguments: Sequence[str]) -> str:
    """The input that a command was given, to begin a message with."""
    words = [word for word in arguments[1:2] if not word.startswith("-")]
    return f"{words[0]}: " if words else ""


def _usage(error: CycloptsError) -> str:
    """What was wrong with the arguments, in one line that names the nearest known ones."""
    command = " ".join(error.command_chain or ())
    cure = f' See "{" ".join(["aobake", *command.split()])} --help".'
    match error:
        case UnknownOptionError():
            known = {name for argument in error.argument_collection for name in argument.names}
            wrong = (error.token.keyword or error.token.value).split("=")[0]
            return f"there is no option {wrong}.{_did_you_mean(wrong, known, cure)}"
        case UnknownCommandError():
            wrong = (error.unused_tokens or [""])[0]
            if wrong.startswith("-"):
                return f"there is no option {wrong} before a command.{cure}"
            return f"there is no command {wrong}.{nearest(wrong, COMMANDS)}"
        case MissingArgumentError() if error.argument is not None:
            name = error.keyword or error.argument.name
            what = "needs a value" if error.keyword else "is missing"
            return f"{name} {what}.{cure}"
        case RepeatArgumentError():
            return f"{error.token.keyword} is given more than once.{cure}"
        case UnusedCliTokensError():
            return f"{(error.unused_tokens or [''])[0]!r} is one argument too many.{cure}"
        case CoercionError() if error.token is not None:
            return _wrong_value(error)
    return str(error) or f"the arguments were not understood.{cure}"


def _wrong_value(error: CoercionError) -> str:
    token = error.token
    if token is None:
        return str(error)
    name = token.keyword or (error.argument.name if error.argument else "an argument")
    wanted = error.target_type
    if get_origin(wanted) is Literal:
        return f"{name} is {token.value!r}.{nearest(token.value, map(str, get_args(wanted)))}"
    if wanted is bool:
        return f"{name} is a switch; it takes no value."
    kind = "a whole number" if wanted is int else "a number"
    return f"{name} is {token.value!r}; {kind} is needed."


def _did_you_mean(wrong: str, known: set[str], cure: str) -> str:
    found = nearest(wrong, known)
    return found if found.startswith(" Did") else cure
