"""Online estimators, one per file."""
