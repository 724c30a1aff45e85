"""
A worn crank pin
================

At each reversal of the rod force the pin crosses its clearance, and the casing rings: the
channels of a pump with 0.25 mm of clearance, over two revolutions.
"""

import wearstate

pump = wearstate.load_scene("bilge-pump", {"joint.crankpin.diametral_clearance": "0.25 mm"})
recording = wearstate.simulate(pump, seed=1)
axes = recording.plot()
axes[0].set_xlim(0, 2 * 0.2)  # [s], at 300 rpm
