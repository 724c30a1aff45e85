"""Processes that share work: on this computer or on a Dask cluster.

It may import ``sim.output``, ``datasets.file``.
"""
