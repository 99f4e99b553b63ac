"""Output for a person: tables, figures and HTML pages."""
