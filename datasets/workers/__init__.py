"""Processes that share work: on this computer or on a Dask cluster.

It may import ``datasets.file``.
"""
