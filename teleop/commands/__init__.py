"""Define the subcommands of `teleop`, each in its own file, and the options that they share.

A subcommand imports slow libraries only when it runs, so that `teleop --help` is fast.
"""
