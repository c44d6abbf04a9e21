"""Instruction -> description -> candidates -> choice."""
