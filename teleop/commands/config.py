"""`teleop config`: write and check configuration files of trials."""

from __future__ import annotations

from pathlib import Path

from cyclopts import App

from teleop.commands.options import Json, Overwrite

config = App(name="config", help="Write and check configuration files of trials.")


@config.command
def init(
    out: Path = Path("trial.toml"), /, *, source: Path | None = None, overwrite: Overwrite = False
) -> int:
    """Write a configuration file with the default settings of a trial, and with comments.

    Example: `teleop config init trial.toml`

    Parameters
    ----------
    out
        File to write (TOML).
    source
        Recording or configuration file. The settings in this file are written instead of the
        defaults.
    """
    from teleop.files import write_text
    from teleop.output.next_command import print_command
    from teleop.settings.configuration import read_configuration, write_configuration
    from teleop.settings.trial_settings import TrialSettings

    settings = read_configuration(source) if source else TrialSettings()
    write_text(out, write_configuration(settings), overwrite)
    print_command(f"{out}: run it with", ["teleop", "run", "--config", str(out)])
    return 0


@config.command
def check(file: Path, /, *, json: Json = False) -> int:
    """Check the settings in a configuration file, and report all problems.

    Example: `teleop config check trial.toml`

    Parameters
    ----------
    file
        Configuration file, or a recording.
    """
    from teleop.output.console import plain_console, print_json
    from teleop.settings.configuration import read_configuration
    from teleop.settings.documents import to_document

    settings = read_configuration(file, complete=True)
    if json:
        print_json(to_document(settings))
    else:
        plain_console().print(
            f"{file}: {settings.condition_name}, {settings.palpated}, {settings.duration:g} s at "
            f"{settings.loop_rate:g} Hz: no problem found"
        )
    return 0


@config.command
def schema() -> int:
    """Print the JSON schema of configuration files. Editors use it to complete and check the files.

    Example: `teleop config schema > trial.schema.json`
    """
    from teleop.output.console import print_json
    from teleop.settings.trial_settings import schema

    print_json(schema())
    return 0
