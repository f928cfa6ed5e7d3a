"""Forces, moment and heating of the whole vehicle: which law where, integrated over the surface.

``prepare`` turns a vehicle and a choice of methods into an :class:`AeroModel`, a named tuple of plain arrays;
``loads`` evaluates it at one flight condition without allocating.

Indices of the array that ``loads`` fills (all per the vehicle's reference area and length):

=================== ========================================================================
CA                  axial force, positive aft, with base pressure and skin friction
CN                  normal force, positive away from the windward side, >= 0
CM_NOSE             pitching moment about the nose tip, positive nose-up (< 0 when stable)
XCP_M               centre of pressure aft of the nose tip, m (its limit at zero incidence)
CMQ                 pitch damping about the centre of gravity, per q D / V
STAGNATION_HEAT_FLUX  heat flux at the nose stagnation point, W/m2
SURFACE_HEAT_RATE   heat flux integrated over the surface without the base, W
CA_FRICTION         the skin-friction part of CA
CN_FRICTION         the skin-friction part of CN
CA_BASE             the base-pressure part of CA
=================== ========================================================================
"""

from __future__ import annotations

CA = 0
CN = 1
CM_NOSE = 2
XCP_M = 3
CMQ = 4
STAGNATION_HEAT_FLUX = 5
SURFACE_HEAT_RATE = 6
CA_FRICTION = 7
CN_FRICTION = 8
CA_BASE = 9
N_LOADS = 10
