"""The crank mechanism of one to N throws with clearance in its joints, compiled.

Bodies: the crank (one angle ``a``), and per throw a rod (centre of mass ``x_r, y_r`` and angle
``b``) and a piston (``x, y`` and tilt ``t``). Axes: x along the stroke from the crank centre to
the cylinder, y across it. The rod points from the wrist pin to the crank pin along
``e = (-cos b, sin b)``; ``g = de/db = (sin b, cos b)``.

A joint is one of four things. *Ideal*: two constraint forces. *Link*: one constraint force along
a massless link as long as the radial clearance, with friction at its ends; the pin never leaves
its eye, and a link in tension says that it would. *Compliant*: the contact force of a law where
the pin overlaps its eye, nothing in free flight. *Oiled*: a film on a yielding wall, without events
(:mod:`.mechanism.oiled_joint`). An ideal guide holds ``y = t = 0``; a compliant
one has a clearance on either side and touches the piston at its four corners.

For a pin at ``d`` from the centre of its eye, with direction ``n`` and ``t`` a quarter turn
further, the force on the rod is ``F_n n + F_t t``, where ``F_t`` follows the sliding velocity
``v_t = d' . t + r_pin w_pin + r_eye b'`` (the rod turns at ``-b'``), so that friction takes energy
out: the printed signs of the source paper put it in. Newton's and Euler's equations of each body
are explicit but for the constraint forces, which solve a linear system of up to four unknowns per
throw; drift is held by Baumgarte's terms. With a motor the crank's acceleration enters every
throw's constraints linearly, so that it too comes out in closed form.

Classical Runge-Kutta with a fixed step; a step in which a contact closes or opens is cut there, so
the order is kept across contact. Forces are recorded as means over the step, that is as exact
impulses, whatever the contacts did in between. A chamber with valves is stepped after the
mechanism, which feels its pressure extrapolated from the two steps before (second order). Where
the throws share two lines, all chambers are tried over a step until the pressures at the lines'
ends agree with what the pump draws (:mod:`wearstate.sim.piping.coupling`).

Sources: Xia, Zhang, Yu, Zhu (2017), Ship Science and Technology 39(1), 51-55; Baumgarte (1972),
doi:10.1016/0045-7825(72)90018-7.

It may import ``sim.jit``, ``sim.output``, ``sim.contact``, ``sim.film``, ``sim.hydraulics``,
``sim.piping``.
"""
