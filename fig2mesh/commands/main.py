"""The command line: data on stdout, progress and messages on stderr.

Heavy imports wait until a command runs: `fig2mesh --help` loads only click.
"""

from __future__ import annotations

import difflib
import os.path
import re
import sys
import warnings
from collections.abc import Collection, Sequence

import click

from fig2mesh.commands.annotate import annotate
from fig2mesh.commands.batch import batch
from fig2mesh.commands.data import data
from fig2mesh.commands.doctor import doctor
from fig2mesh.commands.evaluate import evaluate
from fig2mesh.commands.globe import globe
from fig2mesh.commands.inspect import inspect
from fig2mesh.commands.make import make
from fig2mesh.commands.parse import parse
from fig2mesh.commands.plan import plan
from fig2mesh.commands.render import render
from fig2mesh.commands.tileset import tileset
from fig2mesh.commands.tradeoff import tradeoff
from fig2mesh.commands.train import train
from fig2mesh.commands.validate import validate
from fig2mesh.commands.view import view
from fig2mesh.conversion.fields import request_fields
from fig2mesh.conversion.libraries import __version__
from fig2mesh.conversion.request import (
    FigureFiles,
    InferenceOptions,
    MeshOptions,
    OutputOptions,
    PlaceRequest,
)
from fig2mesh.system.surroundings import memory_error, name_error, open_streams, temporary_fault

GROUPS = {
    "Figure": FigureFiles,
    "Place": PlaceRequest,
    "Model": InferenceOptions,
    "Mesh": MeshOptions,
    "Output": OutputOptions,
}
"""Sections of the help, and the part of a request that each describes."""


class MainCommandGroup(click.Group):
    """A group whose first argument may be a figure: then the main command runs."""

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in self.commands:
            return "make", self.commands["make"], args
        return super().resolve_command(ctx, args)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args[:1] == ["help"] and not os.path.exists("help"):
            args = [*args[1:], "--help"]
            if args[0] not in (*self.commands, "--help"):
                raise click.UsageError(_unknown(args[0], self.commands))
        _check_command(args, self.commands)
        # Options of the main command may come before the figure; the group itself only knows these two.
        if args and args[0] not in (*self.commands, "-h", "--help", "--version"):
            args = ["make", *args]
        return super().parse_args(ctx, args)

    def format_usage(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        formatter.write_usage("fig2mesh", "FIGURE [OPTIONS]", "Usage: ")
        formatter.write_usage("fig2mesh", "COMMAND [ARGS]...", "       ")

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        found = self.commands["make"].get_params(ctx)
        options = {option.name: option for option in found if isinstance(option, click.Option)}
        sections = {title: [field.field for field in request_fields(part)] for title, part in GROUPS.items()}
        grouped = {name for names in sections.values() for name in names}
        sections["Messages"] = [name for name in options if name not in grouped]
        for title, names in sections.items():
            records = [record for name in names if name in options and (record := options[name].get_help_record(ctx))]
            if title == "Messages":
                records.append(("--version", "Show the version and exit."))
            with formatter.section(title):
                formatter.write_dl(records)
        self.format_commands(ctx, formatter)


@click.group(
    cls=MainCommandGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
    invoke_without_command=False,
)
@click.version_option(__version__, prog_name="fig2mesh")
def cli() -> None:
    """Turn one drawn human figure into a closed, textured, georeferenced 3D model.

    FIGURE is a picture of one figure. The silhouette comes from --mask or the alpha channel, the
    joints from --keypoints; anything missing is inferred from the picture.
    """


for command in (
    make,
    plan,
    parse,
    annotate,
    render,
    view,
    batch,
    tileset,
    globe,
    inspect,
    validate,
    tradeoff,
    evaluate,
    data,
    train,
    doctor,
):
    cli.add_command(command)


def _check_command(args: Sequence[str], commands: Collection[str]) -> None:
    """Raise UsageError for a first word that looks like a misspelt command rather than a missing figure."""
    if not args or args[0].startswith("-") or args[0] in commands or os.path.exists(args[0]):
        return
    word, suffix = os.path.splitext(args[0])
    followed = len(args) > 1 and not args[1].startswith("-")
    if suffix and not followed:
        return
    # Two words in a row that are no command and no file can only be a command that does not exist, and its argument.
    if difflib.get_close_matches(word, commands, 1) or (followed and not suffix):
        raise click.UsageError(_unknown(args[0], commands))


def _unknown(word: str, commands: Collection[str]) -> str:
    near = difflib.get_close_matches(os.path.splitext(word)[0], commands, 1)
    return f"unknown command {word!r:.80}" + (f" (did you mean {near[0]!r}?)" if near else "")


def _usage(error: click.ClickException, words: Sequence[str]) -> str:
    """One line for wrong usage: the finding, the values that an option takes, and the help that lists it."""
    message = " ".join(error.format_message().split()).rstrip(".")
    path, command = ["fig2mesh"], cli.commands["make"]
    group: click.Command = cli
    for word in words:
        if not isinstance(group, click.Group) or word not in group.commands:
            break
        path.append(word)
        group = command = group.commands[word]
    if isinstance(error, click.BadOptionUsage) and "requires" in message:
        options = [each for each in command.params if error.option_name in each.opts]
        message += "".join(f", {each.metavar}" for each in options if each.metavar and each.nargs > 1)
    if message.startswith("Got unexpected extra argument") and path == ["fig2mesh"]:
        return f"{message}; give one figure, or a table of figures to fig2mesh batch"
    return f"{message}; see {' '.join(path)} --help"


def _os_error(error: OSError) -> str:
    """One line for an error of the system: paths fail in more ways than can be listed."""
    if error.filename is None and (fault := memory_error(error) or temporary_fault()) is not None:
        return fault
    where = str(error.filename or "a file")
    shown = where if len(where) < 200 else f"{where[:80]}…{where[-80:]}"
    return f"{shown}: {error.strerror or 'cannot be used'}; check the path"


def main(arguments: list[str] | None = None) -> int:
    """Run the command line and return its exit code: 0 success, 2 bad usage or input, 1 internal error."""
    from georef.errors import InputError

    words = sys.argv[1:] if arguments is None else arguments
    open_streams()
    # Pillow warns about damaged tags, in two lines with its own path; our readers report what matters themselves.
    warnings.filterwarnings("ignore", category=UserWarning, module=r"PIL\.")
    try:
        result = cli.main(words, prog_name="fig2mesh", standalone_mode=False)
        return result if isinstance(result, int) else 0
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return 2
    except click.ClickException as error:
        click.echo(f"fig2mesh: {_usage(error, words)}", err=True)
        return 2
    except InputError as error:
        click.echo("fig2mesh: " + " ".join(str(error).split()), err=True)
        return 2
    except OSError as error:
        click.echo(f"fig2mesh: {_os_error(error)}", err=True)
        return 2
    except (KeyboardInterrupt, click.Abort):
        click.echo("fig2mesh: interrupted; no output is half-written", err=True)
        return 130
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else 1
    except Exception as error:
        if verbosity(words) > 1:
            raise
        if (finding := memory_error(error) or name_error(error)) is not None:
            click.echo(f"fig2mesh: {finding}", err=True)
            return 2
        click.echo(f"fig2mesh: internal error: {type(error).__name__}: {error} (-vv shows where)", err=True)
        return 1


def verbosity(words: Sequence[str]) -> int:
    """Number of times that --verbose is among the words of a command line."""
    return sum(word.count("v") if re.fullmatch("-[qv]+", word) else word == "--verbose" for word in words)


if __name__ == "__main__":
    raise SystemExit(main())
