"""One channel at a time: transforms, spectra, statistics, cepstrum, envelope, severity.

Imports nothing else of the package.
"""
