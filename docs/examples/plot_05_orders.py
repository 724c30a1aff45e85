"""
Orders of a pump
================

An order spectrum does not smear when the speed varies. The harmonics of one impact per
revolution are strongest at the lowest casing mode, 142 Hz, near order 28.
"""

import wearstate

pump = wearstate.load_scene("bilge-pump", {"joint.crankpin.diametral_clearance": "0.2 mm"})
recording = wearstate.simulate(pump, seed=1)
wearstate.features.order_spectrum(recording).plot(high=60)
