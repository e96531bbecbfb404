"""Places of the contact state in its array: contact coordinates, then what a contact accumulates."""

from __future__ import annotations

TIME, X, PHI, GAP, V_N, V_T, OMEGA = range(7)
IMPULSE_N, IMPULSE_T, IMPULSE_R, HYSTERESIS, SLIDING, ROLLING = range(7, 13)
STORED = 13  # elastic energy at the end of the contact
ON_CHORD = 14  # 1 if both corners have touched
FEATURE = 15  # whose gap, v_n and v_t these are
ARM_A, ARM_B = 16, 17  # [m] arms at the touchdown
STATE_SIZE = 18
