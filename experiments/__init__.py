"""Run, measure, report. Each file in this folder is a script: ``python -m experiments.NAME``.

The folders are what the scripts share, from the lowest up:

- `reporting`: files, pages, plots, pictures.
- `jig`: element tests of the soft jig alone.
- `plan`, `assembly`: ``soft-jig plan`` and ``soft-jig assemble``.
- `paper`: its experiments, ``soft-jig place``, ``push`` and ``regress``.
- `cli`: the command line.

A test keeps their imports pointing down.
"""
