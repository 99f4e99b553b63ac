"""The devices of a rig, one kind per file. `drivers.registry` finds the class of a kind."""
