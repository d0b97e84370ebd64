"""Which entries of each kind there are, and where: the library's own, and those of packages.

``extensions`` has the registries that entry points extend, ``registry`` that of block types,
``index`` where the library's names are, and ``lazy`` the doors that import them on first use.
"""
