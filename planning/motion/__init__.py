"""How an arm gets somewhere: kinematics, collisions, paths, timing."""
