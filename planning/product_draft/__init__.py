"""From CAD alone to a product that can be run: joints, contact models, grasps and a tray, guessed.

Every guess states its reason and how sure it is; the product file that results is a person's to
edit. `planning.product_draft.draft.draft_product` makes it.
"""
