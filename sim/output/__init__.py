"""What a run gives back: the recording, how the run ended, sensors and the converter.

It may import nothing of the house.
"""
