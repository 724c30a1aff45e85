"""
Orders of a pump
================

Over the shaft order a spectrum does not smear when the speed wanders. Harmonics of one impact a
revolution are strongest at the lowest casing mode, 142 Hz, near order 28.
"""

import wearstate

pump = wearstate.load_scene("bilge-pump", {"joint.crankpin.diametral_clearance": "0.2 mm"})
recording = wearstate.simulate(pump, seed=1)
wearstate.features.order_spectrum(recording).plot(high=60)
