"""One channel at a time: transforms, spectra, statistics, cepstrum, envelope, severity.

It imports nothing else of the package.
"""
