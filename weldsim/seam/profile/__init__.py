"""The default seam finder: cross-sections fitted along a smooth curve."""
