"""What the experiments with cameras share: errors of estimates, and pictures with boxes."""
