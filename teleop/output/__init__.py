"""What a person reads afterwards: tables, figures, pages."""
