"""Online estimators, one a file."""
