"""What a run gives back: the solution with its status, sensors and the converter.

It may import nothing of the house.
"""
