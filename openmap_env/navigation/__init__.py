"""Where a body can stand and walk: the navigable surface, geodesic distance, shortest paths."""
