"""The catalogue of features, and the feature row of a recording.

May import ``features.signal``, ``features.response``, ``features.rotation``.
"""
