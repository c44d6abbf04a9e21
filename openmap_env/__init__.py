"""A Gymnasium environment for instruction grounding in indoor meshes."""
