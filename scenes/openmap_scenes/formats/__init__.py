"""One reader per on-disk format; each gives a Scene in the world frame."""
