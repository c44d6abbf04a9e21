"""Drop-ins from ONNX files: SAM-family and YOLO-seg segmenters, CLIP-family encoders.

Nothing here needs torch; a model is a file of the user's, opened and checked by :mod:`.session`.
"""
