"""The subcommands of `teleop`, one a file; heavy imports wait for their call."""
