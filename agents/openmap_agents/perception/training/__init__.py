"""Trains the default perception on renders of the built-in homes: ``openmap train perception``.

``frames`` draws views, ``augment`` makes a real camera of the renderer's, ``shards`` keeps on disk what was seen, ``network``
is the convolutional part, ``fit_neck``, ``fit_regions`` and ``fit_segmenter`` learn, ``run`` puts them in order.
"""
