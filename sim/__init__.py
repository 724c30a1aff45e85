"""The physics: a scene goes in, a time history comes out."""
