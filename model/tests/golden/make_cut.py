"""An oracle for cuts of pictures that may reach over the border. Needs numpy.

usage: python make_cut.py SEED OUT.json
"""
import json, sys
import numpy as np

seed, out = int(sys.argv[1]), sys.argv[2]
random = np.random.RandomState(seed)
# By padding and slicing.
height, wide, channels, size, pad = 7, 6, 2, [5, 4], 8
picture = random.randint(0, 256, (height, wide, channels))
views = []
for top in (-8, -4, -1, 0, 1, 2, 6):
    for left in (-7, -2, 0, 2, 5):
        view = {"place": [top, left]}
        for name, mode in (("repeated", "edge"), ("black", "constant")):
            padded = np.pad(picture, ((pad, pad), (pad, pad), (0, 0)), mode)
            view[name] = padded[top + pad : top + pad + size[0], left + pad : left + pad + size[1]].ravel().tolist()
        views.append(view)
golden = {"in": {"picture": picture.ravel().tolist(), "shape": [height, wide, channels], "size": size}, "out": {"views": views}}
json.dump({"format": "vibes-golden-cut/1", "seed": seed, "made_by": "make_cut.py (numpy)"} | golden, open(out, "w"))
