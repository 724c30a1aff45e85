"""The catalogue of features, and the feature row of a recording.

It may import ``features.signal``, ``features.response``, ``features.rotation``.
"""
