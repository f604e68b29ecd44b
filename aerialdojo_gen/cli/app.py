"""The command line: one thin command a stage; the library does the work.

Nothing heavy is imported before a command runs, so that ``--help`` answers at once.
"""

from __future__ import annotations

import sys
import traceback
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from aerialdojo_gen.base import cli_context, environment_errors, memory, terminal
from aerialdojo_gen.base.errors import AerialDojoError
from aerialdojo_gen.cli import evaluate, exchange, places, release, render, report, sources, stages, validate

_HEADINGS = {
    "Look at a dataset": ("stats", "show", "view", "gallery", "validate"),
    "Evaluate and train agents": ("evaluate", "fly", "report", "train", "score", "leaderboard"),
    "Add your own scenes": ("vary", "add-scene", "add-map", "add-terrain", "annotate-draft", "annotate"),
    "Exchange and share": ("export", "import-benchmark", "push-to-hub", "pull"),
}


class _Commands(TyperGroup):
    """Lists the commands by purpose, with their complete help."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the names and their help, wrapped."""
        names = self.list_commands(ctx)
        sections: dict[str, Any] = {"Commands": names}
        if ctx.parent is None:
            making = [name for name in names if not any(name in group for group in _HEADINGS.values())]
            sections = {"Make a dataset": sorted(making, key=lambda name: name != "run"), **_HEADINGS}
        for heading, group in sections.items():
            with formatter.section(heading):
                formatter.write_dl([(n, (self.commands[n].help or "").partition("\n\n")[0]) for n in group])

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Give help where nothing is asked for."""
        return super().parse_args(ctx, args or ["--help"])

    def invoke(self, ctx: Any) -> Any:
        """Run the command, with nothing kept of another one."""
        cli_context.reset_context(sys.argv[0])
        return super().invoke(ctx)


def _new() -> typer.Typer:
    return typer.Typer(
        cls=_Commands,
        name="aerialdojo-gen",
        help="Generate aerial object-goal-search datasets: scenes, tasks, certified routes, RGB-D recordings.",
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # half of the time that --help takes is importing what draws boxes
        context_settings={"help_option_names": ["-h", "--help"]},
    )


app = _new()


def _version(value: bool) -> None:
    if value:
        from aerialdojo_gen.base.version import __version__

        print(f"aerialdojo-gen {__version__}")
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Say which version this is.")
    ] = False,
) -> None:
    """Accept options before the command."""


_GROUPS = (stages, render, sources, places, evaluate, release, validate, exchange, report)
for _group in _GROUPS:
    app.add_typer(_group.app)
app.add_typer(stages.config_app, name="config", cls=_Commands)


def _app_for(named: list[str]) -> typer.Typer:
    """Return an app with only the named command, else with all: Typer's set-up takes time for each."""
    for info in [info for group in _GROUPS for info in group.app.registered_commands]:
        if [info.name] == named:
            alone = _new()
            alone.registered_callback = app.registered_callback
            alone.registered_commands = [info]
            return alone
    return app


# Its base is the class of all that is wrong with options; Typer has Click's, or its own, by its version.
_BadOption: Any = typer.BadParameter.__bases__[0]


def main() -> None:
    """Run the command line; an expected error becomes one line and an exit code."""
    memory.set_up()
    environment_errors.use_utf8()
    with terminal.standard_streams():
        try:
            code, message = _run()
        except Exception:  # a defect: what its traceback quotes is cleaned too
            traceback.print_exc()
            code, message = 1, ""
        if message:
            print(f"error: {message}", file=sys.stderr)
    raise SystemExit(code)


def _run() -> tuple[int, str]:
    """Run the command; return its exit code, and an expected error as one line."""
    try:
        environment_errors.check_arguments(sys.argv[1:])
        environment_errors.check_limits(sys.argv[1:])
        try:
            called = cli_context.program(sys.argv[0]) or cli_context.PROGRAM
            return _app_for(sys.argv[1:2])(prog_name=called, standalone_mode=False) or 0, ""
        finally:
            sys.stdout.flush()
    except _BadOption as error:
        where = f"; see {error.ctx.command_path} --help" if error.ctx else ""
        return error.exit_code, f"{error.format_message().rstrip('.')}{where}"
    except Exception as error:
        ours = isinstance(error, AerialDojoError)
        message = str(error) if ours else environment_errors.environment_error(error)
        if message is None:
            raise
        return getattr(error, "exit_code", 1), "\n".join([message, *getattr(error, "__notes__", ())])


if __name__ == "__main__":
    main()
