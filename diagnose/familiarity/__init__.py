"""Whether a recording resembles the training data: distance, noise floor, quietness, bandwidth.

It may import ``diagnose.feature_rows``.
"""
