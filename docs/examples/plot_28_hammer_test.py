"""
Transfer function from a hammer test
====================================

Twenty impacts on the casing of a pump at rest: magnitude and coherence. Where the coherence is low,
the estimate is noise.
"""

import wearstate

test = {"running": False, "exciters.0.force": "500 N"}
recording = wearstate.simulate(wearstate.load_scene("bilge-pump", test), seed=1)
wearstate.features.frf(recording).plot()
