"""What simulated time costs: classes of phases, the calibration kernel, start states, layers."""
