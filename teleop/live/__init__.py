"""What a person sees while a trial runs."""
