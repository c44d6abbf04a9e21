"""How well and how cheaply maps are made: walks through scenes with known ids, masks good and bad, AP, robustness."""
