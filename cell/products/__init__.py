"""What is assembled: parts, fasteners and orders, from product files, STEP, glTF or meshes.

Input is checked and repaired here and nowhere else; a `Product` that exists can be used.
"""
