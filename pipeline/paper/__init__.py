"""The paper, reproduced: a wing that comes off.

It imports the product, never the reverse: without this folder, its doors ``pipeline/paper_*.py``
and ``conf/paper*.yaml`` the rest works on. What the report says of the paper it takes from
``results/paper/claims.json``.
"""
