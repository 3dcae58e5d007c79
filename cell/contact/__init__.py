"""Contact between bodies that stick: linear springs in place of polygons, for as long as it holds.

`polygons` reads what touches, `springs` makes six springs of it, `link` says whether they still
stand for the contact, `plant_side` exchanges one for the other in Drake, and `links` does it in a
diagram. Which contacts may be linked at all is up to `cell.link_policy`.
"""
