"""Define the subcommands of `teleop`, one per file.

A subcommand imports slow libraries only when it runs.
"""
