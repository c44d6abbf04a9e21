"""Grounding alone: questions to maps without a walk and without perception."""
