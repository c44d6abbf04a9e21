"""``openmap eval perception``: masks and names by themselves, before any map is built.

``observe`` renders views of a scene and keeps what a segmenter and an encoder said of them; ``figures`` turns that into numbers
(``masks``, ``labels``, ``retrieval``, ``uses``, ``colour``); ``tables`` and ``page`` show them, ``command`` puts it all together.
"""
