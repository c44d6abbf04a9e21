"""What walking through a home shows of it: coverage over steps, and whether the body gets stuck."""
