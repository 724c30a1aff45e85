"""Cylinder pressure of a reciprocating pump, compiled, from none to a chamber with valves.

Crank angle 0 is the top dead centre, where the piston position x is largest; the piston withdraws
(suction) from 0 to pi. A gauge pressure p pushes the piston with ``-A p`` along x.

===========  ========================================  =====================================
rung         assumes                                   gives
===========  ========================================  =====================================
none         no pressure                               0
constant     a plunger against a constant pressure     `discharge`
two-level    quasi-static, lines without loss          `suction` and `discharge` in turn
heads        quasi-static, liquid without compression  energy balance of the lines, added mass
chamber      one pressure in the chamber, manifolds    compression, air, vapour, moving valves,
             at constant pressure                      leaks, stuck valves
*-lines      as chamber, on two pipes of all throws    pulsation, waves, damper, relief valve
===========  ========================================  =====================================

The first four are functions of the piston's motion (:mod:`.hydraulics.piston_pressure`); the
chamber has a state of its own (:mod:`.hydraulics.chamber`), and so have pipes
(:mod:`wearstate.sim.piping.pipe`).

It may import ``sim.jit``, ``sim.parts``, ``sim.scene``.
"""
