"""
Envelope spectrum of a worn crank pin
=====================================

The envelope of a resonance band has a line at every harmonic of the shaft speed, 5 Hz: one impact
per revolution.
"""

import wearstate

pump = wearstate.load_scene("bilge-pump", {"joint.crankpin.diametral_clearance": "0.3 mm"})
recording = wearstate.simulate(pump, seed=1)
found = wearstate.features.envelope_spectrum(recording, band=(2000.0, 6000.0), kind="plain")
found.plot(high=100)
