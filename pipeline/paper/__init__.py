"""The paper, reproduced claim by claim, one page each: a wing that comes off.

Imports all rooms below it, and none of them it: without this folder, its doors
``pipeline/paper_*.py`` and ``conf/paper*.yaml`` the rest works on. What the report says of the
paper it takes from ``results/paper/claims.json``.
"""
