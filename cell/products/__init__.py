"""What is assembled: parts, the joints between them and orders, from product files, STEP or meshes.

Input is validated and repaired here and nowhere else: a `Product` that exists is consistent.
"""
