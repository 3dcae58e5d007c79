"""Converts STEP to binary glTF in a process of its own, within limits: a script.

    python step_to_gltf.py DEFLECTION ANGLE SECONDS BYTES FILE <in.step

OpenCASCADE crashes on some files, takes all memory or never ends on others, and writes to standard
output. So it runs apart from the process that needs its result, which it writes to FILE.
"""

import resource
import sys
from pathlib import Path


def main() -> None:
    """Convert; the file stays empty if the input is no STEP file."""
    deflection, angle = map(float, sys.argv[1:3])
    seconds, memory = map(int, sys.argv[3:5])
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    import cascadio  # Within the limits.

    data = cascadio.load(
        sys.stdin.buffer.read(), tol_linear=deflection, tol_angular=angle, use_parallel=False
    )
    Path(sys.argv[5]).write_bytes(data)


if __name__ == "__main__":
    main()
