"""An elastic shaft: beam elements, natural frequencies, Campbell diagram, unbalance response.

It may import ``sim.brief``.
"""
