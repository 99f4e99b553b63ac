"""Contains the output that a person reads: tables, figures and HTML pages."""
