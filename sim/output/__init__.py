"""Results of a run: recording and status; sensors and the converter.

It may import no other module of the package.
"""
