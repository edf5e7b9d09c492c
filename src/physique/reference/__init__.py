"""WHAT this body should do: the motion on its skeleton, on the simulator's grid."""
