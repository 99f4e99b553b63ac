"""Define the subcommands of `teleop`, one per file. Slow libraries are imported when one runs."""
