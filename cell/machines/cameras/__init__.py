"""Cameras: pinhole geometry, rendering, what a stereo camera makes of depth, and the device."""
