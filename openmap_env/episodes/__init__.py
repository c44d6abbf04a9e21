"""Episodes, their readers and the generator of instructions."""
