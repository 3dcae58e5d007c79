"""How an arm gets somewhere: collisions, paths, timing."""
