"""The catalogue of features, and the row that they make of one recording.

It may import ``features.signal``, ``features.response``, ``features.rotation``.
"""
