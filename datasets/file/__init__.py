"""The HDF5 file of a data set: layout, manifest columns, machines, views, lock.

It may import ``sim.atomic``, ``sim.output``, ``sim.scene``.
"""
