"""Data sets: file layout, generation, import, splits."""
