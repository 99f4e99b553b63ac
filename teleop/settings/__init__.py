"""The settings of a trial: one model, its checks, and its documents (TOML, JSON)."""
