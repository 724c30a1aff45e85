"""Whether a recording is of the kind trained on: distance, noise floor, quietness, bandwidth.

It may import ``diagnose.feature_rows``.
"""
