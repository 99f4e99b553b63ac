"""The devices of a rig. Each file has one kind. `drivers.registry` finds the class of a kind."""
