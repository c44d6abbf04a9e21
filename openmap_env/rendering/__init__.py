"""Three backends behind one protocol."""
