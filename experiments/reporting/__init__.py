"""What every room writes with: whole files, HTML pages, plots, pictures without a display.

It imports no other room.
"""
