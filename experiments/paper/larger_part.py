"""A part that has come out larger than it was drawn."""

from __future__ import annotations

import numpy as np
import trimesh

SAME = 1e-3  # Faces whose normals differ by less are one [A].


def larger(mesh: trimesh.Trimesh, growth: float) -> trimesh.Trimesh:
    """Return a closed mesh with every face moved outward by half a growth [m].

    A corner goes where its moved faces meet; where more than three do, to the nearest place by
    least squares.
    """
    normals, moves = np.asarray(mesh.face_normals), np.zeros(mesh.vertices.shape)
    for corner, faces in enumerate(mesh.vertex_faces):
        own = np.unique(np.round(normals[faces[faces >= 0]] / SAME), axis=0) * SAME
        if len(own):
            moves[corner] = np.linalg.lstsq(own, np.full(len(own), growth / 2), rcond=SAME)[0]
    return trimesh.Trimesh(mesh.vertices + moves, mesh.faces, process=False)
