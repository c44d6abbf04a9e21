"""Everything that perceives, remembers, understands and acts."""
