"""The subcommands of `teleop`, one per file; slow imports are made when they run."""
