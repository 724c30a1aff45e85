"""One channel at a time: transforms, spectra, statistics, cepstrum, envelope, severity.

It may import nothing of the house.
"""
